"""AMCL's parameters as settings of this filter: Nav2's and ROS 1's names, and Beluga's.

docs/laser.md has the table of what is read, and of what this filter does otherwise than AMCL's code.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, fields
from pathlib import Path
from statistics import NormalDist
from typing import Any

import numpy as np

from maurice_mcl.config.parameters import ALPHAS, AMCL, RULES
from maurice_mcl.sensor.laser.parameters import AMCLS, LaserParameters
from maurice_mcl.values import F64

from .errors import FieldError, InputError
from .files.text import number, show
from .files.yaml_text import Section, read_yaml

MOST_BYTES = 400_000

# named as AMCL's, with Nav2's defaults
_LASER = {part.name: part.default for part in fields(LaserParameters) if part.name != "model"}
_FIELD_WEIGHTS, _BEAM_WEIGHTS = ("z_hit", "z_rand"), ("z_hit", "z_short", "z_max", "z_rand")
WEIGHTS_OFF = 0.2  # how far their sum may be from 1: those that ROS 1 and Nav2 ship add up to 1.15 and 1.1
# ROS 1 names by Nav2's
_ALIASES = {
    **{f"odom_alpha{k}": f"alpha{k}" for k in range(1, 6)},
    **{f"laser_{name}": name for name in _LASER if not name.startswith(("laser", "do", "beam"))},
    "kld_err": "pf_err",
    "kld_z": "pf_z",
    "odom_model_type": "robot_model_type",
}
# ours of ROS 1's omnidirectional model, in which alphas 1 and 4 change their roles; Nav2's are `ALPHAS`
_ROS1_OMNI = ("way_from_turn", "turn_from_way", "way_from_way", "turn_from_turn")
# AMCL's by ours, for errors, where the last word of ours is not AMCL's
_NAMES = {
    "particles": "max_particles",
    "resampling.every": "resample_interval",
    "resampling.kld.epsilon": "pf_err",
    "resampling.kld.bin_m": "spatial_resolution_x",
    "resampling.kld.heading_bins": "spatial_resolution_theta",
    "resampling.kld.least": "min_particles",
    "resampling.kld.most": "max_particles",
    "recovery.augmented.slow": "recovery_alpha_slow",
    "recovery.augmented.fast": "recovery_alpha_fast",
    "start.sd_m": "initial_cov_xx",
    "start.heading_sd_rad": "initial_cov_aa",
}
# Nav2's defaults (nav2_amcl, 1.3); those of the laser are `LaserParameters`'
_DEFAULTS: Mapping[str, float] = {
    **{f"alpha{k}": 0.2 for k in range(1, 6)},
    "min_particles": 500,
    "max_particles": 2000,
    "pf_err": 0.05,
    "pf_z": 0.99,
    "recovery_alpha_slow": 0.0,
    "recovery_alpha_fast": 0.0,
    "resample_interval": 1,
    "update_min_d": 0.25,
    "update_min_a": 0.2,
    "initial_cov_xx": 0.25,
    "initial_cov_yy": 0.25,
    "initial_cov_aa": (math.pi / 12) ** 2,
    "spatial_resolution_x": 0.5,  # AMCL's bins are fixed; Beluga names them
    "spatial_resolution_theta": math.radians(10),
}
# ROS 1's (amcl, 1.17), where they differ: of files with its names
_ROS1_DEFAULTS: Mapping[str, Any] = {
    "min_particles": 100,
    "max_particles": 5000,
    "pf_err": 0.01,
    "resample_interval": 2,
    "update_min_d": 0.2,
    "update_min_a": math.pi / 6,
    "max_beams": 30,
    "z_hit": 0.95,
    "z_short": 0.1,
    "z_rand": 0.05,
}
# Beluga (2.1) has Nav2's defaults, but for this one: it divides by it, whatever the laser's reach
_BELUGAS_DEFAULTS: Mapping[str, Any] = {"laser_max_range": 100.0}
_BELUGAS_OFFLINE = [
    "autostart", "autostart_delay", "execution_policy", "initial_pose_topic",
    "only_obstacle_boundaries", "point_cloud_topic", "spatial_resolution_y",
]  # fmt: skip
_BELUGAS_OWN = {
    *_BELUGAS_OFFLINE, "model_unknown_space", "spatial_resolution_x", "spatial_resolution_theta",
}  # fmt: skip
_DOTTED = "initial_pose."
_POSE = ("initial_pose_x", "initial_pose_y", "initial_pose_a")
_OTHERS = ("laser_model_type", "robot_model_type", "initial_pose", "set_initial_pose", *_POSE)
_OFFLINE = [
    *_BELUGAS_OFFLINE, "always_reset_initial_pose", "base_frame_id", "bond_timeout", "first_map_only",
    "first_map_received_callback", "freespace_downsampling", "global_frame_id", "gui_publish_rate",
    "introspection_mode", "map_topic", "odom_frame_id", "save_pose_rate", "scan_topic",
    "selective_resampling", "service_introspection_mode", "tf_broadcast", "tf_buffer_duration",
    "transform_tolerance", "use_map_topic", "use_sim_time", "random_seed", "initial_cov_xy",
    "initial_cov_xa", "initial_cov_ya",
]  # fmt: skip
_KNOWN = {*_ALIASES, *_DEFAULTS, *_LASER, *_OTHERS, *_OFFLINE}
_SHARED = ("laser_min_range", "laser_max_range", "laser_likelihood_max_dist")  # emcl has these, too
_DECISIVE = {*_ALIASES, *_DEFAULTS, *_LASER, "laser_model_type", "robot_model_type"} - {*_SHARED}


@dataclass(frozen=True, slots=True, eq=False)
class AmclParameters:
    """What a file of AMCL's parameters means here."""

    settings: Mapping[str, Any]  # by key of the configuration
    min_distance_m: float  # update_min_d: of the reading, as a scan that is not used is not read
    min_angle_rad: float  # update_min_a
    start: F64 | None  # (3,) the initial pose that is set; None: none is
    remarks: tuple[str, ...]  # what means nothing offline, and what is not known


