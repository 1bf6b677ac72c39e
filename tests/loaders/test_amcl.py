"""AMCL's parameters as settings: what each means here, and what is wrong with a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from maurice_loaders.amcl import read_amcl
from maurice_loaders.config_files import configuration_of
from maurice_loaders.errors import InputError
from maurice_mcl.config.parameters import AMCL, FilterParameters
from maurice_mcl.filter.motion import MOTION_MODELS
from maurice_mcl.filter.resampling import kld_size
from maurice_mcl.values.map import Arena, make_grid
from maurice_mcl.values.randomness import normals, stream

# As Nav2 ships it: other nodes, an anchor, comments
NAV2 = """
amcl:  # the localizer
  ros__parameters: &all
    alpha1: 0.11
    alpha2: 0.12
    alpha3: 0.13
    alpha4: 0.14
    alpha5: 0.15
    base_frame_id: "base_footprint"
    laser_model_type: "likelihood_field_prob"
    max_beams: 90
    max_particles: 3000
    min_particles: 700
    pf_err: 0.04
    pf_z: 0.95
    recovery_alpha_fast: 0.1
    recovery_alpha_slow: 0.001
    resample_interval: 2
    robot_model_type: "nav2_amcl::DifferentialMotionModel"
    sigma_hit: 0.25
    transform_tolerance: 1.0
    update_min_a: 0.3
    update_min_d: 0.35
    z_hit: 0.6
amcl_rclcpp_node:
  ros__parameters: {use_sim_time: true}
controller_server:
  ros__parameters: {controller_frequency: 20.0, FollowPath: {max_vel_x: 0.26, time_steps: 56}}
local_costmap:
  local_costmap: {ros__parameters: {scan: {topic: /scan, max_obstacle_height: 2.0}}}
"""
ROS1 = """
odom_model_type: omni-corrected
odom_alpha1: 0.11
odom_alpha2: 0.12
odom_alpha3: 0.13
odom_alpha4: 0.14
odom_alpha5: 0.15
laser_max_beams: 40
kld_err: 0.02
initial_pose_x: 1.0
initial_pose_a: 0.5
initial_cov_xx: 0.04
initial_cov_aa: 0.01
"""
NO_MAP = make_grid(Arena((0.0, 0.0, 1.0, 1.0), np.zeros((0, 4))), np.full((1, 2), 0.5))


def _file(folder: Path, text: str) -> Path:
    file = folder / "params.yaml"
    file.write_text(text)
    return file


def _filter(folder: Path, text: str) -> FilterParameters:
    return configuration_of(None, _file(folder, text), {}, {}).parameters


def _nav2(**changed: Any) -> str:
    lines = {"laser_model_type": "likelihood_field", "max_beams": 60, "alpha1": 0.2} | changed
    return "amcl:\n  ros__parameters:\n" + "".join(f"    {name}: {value}\n" for name, value in lines.items())


def _moved(motion: Any, way: Any) -> np.ndarray:
    """Many particles at the origin after one movement (3,)."""
    read, make = MOTION_MODELS[motion["model"]]
    here, noise = np.zeros((100_000, 3), np.float32), normals(stream(5, 1, purpose=1), 100_000)
    moved = make(read(motion), NO_MAP).move(here, np.zeros(2), np.array(way), noise)
    return np.asarray(moved, np.float64)


def test_each_parameter_becomes_a_setting(tmp_path):
    found, amcl = _filter(tmp_path, NAV2), read_amcl(_file(tmp_path, NAV2))
    laser = found.sensor.laser
    assert (laser.model, laser.max_beams, laser.sigma_hit, laser.z_hit) == (
        "likelihood_field_prob",
        90,
        0.25,
        0.6,
    )
    assert (laser.z_rand, laser.laser_likelihood_max_dist) == (0.5, 2.0)  # Nav2's defaults
    kld = found.resampling.kld
    assert (found.particles, kld.least, kld.most, kld.epsilon) == (3000, 700, 3000, 0.04)
    assert (found.resampling.when, found.resampling.every, found.resampling.adaptive) == ("every", 2, True)
    assert (kld.bin_m, kld.heading_bins) == (0.5, 36)
    recovery = found.recovery
    assert (recovery.strategy, recovery.draw) == ("augmented", "evenly")
    assert (recovery.augmented.slow, recovery.augmented.fast) == (0.001, 0.1)
    assert (amcl.min_distance_m, amcl.min_angle_rad, amcl.start) == (0.35, 0.3, None)


def test_what_means_nothing_offline_and_what_is_not_known_is_said(tmp_path):
    (offline,) = read_amcl(_file(tmp_path, NAV2)).remarks
    assert offline.endswith("base_frame_id, transform_tolerance")
    (unknown,) = read_amcl(_file(tmp_path, _nav2(alhpa2=3))).remarks
    assert "'alhpa2'" in unknown
    assert "not AMCL's" in unknown


def test_the_defaults_are_the_preset(tmp_path):
    """A file that says nothing is AMCL with Nav2's defaults, as `--preset amcl` is."""
    settings = read_amcl(_file(tmp_path, _nav2())).settings
    for key, value in AMCL.items():
        assert settings[key] == (pytest.approx(value) if isinstance(value, float) else value), key


