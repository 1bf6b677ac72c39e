"""Parts of one's own: resampler, recovery strategy, motion model and sensor, as objects or by name."""

from __future__ import annotations

import importlib
import itertools
import sys
from dataclasses import replace

import numpy as np
import pytest

import maurice_viz as mv
from helpers.commands import process
from helpers.small_session import write_small_session, write_small_survey
from maurice_loaders import InputError, open_run
from maurice_mcl.config.parameters import PRESETS
from maurice_mcl.examples import tiny_library, tiny_session
from maurice_mcl.filter.motion import MOTION_MODELS
from maurice_mcl.filter.recovery import STRATEGIES
from maurice_mcl.filter.resampling import RESAMPLERS
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.values.own_parts import name_of

SOURCE = """
import numpy as np
from dataclasses import replace
import maurice_viz as mv

def first_come(weights, n, rng):
    return np.sort(rng.choice(len(weights), n, p=weights))

class EveryThird:
    def __call__(self, evidence, state):
        share = 0.2 if state.updates % 3 == 2 else 0.0
        return mv.Recovery(share, replace(state, updates=state.updates + 1))

class Straight:
    def move(self, poses, motion, noise):
        way = motion.forward_m + 0.01 * noise[:, 0]
        x, y = poses[:, 0] + way * np.cos(poses[:, 2]), poses[:, 1] + way * np.sin(poses[:, 2])
        return np.column_stack([x, y, poses[:, 2] + motion.turn_rad + 0.02 * noise[:, 1]])

class Rows:
    name = "rows"

    def __init__(self, count=6):
        self.count = count

    def describe(self, image):
        return image.mean(axis=(1, 2))[:: len(image) // self.count][: self.count]
"""
counter = itertools.count(1)
BY_NAME = {"resampler": "first_come", "recovery": "EveryThird", "motion": "Straight"}


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("own")
    write_small_survey(folder)
    return write_small_session(folder)


@pytest.fixture
def module(tmp_path, monkeypatch, request):
    """Write the parts as a module that can be imported, and return its name."""
    name = f"own_parts_{abs(hash(request.node.name))}"
    (tmp_path / f"{name}.py").write_text(SOURCE)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield name
    sys.modules.pop(name, None)


def named(module):
    return mv.Filter(particles=60, **{part: f"{module}:{name}" for part, name in BY_NAME.items()})


def test_they_are_drawn_saved_verified_compared_checked_and_branched(drive, module, tmp_path):
    own = named(module)
    files = {"to": tmp_path / "own.rrd", "save_run": tmp_path / "kept"}
    scores = mv.compare(drive, filters=[mv.Filter(particles=60), own], **files)
    assert scores.runs[0].label == "blended"
    assert scores.rrd.stat().st_size > 10_000
    label = scores.runs[1].label
    settings = open_run(tmp_path / "kept" / label).configuration.values()
    assert settings["resampling.scheme"].startswith(f"{module}:first_come@")
    assert settings["motion"]["model"].startswith(f"{module}:Straight@")
    assert all(verdict.same for verdict in mv.verify(tmp_path / "kept"))
    checked = mv.check(drive, filter=own, demands=mv.Demands(max_error_m=9), seeds=2)
    assert checked.drives[0].runs[0].error_mean_m == pytest.approx(scores.runs[1].score.error_mean_m)
    other = mv.Filter(resampler=f"{module}:first_come")
    assert not mv.what_if(tmp_path / "kept" / scores.runs[0].label, 3, other).same


def test_another_part_under_the_name_is_refused_and_its_steps_are_still_shown(drive, module, tmp_path):
    mv.replay(drive, filter=named(module), save_run=tmp_path / "kept")
    file = tmp_path / f"{module}.py"
    file.write_text(SOURCE.replace("0.02 * noise", "0.03 * noise"))
    found = {"PYTHONPATH": str(tmp_path)}
    line = process("verify", tmp_path / "kept", expect=1, **found).stderr
    assert f"motion model {module}:Straight: found the source" in line
    shown = process(tmp_path / "kept", "-o", "none", **found)
    assert "found the source" in shown.stderr
    assert "error, mean" in shown.stdout
    file.unlink()
    gone = process("verify", tmp_path / "kept", expect=1, **found).stderr
    assert f"no module named '{module}'; put its folder on PYTHONPATH" in gone