def read_amcl(file: Path, robot: Collection[str] = ()) -> AmclParameters:
    """Read AMCL's parameters from YAML, wherever in the file they are. InputError.

    Of several robots' those of `robot` are read: names of topics and frames, such as robot1/scan.
    """
    parameters, several = _parameters(file, robot)
    usual = _ROS1_DEFAULTS if any(name in _ALIASES for name in parameters) else {}
    if _belugas(parameters):
        usual = _BELUGAS_DEFAULTS
    named = {**usual, **{_ALIASES.get(name, name): value for name, value in parameters.items()}}
    try:
        meaning = _meaning(named, parameters, [several] if several else [])
        for key, value in meaning.settings.items():
            RULES[key](_NAMES.get(key, key.rsplit(".", 1)[-1]), value)
    except ValueError as problem:
        raise InputError(file, str(problem)) from None
    return meaning


def _parameters(file: Path, robot: Collection[str]) -> tuple[Section, str]:
    """Return the section of AMCL's parameters, and a remark where there are several. InputError without any.

    Every node of a robot has a section; AMCL's has names that no other localizer's has.
    """
    document = read_yaml(file, "AMCL's parameters", MOST_BYTES)
    sections = {name: part for name, part in _sections(document) if _known(part) >= 3}
    own = {name: part for name, part in sections.items() if any(key in _DECISIVE for key in part)}
    if not own:
        expected = "expected laser_model_type, max_beams, alpha1 and the like, as in Nav2's nav2_params.yaml"
        others = "; it has names that emcl shares with it" if sections else ""
        raise InputError(file, f"found no parameters of AMCL, {expected}{others}")
    node, why = _of_robot(own, _namespaces(robot))
    several = f"found {len(own)} sections of AMCL's parameters ({', '.join(own)}): {node} is used, {why}"
    return _nested(own[node]), several if len(own) > 1 else ""


_ROBOTS_OWN = ("scan_topic", "base_frame_id", "odom_frame_id")  # parameters that may name a robot