def test_the_number_of_particles_is_amcls(tmp_path):
    """pf.c's formula takes pf_z as the quantile itself."""
    kld = _filter(tmp_path, NAV2).resampling.kld
    bins = np.arange(2, 300)
    b = 2 / (9 * (bins - 1))
    expected = np.ceil((bins - 1) / (2 * 0.04) * (1 - b + np.sqrt(b) * 0.95) ** 3)
    assert np.abs(kld_size(bins, kld.epsilon, kld.delta) - expected).max() <= 1


@pytest.mark.parametrize("way", [(0.5, 0.0, 0.0), (0.4, 0.0, 0.3), (0.0, 0.0, 0.8), (-0.5, 0.0, 0.0)])
def test_a_differential_robot_has_amcls_standard_deviations(tmp_path, way):
    forward, _, turn = way
    first, second = 0.0, turn  # of a robot that drives along its heading; backward counts as no turn
    first_sd = np.sqrt(0.11 * first**2 + 0.12 * forward**2)
    second_sd = np.sqrt(0.11 * second**2 + 0.12 * forward**2)
    way_sd = np.sqrt(0.13 * forward**2 + 0.14 * (first**2 + second**2))
    moved = _moved(_filter(tmp_path, NAV2).motion, way)
    turned = np.unwrap(np.stack([np.full(len(moved), turn), moved[:, 2]]), axis=0)[1]
    assert turned.std() == pytest.approx(np.hypot(first_sd, second_sd), rel=0.02)
    square = (moved[:, :2] ** 2).sum(axis=1).mean()
    assert square == pytest.approx(forward**2 + way_sd**2, rel=0.02)


@pytest.mark.parametrize("ros", [1, 2])
@pytest.mark.parametrize("way", [(0.5, 0.0, 0.0), (0.3, -0.4, 0.0), (0.0, 0.0, 0.8), (0.3, 0.4, 0.8)])
def test_an_omnidirectional_robot_has_amcls_standard_deviations(tmp_path, way, ros):
    """In Nav2's code alpha1 is of turns and alpha4 of ways, in ROS 1's it is the other way round."""
    text = ROS1 if ros == 1 else NAV2.replace("DifferentialMotionModel", "OmniMotionModel")
    turn_turn, way_turn = (0.14, 0.11) if ros == 1 else (0.11, 0.14)
    forward, left, turn = way
    square, course = forward**2 + left**2, np.arctan2(left, forward)
    moved = _moved(_filter(tmp_path, text).motion, way)
    along = moved[:, 0] * np.cos(course) + moved[:, 1] * np.sin(course) - np.sqrt(square)
    across = moved[:, 1] * np.cos(course) - moved[:, 0] * np.sin(course)
    for off, sd in (
        (along, np.sqrt(0.13 * square + way_turn * turn**2)),
        (across, np.sqrt(0.15 * square + way_turn * turn**2)),
        (moved[:, 2] - turn, np.sqrt(turn_turn * turn**2 + 0.12 * square)),
    ):
        assert off.std() == pytest.approx(sd, rel=0.02)
        assert abs(off.mean()) < 5 * sd / np.sqrt(len(off)) + 1e-6


def test_ros_1_has_its_own_names_and_defaults(tmp_path):
    found, amcl = _filter(tmp_path, ROS1), read_amcl(_file(tmp_path, ROS1))
    assert (found.sensor.laser.max_beams, found.resampling.kld.epsilon) == (40, 0.02)
    assert (found.sensor.laser.z_hit, found.resampling.every) == (0.95, 2)
    assert (found.resampling.kld.least, found.particles) == (100, 5000)
    assert amcl.start is not None
    assert amcl.start.tolist() == [1.0, 0.0, 0.5]
    assert (found.start.sd_m, found.start.heading_sd_rad) == pytest.approx((0.2, 0.1))


def test_ros_1s_uncorrected_models_are_named(tmp_path):
    assert not read_amcl(_file(tmp_path, ROS1)).remarks
    (remark,) = read_amcl(_file(tmp_path, ROS1.replace("omni-corrected", "omni"))).remarks
    assert "variances as standard deviations" in remark