def test_an_object_is_told_by_what_it_holds_and_a_lambda_by_what_it_does():
    class Sharp:
        def __init__(self, by):
            self.by = by

        def __call__(self, weights, n, rng):
            return np.argsort(weights)[-n:]

    assert name_of(Sharp(1)) == name_of(Sharp(1)) != name_of(Sharp(2))
    first, second = (lambda weights, n, rng: np.arange(n)), (lambda weights, n, rng: np.zeros(n, int))
    assert name_of(first) != name_of(second)

    def made(by):
        return lambda weights, n, rng: np.full(n, by)

    assert name_of(made(1)) != name_of(made(2))


@pytest.mark.parametrize(
    ("part", "value", "said"),
    [
        ("resampler", lambda weights, n, rng: np.zeros(n), "found float64"),
        ("resampler", lambda weights, n, rng: np.full(n, 10**6), "from 0 to 59"),
        ("resampler", lambda weights, n, rng: np.zeros(n - 1, int), r"found int64 \(59,\)"),
        ("resampler", lambda weights: weights, "raised TypeError"),
        ("resampler", "lottery", "expected one of multinomial"),
        ("resampler", "no_such_module:f", "no module named 'no_such_module'"),
        ("resampler", 3, "expected a name, or a resampler"),
        ("recovery", lambda evidence, state: 0.1, "expected a maurice_mcl.Recovery"),
        ("recovery", lambda evidence, state: mv.Recovery(2.0), "share from 0 to 1"),
        ("motion", lambda poses, motion, noise: poses, "expected a table, or a motion model"),
        ("sensors", [object()], "has no read"),
    ],
)
def test_what_a_part_gives_wrongly_is_one_line(drive, part, value, said):
    with pytest.raises(InputError, match=said) as caught:
        mv.replay(drive, filter=mv.Filter(particles=60, **{part: value}))
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize("moved", [lambda poses: poses[:, :2], lambda poses: poses * np.nan])
def test_a_motion_model_gives_finite_poses(drive, moved):
    class Odd:
        def move(self, poses, motion, noise):
            return moved(poses)

    with pytest.raises(InputError, match=r"expected finite poses \(60, 3\)"):
        mv.replay(drive, filter=mv.Filter(particles=60, motion=Odd()))


def test_a_motion_model_meets_the_maps_frame(drive):
    """It is told where the particles are in the map, whatever they are stored relative to."""

    class Seen:
        def move(self, poses, motion, noise):
            seen.append((poses.copy(), motion, noise.dtype))
            return poses

    seen = []
    mv.replay(drive, filter=mv.Filter(particles=60, motion=Seen(), start=(1.6, 0.6, 0.0)))
    poses, motion, kind = seen[0]
    assert np.allclose(poses, [1.6, 0.6, 0.0], atol=1e-6)
    assert motion._fields == ("forward_m", "left_m", "turn_rad")
    assert kind == np.float64


def test_a_filter_is_a_value():
    robust = mv.Filter("robust", particles=500)
    assert robust.set(sharpness=2) == mv.Filter("robust", particles=500, settings={"sensor.sharpness": 2})
    assert repr(robust) == "Filter('robust', particles=500)"
    assert mv.Filter("color") == mv.Filter(feature="color")
    assert replace(robust, seed=1).configuration() == robust.configuration()
    for wrong, said in (
        ({"preset": "brilliant"}, "no preset called 'brilliant'"),
        ({"start": (1.0, 2.0)}, "a pose of three numbers"),
        ({"start": (1.0, 2.0, np.nan)}, "a pose of three numbers"),
        ({"seed": -1}, "seed: found -1"),
    ):
        with pytest.raises(InputError, match=said):
            mv.Filter(**wrong)
    with pytest.raises(InputError, match=r"a filter has no 'sharpnes'; .*did you mean sharpness"):
        robust.set(sharpnes=2)
    with pytest.raises(InputError, match=r"may be .* or "):
        robust.set(share=2)