def _of_robot(sections: Mapping[str, Section], robot: Set[str]) -> tuple[str, str]:
    """Return the section with most of a robot's namespaces and least of others', and why it is used."""
    of = {name: _namespaces([name, *map(part.get, _ROBOTS_OWN)]) for name, part in sections.items()}
    node = max(sections, key=lambda name: (len(of[name] & robot), -len(of[name] - robot)))
    shared = ", ".join(sorted(of[node] & robot))
    return node, f"as the recording is of {shared}" if shared else "as the recording names no robot of these"


def _namespaces(names: Iterable[Any]) -> Set[str]:
    """Return what stands before the last part of names, such as robot1 of the topic /robot1/scan."""
    parts = (name.strip("/").split("/")[:-1] for name in names if isinstance(name, str))
    return {part for path in parts for part in path if part.strip("*")}


def _nested(given: Section) -> Section:
    """Put initial_pose.x and the like, which ROS 2 takes as well, into a mapping of their own."""
    pose = {name[len(_DOTTED) :]: value for name, value in given.items() if str(name).startswith(_DOTTED)}
    nested = Section({name: value for name, value in given.items() if not str(name).startswith(_DOTTED)})
    nested |= {"initial_pose": pose} if pose else {}
    nested.repeated = given.repeated
    return nested


def _known(mapping: Mapping[Any, Any]) -> int:
    return sum(name in _KNOWN for name in mapping)


def _sections(document: Any) -> Iterator[tuple[str, Section]]:
    """Yield the mappings in a document, each once, by the path to them; references may be endless."""
    left, seen = deque([("", document)]), set[int]()
    while left:
        name, value = left.popleft()
        if isinstance(value, Section) and id(value) not in seen:
            seen.add(id(value))
            yield name or "the file", value
            left += [(_below(name, key), part) for key, part in value.items() if isinstance(part, Section)]


def _below(name: str, key: Any) -> str:
    return name if key == "ros__parameters" else f"{name}/{str(key).strip('/')}"


def _meaning(given: Mapping[str, Any], written: Section, remarks: Iterable[str]) -> AmclParameters:
    """Return what parameters mean; `written` has the names of the file. FieldError."""

    def size(name: str) -> float:
        return number(given.get(name, _DEFAULTS[name]), name)

    belugas = _belugas(written)
    slow, fast = size("recovery_alpha_slow"), size("recovery_alpha_fast")
    most = int(max(size("max_particles"), size("min_particles")))  # as AMCL repairs it
    side_rad = size("spatial_resolution_theta")
    if side_rad <= 0:
        raise FieldError(f"spatial_resolution_theta: found {side_rad:g}, expected a number above 0")
    settings: dict[str, Any] = {
        **AMCL,
        "sensor.laser.model": f"beluga_{_model(given)}" if belugas else _model(given),
        **{f"sensor.laser.{name}": given[name] for name in _LASER if name in given},
        "particles": most,
        "motion": _motion(given, size, "odom_model_type" in written),
        "resampling.when": "every",
        "resampling.every": max(int(size("resample_interval")), 1),  # as AMCL repairs it
        "resampling.kld.epsilon": size("pf_err"),
        # AMCL takes pf_z as the quantile itself, not as its probability
        "resampling.kld.delta": min(max(1 - NormalDist().cdf(size("pf_z")), 1e-9), 0.5),
        "resampling.kld.bin_m": size("spatial_resolution_x"),
        "resampling.kld.heading_bins": min(max(round(2 * math.pi / side_rad), 1), 3600),
        "resampling.kld.least": int(size("min_particles")),
        "resampling.kld.most": most,
        "recovery.strategy": "augmented" if slow > 0 and fast > 0 else "none",
        "recovery.augmented.slow": slow,
        "recovery.augmented.fast": fast,
        "recovery.augmented.most": 1.0,
        "recovery.augmented.resets": 0.0,
    }
    start = _start(given)
    if start is None or "initial_pose" not in given:  # Nav2's own initial pose has no spread
        settings["start.sd_m"] = math.sqrt(max(size("initial_cov_xx"), 0.0))
        settings["start.heading_sd_rad"] = math.sqrt(max(size("initial_cov_aa"), 0.0))
    elif (pose := given["initial_pose"]).keys() & {"covariance_x", "covariance_yaw"}:  # Beluga's has one
        for name, key in (("covariance_x", "start.sd_m"), ("covariance_yaw", "start.heading_sd_rad")):
            settings[key] = math.sqrt(max(number(pose.get(name, 0.0), f"initial_pose.{name}"), 0.0))
    remarks = (*remarks, *_remarks(given, written, belugas))
    gates = size("update_min_d"), size("update_min_a")
    if min(gates) <= 0:  # every scan passes one of them
        gates = 0.0, 0.0
    return AmclParameters(settings, *gates, start, remarks)