@pytest.mark.parametrize("dotted", [True, False])
def test_belugas_initial_pose_has_a_spread_and_may_be_dotted(dotted, tmp_path):
    pose = {"x": 1.5, "y": -2.0, "yaw": 0.25, "covariance_x": 0.16, "covariance_yaw": 0.04}
    given = {f"initial_pose.{name}": value for name, value in pose.items()}
    if not dotted:
        given = {"initial_pose": "{" + ", ".join(f"{name}: {value}" for name, value in pose.items()) + "}"}
    read = read_amcl(_file(tmp_path, _nav2(set_initial_pose="true", **given)))
    np.testing.assert_allclose(read.start, [1.5, -2.0, 0.25])
    assert read.settings["start.sd_m"] == pytest.approx(0.4)
    assert read.settings["start.heading_sd_rad"] == pytest.approx(0.2)
    (remark,) = read.remarks
    assert "Beluga's models" in remark  # and not that it is not known


def test_nav2s_initial_pose_has_no_spread_and_one_from_elsewhere_has_rvizs(tmp_path):
    pose = "{x: 1.0, y: 2.0, z: 0.0, yaw: 0.5}"
    text = _nav2(set_initial_pose="true", initial_pose=pose)
    start = read_amcl(_file(tmp_path, text)).start
    assert start is not None
    assert start.tolist() == [1.0, 2.0, 0.5]
    assert _filter(tmp_path, text).start.sd_m == 0
    unset = _nav2(set_initial_pose="false", initial_pose=pose)
    assert read_amcl(_file(tmp_path, unset)).start is None
    spread = _filter(tmp_path, unset).start
    assert (spread.sd_m, spread.heading_sd_rad) == pytest.approx((0.5, np.pi / 12))


@pytest.mark.parametrize(
    "own", ["spatial_resolution_x: 0.5", "model_unknown_space: true", "execution_policy: seq"]
)
def test_a_file_with_names_that_only_beluga_has_runs_belugas_models(own, tmp_path):
    text = _nav2(laser_model_type="beam", z_rand=0.05, z_hit=0.9) + f"    {own}\n"
    laser, read = _filter(tmp_path, text).sensor.laser, read_amcl(_file(tmp_path, text))
    assert (laser.model, laser.laser_max_range) == ("beluga_beam", 100.0)
    assert laser.model_unknown_space == (own == "model_unknown_space: true")
    assert any(own.split(":")[0] in remark and "Beluga's models" in remark for remark in read.remarks)
    assert not any("expected 1" in remark for remark in read.remarks)  # of the weights of `beam`
    amcls = _filter(tmp_path, text.replace(own, "")).sensor.laser
    assert (amcls.model, amcls.laser_max_range) == ("beam", -1.0)


def test_belugas_bins(tmp_path):
    kld = _filter(
        tmp_path, _nav2(spatial_resolution_x=0.1, spatial_resolution_theta=np.pi / 6)
    ).resampling.kld
    assert (kld.bin_m, kld.heading_bins) == (0.1, 12)


def test_what_amcl_repairs_is_repaired(tmp_path):
    found = _filter(tmp_path, _nav2(min_particles=5000, resample_interval=0))
    assert (found.resampling.kld.least, found.resampling.kld.most, found.resampling.every) == (5000, 5000, 1)


def test_of_several_mappings_the_localizers_is_read(tmp_path):
    other = "planner:\n  ros__parameters: {max_beams: 7, use_sim_time: true}\n"
    assert _filter(tmp_path, other + _nav2(max_beams=31)).sensor.laser.max_beams == 31


BROKEN = {
    "no AMCL": ("map_server:\n  ros__parameters: {yaml_filename: x}\n", "found no parameters of AMCL"),
    "empty": ("", "found no parameters of AMCL"),
    "no YAML": ("amcl: [1, 2\nb: 3", "found no YAML, line 2"),
    "text for a number": (_nav2(alpha1='"0.2"'), "found alpha1 '0.2', expected a finite number"),
    "not a number": (_nav2(alpha1=".nan"), "found alpha1 nan"),
    "negative noise": (_nav2(alpha1=-0.2), "alpha1: found -0.2, expected a number of at least 0"),
    "negative beams": (_nav2(max_beams=-3), "max_beams: found -3, expected a whole number"),
    "rate above 1": (
        _nav2(recovery_alpha_slow=3),
        "recovery_alpha_slow: found 3.0, expected a number from 0",
    ),
    "no bins": (_nav2(spatial_resolution_theta=0), "spatial_resolution_theta"),
    "model": (_nav2(laser_model_type="foo"), "found laser_model_type 'foo', expected one of beam"),
    "robot": (_nav2(robot_model_type="ackermann"), "found the motion model 'ackermann'"),
    "switch": (_nav2(do_beamskip="maybe"), "do_beamskip: found 'maybe', expected true or false"),
    "null": (_nav2(sigma_hit="null"), "sigma_hit: found None"),
    "huge": (_nav2() + "#" * 2**20, "found more than 0.4 MB, expected AMCL's parameters"),
    "lists of lists of lists": ("a: " + "[" * 3000, "found YAML nested too deeply"),
    "emcl": (
        "emcl2:\n  ros__parameters: {odom_freq: 20, num_particles: 500, laser_min_range: 0.0,\n"
        "    laser_likelihood_max_dist: 0.2, initial_pose_x: 0.0, odom_frame_id: odom}\n",
        "found no parameters of AMCL",
    ),
}


