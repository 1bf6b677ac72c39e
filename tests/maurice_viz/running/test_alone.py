"""A run is what it is alone: beside any other, in trials, as a branch and in a check, to the bit."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from unicodedata import normalize

import numpy as np
import pytest

import maurice_viz as mv
from helpers.small_room import write_small_room
from helpers.small_session import write_small_session, write_small_survey
from maurice_datasets import simulate, simulation_plan
from maurice_datasets.trials.drives import filter_for, open_drive
from maurice_datasets.trials.plan import SessionSpec
from maurice_loaders import with_landmarks
from maurice_loaders.formats.registry import open_session
from maurice_loaders.reading.session import RecordedSession
from maurice_loaders.runs.store import first_difference
from maurice_loaders.runs.writer import StepRows, rows_of
from maurice_mcl.config.build import make_localizer
from maurice_mcl.config.parameters import PRESETS
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.library.occupancy_building import build_occupancy
from maurice_mcl.sensor.descriptors.registry import FEATURES
from maurice_mcl.values import F64, Library
from maurice_mcl.values.laser import LaserScan
from maurice_viz.app.branch import BranchChange, open_branch
from maurice_viz.playback import FilterRun, run_together
from maurice_viz.running.filters import Filter
from maurice_viz.running.open import make_runs, open_library_for, unique_labels

PARTICLES, UPDATES = 60, 8
BY_CAMERA = [name for name, values in PRESETS.items() if "laser" not in values["sensor.weights"]]
BY_LASER = [name for name in PRESETS if name not in BY_CAMERA]
EXAMPLE = Path(__file__).parents[3] / "docs" / "examples" / "beacon"


@dataclass(frozen=True)
class SmallDrive:
    """A drive in a small room, and what it is run with."""

    session: RecordedSession
    library: Library

    @classmethod
    def of(cls, log: Path) -> SmallDrive:
        session = open_session(log)
        return cls(session, open_library_for(session, None, keep_going=False))

    def made(self, specs: Sequence[Filter]) -> list[FilterRun]:
        return make_runs(self.session, self.library, [replace(one, particles=PARTICLES) for one in specs])

    def runs(self, specs: Sequence[Filter]) -> dict[str, list[StepRows]]:
        return self.stepped(self.made(specs))

    def stepped(self, runs: Sequence[FilterRun]) -> dict[str, list[StepRows]]:
        rows: dict[str, list[StepRows]] = {run.label: [] for run in runs}
        for moment, records in run_together(runs, self.session.moments()):
            for label, record in records.items():
                rows[label].append(rows_of(moment, record))
        return rows


@pytest.fixture(scope="module", params=["camera", "laser"])
def drive(request, tmp_path_factory) -> tuple[SmallDrive, list[str], dict[str, list[StepRows]]]:
    """A drive, the presets for it, and the run of each preset alone."""
    folder = tmp_path_factory.mktemp(request.param)
    by_laser = request.param == "laser"
    paths = simulate(
        simulation_plan("tracking", world=write_small_room(folder), updates=UPDATES, laser=by_laser),
        folder / "drive",
    )
    small, presets = SmallDrive.of(paths.session), BY_LASER if by_laser else BY_CAMERA
    return small, presets, {name: small.runs([Filter(name)])[name] for name in presets}


def _expect_same(alone: Sequence[StepRows], beside: Sequence[StepRows]) -> None:
    assert len(alone) == len(beside) >= UPDATES - 1
    assert [first_difference(*pair) for pair in zip(alone, beside, strict=True)] == [None] * len(alone)


def test_every_preset_beside_any_other(drive):
    small, presets, alone = drive
    orders = [presets, presets[::-1], *(list(pair) for pair in combinations(presets, 2))]
    for names in orders:
        for name, rows in small.runs([Filter(name) for name in names]).items():
            _expect_same(alone[name], rows)


def test_every_preset_in_trials_as_a_branch_and_in_a_check(drive, tmp_path):
    small, presets, alone = drive
    log = small.session.path
    recorded = open_drive(SessionSpec("small", path=str(log)), 0)
    mv.replay(log, filter=mv.Filter(presets[-1], particles=PARTICLES), save_run=tmp_path / "saved")
    point = open_branch(tmp_path / "saved")
    for name in presets:
        settings = {"preset": name, "particles": PARTICLES}
        localizer = filter_for(recorded, settings, 0)
        _expect_same(alone[name], _rows(small, localizer, recorded.start))
        branch = point.localizer_with(BranchChange(preset=name))
        _expect_same(alone[name], _rows(small, branch, point.restored.start))
        checked = (
            mv.check(log, filter=mv.Filter(name, particles=PARTICLES), demands=mv.Demands(max_error_m=1.0))
            .drives[0]
            .made.tracks[0]
        )
        errors_m = [_error_m(rows) for rows in alone[name]]
        np.testing.assert_allclose(checked.error_m, errors_m, rtol=0, atol=1e-12)


def _rows(small: SmallDrive, localizer: Localizer, start: F64 | None) -> list[StepRows]:
    return small.stepped([FilterRun("run", localizer, start)])["run"]


def _error_m(rows: StepRows) -> float:
    step = rows.step
    return float(np.hypot(*(step[f"estimate_{axis}"] - step[f"truth_{axis}"] for axis in ("x_m", "y_m"))))


def test_what_a_preset_uses_does_not_depend_on_what_a_library_holds(drive):
    small, presets, _ = drive
    if presets != BY_CAMERA:
        pytest.skip("a map holds no landmarks")
    marked = with_landmarks(small.library)
    assert list(marked.sensors) == ["landmarks"]
    for library in (small.library, marked):
        runs = make_runs(small.session, library, [Filter(name) for name in presets])
        used = {run.label: set(run.localizer.sensor.names) for run in runs}
        assert used == {name: set(PRESETS[name]["sensor.weights"]) for name in presets}
    assert make_localizer(marked, preset="robust").sensor.names == tuple(FEATURES["best"])


def test_a_replay_says_what_each_run_uses(drive):
    small, presets, _ = drive
    listener = Remarks()
    make_runs(small.session, small.library, [Filter(name) for name in presets[:2]], listener)
    uses = [f"{name} uses {', '.join(PRESETS[name]['sensor.weights'])}" for name in presets[:2]]
    assert "; ".join(uses) in listener.remarks


@dataclass
class Remarks:
    """Keeps what is remarked."""

    remarks: list[str] = field(default_factory=list)

    def remark(self, text: str) -> None:
        self.remarks.append(text)

    def warning(self, text: str) -> None:
        self.remarks.append(text)

    def progress(self, done: int, total: int, what: str) -> None:
        pass


def test_a_laser_is_used_by_the_presets_for_one_and_where_nobody_chose(drive):
    small, presets, _ = drive
    if presets != BY_CAMERA:
        pytest.skip("has no camera")
    x_min, y_min, x_max, y_max = small.library.arena.bounds
    around = LaserScan(np.full(90, 0.5, np.float32), -np.pi, np.pi / 45, 0.1, 8.0)
    occupancy = build_occupancy([(around, np.array([(x_min + x_max) / 2, (y_min + y_max) / 2, 0.0]))])
    both = replace(small.library, arena=replace(small.library.arena, occupancy=occupancy))
    specs = [Filter(), Filter("robust"), Filter("laser"), Filter("precise"), Filter(feature="color")]
    used = [run.localizer.sensor.names for run in make_runs(small.session, both, specs)]
    everything = (*FEATURES["blended"], "laser")
    assert used == [everything, tuple(FEATURES["best"]), ("laser",), tuple(FEATURES["all"]), ("color",)]


def test_a_sensor_of_another_package_is_used_by_the_run_that_names_it_alone(tmp_path, monkeypatch):
    write_small_survey(tmp_path)
    words = [sys.executable, "-m", "beacon", write_small_session(tmp_path, updates=UPDATES)]
    words.append(tmp_path / "beacon.log")
    subprocess.run(words, cwd=EXAMPLE, check=True, capture_output=True)
    monkeypatch.syspath_prepend(str(EXAMPLE))
    small = SmallDrive.of(tmp_path / "beacon.log")
    specs = [Filter("robust", name="without"), Filter("robust", name="with", sensors=["beacon:Beacon"])]
    alone = {spec.name: small.runs([spec])[spec.name] for spec in specs}
    assert first_difference(alone["with"][3], alone["without"][3]) is not None
    for order in (specs, specs[::-1]):
        for name, rows in small.runs(order).items():
            _expect_same(alone[name], rows)


def test_labels_that_look_the_same_are_told_apart():
    """Two folders of these names would be one on some file systems."""
    names = [normalize(form, "Büro") for form in ("NFC", "NFD")]
    assert unique_labels(names) == [names[0], f"{names[0]}-2"]
