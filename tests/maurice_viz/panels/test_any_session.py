"""Whatever is recorded is drawn without an exception, and the entities that every screen needs are there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import pytest
import rerun.blueprint as rrb

from helpers import viz_fakes as fakes
from helpers import viz_recordings as recordings
from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import FilterParameters, RecoveryParameters
from maurice_mcl.filter.localizer import run
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.sensor.model import SensorParameters
from maurice_mcl.values.arrays import F64, U8
from maurice_mcl.values.library import Library
from maurice_mcl.values.map import Arena, Region
from maurice_mcl.values.session import Moment
from maurice_viz import entities
from maurice_viz.entities import RunPaths
from maurice_viz.layouts.registry import runs_blueprint
from maurice_viz.running.observer import RerunObserver
from maurice_viz.scene import Detail, RunView
from maurice_viz.style import font_safe
from maurice_viz.viewer import sinks


@dataclass(frozen=True)
class Case:
    """What is out of the ordinary; all the rest is as usual."""

    columns: int = 3
    rows: int = 2
    headings: int = 4
    units: str = "in"
    side_m: float | None = None  # of the arena's long side
    height: int = 36
    width: int = 44
    channels: Sequence[str] = ("color", "edges")
    particles: int = 50
    steps: int = 2
    has_truth: bool = True
    kept: bool = True  # whether the library's pictures are on the disk
    start: F64 | None = None
    sharpness: float = 1.0
    reseeding: str = "none"
    session: str = "drive"
    label: str = "run"
    obstacle: str = "table"
    detail: Detail = Detail.FULL


CASES = {
    "nothing out of the ordinary": Case(),
    "no truth": Case(has_truth=False),
    "library pictures not kept": Case(kept=False),
    "neither truth nor library pictures": Case(has_truth=False, kept=False),
    "pictures of 8 x 8": Case(height=8, width=8),
    "pictures of 640 x 480": Case(height=480, width=640, columns=1, rows=1),
    "pictures of 1920 x 300": Case(height=300, width=1920, columns=1, rows=1),
    "pictures of 40 x 300": Case(height=300, width=40),
    "one particle": Case(particles=1),
    "50,000 particles": Case(particles=50_000, steps=1),
    "an arena of 2 m": Case(side_m=2.0, units="m"),
    "an arena of 200 m": Case(side_m=200.0, units="m"),
    "an arena of 200 m in inches": Case(side_m=200.0),
    "a corridor": Case(columns=9, rows=1),
    "one frame": Case(steps=1),
    "no frame at all": Case(steps=0),
    "a library of one entry": Case(columns=1, rows=1, headings=1),
    "one channel": Case(channels=("color",)),
    "twelve channels": Case(channels=tuple(CHANNELS)[:12]),
    "blind and far off": Case(sharpness=0.0, start=np.array([0.2, 0.7, 3.0]), steps=5),
    "outside the map": Case(start=np.array([-50.0, 80.0, 1.0]), steps=5),
    "reseeded": Case(reseeding="always", steps=4),
    "drawn from the picture": Case(reseeding="mixture", steps=4),
    "not in ASCII": Case(session="Büro 東京", label="Lauf ä 走", obstacle="Schränkchen 机"),
    "signs in a label": Case(label="a b: 50 % (x)"),
    "little detail": Case(detail=Detail.LIGHT, steps=4),
    "detail at events": Case(detail=Detail.EVENTS, steps=9),
}
ALWAYS = {entities.FLOORS, entities.WALLS, entities.NODES}


def library_of(case: Case, folder: Path) -> Library:
    """Make a library for a case: its pictures, and an arena with its names."""
    poses = fakes.reference_poses(case.columns, case.rows, case.headings)
    images = [fakes.picture_at(pose, case.height, case.width) for pose in poses]
    arena = fakes.arena(case.columns, case.rows)
    factor = 1.0 if case.side_m is None else case.side_m / max(arena.size_m)
    paths: list[Path | None] = [folder / f"{k}.png" if case.kept else None for k in range(len(images))]
    for path, image in zip(paths, images, strict=True):
        if path is not None:
            cv2.imwrite(str(path), image)
    index = {channel: fakes.index_of(images, channel) for channel in case.channels}
    drawn = poses * (factor, factor, 1)
    return Library("fake", drawn, tuple(paths), index, scaled(arena, factor, case.obstacle), case.units)


def scaled(arena: Arena, factor: float, obstacle: str) -> Arena:
    table, *_ = arena.obstacles
    floors = tuple(Region(floor.name, floor.polygon * factor) for floor in arena.floors)
    low_x, low_y, high_x, high_y = (float(v) * factor for v in arena.bounds)
    return replace(
        arena,
        bounds=(low_x, low_y, high_x, high_y),
        walls=arena.walls * factor,
        obstacles=(Region(obstacle, table.polygon * factor),),
        floors=floors,
        rooms=(),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """The usual drive with pictures of a case's size, as long as the case says."""

    case: Case
    usual: fakes.FakeSession
    info: object = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "info", self.usual.info)

    def moments(self) -> Iterator[Moment]:
        for moment in islice(self.usual.moments(), self.case.steps):
            image: U8 = fakes.picture_at(np.zeros(3) + moment.frame.step, self.case.height, self.case.width)
            told = (*moment.events, f"{self.case.obstacle} moved")
            yield replace(moment, frame=replace(moment.frame, image=image), events=told)