@pytest.mark.parametrize("fault", BROKEN)
def test_a_wrong_file_is_one_line_with_amcls_name(tmp_path, fault):
    text, expected = BROKEN[fault]
    with pytest.raises(InputError) as refused:
        read_amcl(_file(tmp_path, text))
    assert expected in str(refused.value)
    assert "\n" not in str(refused.value)
    assert str(refused.value).startswith(str(tmp_path))


def test_of_several_sections_the_first_is_used_and_named(tmp_path):
    robots = "".join(
        f"/robot{k}/amcl:\n  ros__parameters: {{alpha1: 0.1, max_beams: 60, max_particles: {k}111}}\n"
        for k in (1, 2)
    )
    parameters = read_amcl(_file(tmp_path, robots))
    assert parameters.settings["particles"] == 1111
    assert "2 sections of AMCL's parameters (/robot1/amcl, /robot2/amcl)" in parameters.remarks[0]


ROBOTS = {
    "their nodes": ("/r1/amcl", {}, "/r2/amcl", {}),
    "nested namespaces": ("r1:\n amcl", {}, "r2:\n amcl", {}),
    "their frames": ("one", {"base_frame_id": "r1/base_link"}, "two", {"base_frame_id": "r2/base_link"}),
    "their scans": ("one", {"scan_topic": "/r1/scan"}, "two", {"scan_topic": "/r2/scan"}),
    "one has none": ("/r1/amcl", {}, "/**/amcl", {}),
}


@pytest.mark.parametrize("told_by", ROBOTS)
@pytest.mark.parametrize(
    ("names", "expected"), [(("/r2/scan",), 2), (("scan", "r2/laser"), 2), (("/r1/scan", "laser"), 1)]
)
def test_of_several_robots_the_recordings_is_read(tmp_path, told_by, names, expected):
    nodes = ROBOTS[told_by]
    text = ""
    for number, node, more in ((1, *nodes[:2]), (2, *nodes[2:])):
        values = {"alpha1": 0.1, "max_beams": 60, "max_particles": 1000 + number} | more
        text += f"{node}:\n  ros__parameters: {{{', '.join(f'{k}: {v}' for k, v in values.items())}}}\n"
    parameters = read_amcl(_file(tmp_path, text), names)
    assert parameters.settings["particles"] == 1000 + expected
    if told_by != "one has none":
        assert parameters.remarks[0].endswith(f"as the recording is of r{expected}")


def test_a_key_given_twice_is_no_matter_of_another_node_and_the_last_of_amcls(tmp_path):
    twice = "other: {a: 1, a: 2}\n" + _nav2(max_beams=30) + "    max_beams: 40\n"
    parameters = read_amcl(_file(tmp_path, twice))
    assert parameters.settings["sensor.laser.max_beams"] == 40
    assert any("given twice" in remark and "max_beams" in remark for remark in parameters.remarks)


def test_a_range_without_a_limit_and_odd_weights_are_read_and_remarked(tmp_path):
    parameters = read_amcl(_file(tmp_path, _nav2(laser_max_range="1e8", z_hit=0.9, z_rand=0.9)))
    assert parameters.settings["sensor.laser.laser_max_range"] == 1e8
    assert any("z_hit + z_rand is 1.8" in remark for remark in parameters.remarks)
    usual = read_amcl(_file(tmp_path, _nav2()))
    assert not any("expected 1" in remark for remark in usual.remarks)


def test_a_missing_file_and_a_folder_are_one_line(tmp_path):
    for path in (tmp_path / "none.yaml", tmp_path):
        with pytest.raises(InputError, match=r"none|cannot be read"):
            read_amcl(path)


def test_a_launch_file_is_refused_with_what_to_do(tmp_path):
    launch = tmp_path / "amcl_diff.launch"
    launch.write_text('<launch><node pkg="amcl" type="amcl" name="amcl"/></launch>')
    with pytest.raises(InputError, match=r"found a launch file.*rosparam dump"):
        configuration_of(None, launch, {}, {})