def _remarks(given: Mapping[str, Any], written: Section, belugas: Sequence[str]) -> list[str]:
    """Return what a user should know of a file: what is not AMCL's, without effect, or other than in AMCL."""
    remarks = []
    if belugas:
        names = ", ".join(belugas[:3])
        remarks.append(f"Beluga's models, as {names} {'is' if len(belugas) == 1 else 'are'} Beluga's own")
    if written.repeated:
        remarks.append(
            f"given twice, of which the last counts: {', '.join(map(show, written.repeated[:10]))}"
        )
    if offline := [name for name in written if name in _OFFLINE]:
        remarks.append(f"AMCL's parameters that mean nothing in a replay: {', '.join(offline)}")
    if unknown := [show(name) for name in written if name not in _KNOWN]:
        remarks.append(f"parameters that are not AMCL's, left out: {', '.join(unknown[:10])}")
    mixed = _FIELD_WEIGHTS if _model(given) != "beam" else _BEAM_WEIGHTS
    total = sum(float(RULES[f"sensor.laser.{name}"](name, given.get(name, _LASER[name]))) for name in mixed)
    if abs(total - 1) > WEIGHTS_OFF:
        remarks.append(
            f"{' + '.join(mixed)} is {total:g}, expected 1; AMCL uses them as they are, and so does this"
        )
    if (model := written.get("odom_model_type")) in ("diff", "omni"):
        remarks.append(
            f"ROS 1's {model} takes variances as standard deviations; here it is {model}-corrected"
        )
    return remarks


def _model(given: Mapping[str, Any]) -> str:
    model = given.get("laser_model_type", "likelihood_field")
    if model not in AMCLS:
        raise FieldError(f"found laser_model_type {show(model)}, expected one of {', '.join(sorted(AMCLS))}")
    return str(model)


def _belugas(written: Mapping[str, Any]) -> list[str]:
    """Return the names in a file that only Beluga has."""
    pose = written.get("initial_pose")
    parts = pose if isinstance(pose, Mapping) else ()
    own = [name for name in written if name in _BELUGAS_OWN]
    return own + [f"initial_pose.{part}" for part in parts if str(part).startswith("covariance")]


def _motion(given: Mapping[str, Any], size: Callable[[str], float], is_ros1: bool) -> dict[str, Any]:
    """Return AMCL's motion model: its alphas multiply squares, as in Probabilistic Robotics."""
    model = str(given.get("robot_model_type", "differential")).lower()
    if not any(word in model for word in ("diff", "omni")):
        raise FieldError(f"found the motion model {show(model)}, expected differential or omni")
    names: tuple[str, ...] = ALPHAS
    if "omni" in model:
        names = (*(_ROS1_OMNI if is_ros1 else ALPHAS), "side_from_way")
    noise = {name: size(f"alpha{k}") for k, name in enumerate(names, 1)}
    for k, value in enumerate(noise.values(), 1):
        if value < 0:
            raise FieldError(f"alpha{k}: found {value:g}, expected a number of at least 0")
    return {"model": "omni" if "omni" in model else "odometry", **noise}


def _start(given: Mapping[str, Any]) -> F64 | None:
    """Return the initial pose (3,), where the file sets one."""
    pose = given.get("initial_pose")
    if isinstance(pose, Mapping):
        if str(given.get("set_initial_pose", False)).lower() != "true":
            return None
        return np.array([number(pose.get(name, 0.0), f"initial_pose.{name}") for name in ("x", "y", "yaw")])
    if not any(name in given for name in _POSE):
        return None
    return np.array([number(given.get(name, 0.0), name) for name in _POSE])