def test_filters_are_named_by_what_tells_them_apart(drive):
    def labels(*filters):
        return [run.label for run in mv.compare(drive, filters=list(filters)).runs]

    few = mv.Filter(particles=40)
    assert labels(few.set(seed=1), few.set(seed=2)) == ["seed 1", "seed 2"]
    assert labels(few.set(preset="thesis"), few.set(preset="robust")) == ["thesis", "robust"]
    assert labels(few, few.set(sharpness=2)) == ["blended", "sharpness 2"]


def test_a_channel_of_ones_own_is_measured_scaled_saved_verified_and_compared(drive, module, tmp_path):
    rows = importlib.import_module(module).Rows
    alone, beside = mv.Filter(channels=[rows()]), mv.Filter("color", channels=[rows()])
    scores = mv.compare(drive, filters=[mv.Filter("color"), alone, beside], save_run=tmp_path / "kept")
    assert [run.label for run in scores.runs] == ["color", "Rows", "color Rows"]
    saved = open_run(tmp_path / "kept" / "Rows").configuration.values()
    assert saved["sensor.weights"] == {"rows": 1.0}
    assert 0 < saved["sensor.scales"]["rows"] < 100
    both = open_run(tmp_path / "kept" / "color Rows").configuration.values()
    assert both["sensor.weights"] == {"color": 1.0, "rows": 1.0}
    assert "rows" not in list(CHANNELS), "what one filter asks for is no channel of others"
    assert all(verdict.same for verdict in mv.verify(tmp_path / "kept"))
    found = process("verify", tmp_path / "kept" / "Rows", PYTHONPATH=str(tmp_path))
    assert "the same, all 14 steps" in found.stdout
    other = alone.set(channels=[rows(4)])
    with pytest.raises(InputError, match="found two called 'rows'; give them names of their own"):
        mv.compare(drive, filters=[alone, other])
    changed = mv.replay(drive, filter=other).runs[0].score  # one after the other is no conflict
    assert changed != scores.runs[1].score
    assert mv.replay(drive, filter=alone).runs[0].score == scores.runs[1].score


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"name": "color"}, "its name is 'color', expected a lower-case word"),
        ({"distance": "far"}, "its distance is 'far', expected one of"),
        ({"describe": None}, r"has no describe\(image\)"),
        ({"describe": lambda self, image: image}, "expected finite numbers of one dimension"),
        ({"describe": lambda self, image: np.array([-1.0])}, "none below 0"),
        ({"describe": lambda self, image: 1 / 0}, "raised ZeroDivisionError"),
        ({"describe": lambda self, image: np.ones(next(counter))}, "expected as many for each picture"),
    ],
)
def test_what_is_no_channel_is_one_line(drive, changes, said):
    members = {"name": "odd", "distance": "l1", "describe": lambda self, image: np.ones(2)} | changes
    with pytest.raises(InputError, match=said) as caught:
        mv.replay(drive, filter=mv.Filter(channels=[type("Odd", (), members)()]))
    assert len(str(caught.value).splitlines()) == 1


def test_a_library_without_pictures_has_no_channel_of_ones_own():
    class Odd:
        name = "odd"

        def describe(self, image):
            return np.ones(2)

    with pytest.raises(InputError, match="keeps no pictures, which odd has to measure"):
        mv.replay(tiny_session(), tiny_library(), mv.Filter(channels=[Odd()]))


@pytest.mark.parametrize("ours", [RESAMPLERS, STRATEGIES, MOTION_MODELS, PRESETS])
def test_nobody_overwrites_one_of_ours_in_secret(ours):
    with pytest.raises(TypeError, match="does not support item assignment"):
        ours["systematic"] = None