def draw(case: Case, folder: Path) -> Path:
    """Play a case and draw it, with every layout in the blueprint."""
    library, out = library_of(case, folder), folder / "out.rrd"
    session = Drive(case, fakes.make_session(library, max(case.steps, 1), case.has_truth, case.session))
    weights = dict.fromkeys(case.channels, 1 / len(case.channels))
    parameters = FilterParameters(
        sensor=SensorParameters(weights, sharpness=case.sharpness),
        recovery=RecoveryParameters(strategy=case.reseeding),
        particles=case.particles,
    )
    localizer = build_localizer(library, session, parameters)
    view = RunView.of(case.label, localizer)
    scene = recordings.scene_with(library, case.units, has_truth=case.has_truth)
    with sinks.to_file(out, case.session, runs_blueprint([view], scene)) as rec:
        observer = RerunObserver(rec, view, scene, case.detail)
        recordings.observe(observer, run(localizer, session, case.start))
    return out


@pytest.mark.parametrize("name", CASES)
def test_any_session_is_drawn(name, tmp_path):
    case, paths = CASES[name], RunPaths(CASES[name].label)
    out = draw(case, tmp_path)
    found = recordings.entities_of(out)
    assert found >= ALWAYS
    if case.steps:
        assert found >= {paths.particles, paths.estimate, paths.text, paths.closeup, entities.CAMERA}
        assert bool(recordings.rows(out, entities.TRUTH)) == case.has_truth
        texts = recordings.rows(out, paths.text)
        assert {row.step for row in texts if row.step} == set(range(1, case.steps + 1))
        assert all(row.values["TextDocument:text"][0].strip() for row in texts)
    assert_finite(out, paths)


def assert_finite(out: Path, paths: RunPaths) -> None:
    """What has no finite place leaves a view empty."""
    for path, component in (
        (paths.particles, "Points2D:positions"),
        (paths.estimate, "Points2D:positions"),
        (paths.closeup, "Transform3D:translation"),
        (paths.closeup, "Transform3D:scale"),
    ):
        for row in recordings.having(recordings.rows(out, path), component):
            assert np.isfinite(np.array(row.values[component])).all(), path


def test_whatever_is_written_has_signs_in_the_viewers_font(tmp_path):
    """Without a screen the viewer stops at the first letter that it has no sign for."""
    out, paths = draw(CASES["not in ASCII"], tmp_path), RunPaths("Lauf ä 走")
    texts = [row.values["TextDocument:text"][0] for row in recordings.rows(out, paths.text)]
    assert any("Schränkchen u673A moved" in text for text in texts)
    for text in [*texts, *recordings.entities_of(out)]:
        assert font_safe(text) == text
    shown = recordings.scene_of(fakes.arena(2, 2), "m", True)
    blueprint = runs_blueprint([RunView("走", ("color",)), RunView("机", ("color",))], shown)
    titles = [str(view.name) for view in views(blueprint.root_container)]
    assert all(font_safe(title) == title for title in titles)
    assert any(title.startswith("u8D70") for title in titles)


def views(part: rrb.Container | rrb.View) -> Iterator[rrb.View | rrb.Container]:
    yield part
    if isinstance(part, rrb.Container):
        for inner in part.contents:
            yield from views(inner)


def test_letters_the_viewer_has_stay():
    for text in ("plain", "Büro, première, Ωμέγα, Жук · − → ≤ °\nx", "a\u0308"):
        assert len(font_safe(text)) <= len(text)
    assert font_safe("Büro · Ωμέγα Жук") == "Büro · Ωμέγα Жук"
    assert font_safe("東") == "u6771"


def test_the_close_view_holds_most_of_the_cloud(tmp_path):
    case = Case(columns=9, rows=8, steps=9, particles=200, start=np.array([1.6, 1.1, 0.2]))
    out, paths = draw(case, tmp_path), RunPaths("run")
    frames = recordings.having(recordings.rows(out, paths.closeup), "Transform3D:translation")
    clouds = recordings.having(recordings.rows(out, paths.particles), "Points2D:positions")
    assert 1 < len(frames) <= case.steps
    for cloud in (c for c in clouds if c.step):
        row = [frame for frame in frames if frame.step is not None and frame.step <= cloud.step][-1]
        middle = np.array(row.values["Transform3D:translation"][0][:2])
        reach = row.values["Transform3D:scale"][0][0]
        within = np.abs(recordings.positions(cloud) - middle).max(axis=1) <= reach
        assert within.mean() > 0.9
