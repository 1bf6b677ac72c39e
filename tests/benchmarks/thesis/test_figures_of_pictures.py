"""Figures of the thesis about constants, pictures, histograms and matching."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks.thesis import constants, histograms_of_light, matching
from benchmarks.thesis.drawn import draw_figures, shares
from benchmarks.thesis.example import DrivePictures, in_other_light, ranks_of, with_noise
from benchmarks.thesis.figures import FIGURES
from benchmarks.thesis.material import Material, ThesisFigure
from helpers import viz_fakes as fakes
from helpers.figures import alike
from maurice_datasets.trials.drives import Bench, Drive
from maurice_datasets.trials.engine import run_plan
from maurice_datasets.trials.plan import read_plan
from maurice_mcl.sensor.distances import DISTANCES
from maurice_viz.plots.calibration import FIGURES as OF_MOTION

OURS = (*constants.FIGURES, *histograms_of_light.FIGURES, *matching.FIGURES)
NEED_A_SURVEY = {14}
CHANNELS = ("color", "edges", "smoothed", "cumulative", "chromaticity")
PLAN = """
seeds = 2
[[sessions]]
label = "global"
task = "global"
updates = 6
arenas = 1
[settings]
preset = "thesis"
particles = 100
"""


def pictures_of(folder: Path, steps: int) -> DrivePictures:
    library = fakes.make_library(folder)
    images = [fakes.picture_at(pose) for pose in library.poses]
    library = replace(library, index={name: fakes.index_of(images, name) for name in CHANNELS})
    session = fakes.make_session(library, steps)
    return DrivePictures(Drive(session, None, Bench.of(library), None))


@pytest.fixture(scope="module")
def material(tmp_path_factory: pytest.TempPathFactory) -> Material:
    """Two made-up drives over a library whose pictures are a formula: quick to draw from."""
    folder = tmp_path_factory.mktemp("material")
    several = (pictures_of(folder, 9), pictures_of(folder, 6))
    made = Material(folder)
    made.__dict__.update(drive=several[0].drive, pictures=several[0], several=several)
    return made


def check(one: ThesisFigure, made: Figure) -> None:
    """No axes are empty, each has a label along both sides, or shows a picture; all is told apart in gray."""
    for axes in made.axes:
        assert axes.has_data(), one.title
        assert axes.get_xlabel(), one.title
        assert axes.get_ylabel() or axes.images or axes.get_shared_y_axes().get_siblings(axes), one.title
    assert not alike(made), one.title


def test_every_figure_is_drawn_once_and_by_its_number() -> None:
    numbers = [one.number for one in FIGURES]
    assert numbers == sorted(set(numbers))
    assert {one.number for one in OURS} <= set(numbers)
    assert len({one.title for one in FIGURES}) == len(FIGURES)


def test_what_is_told_apart_by_shape_or_in_gray_alone() -> None:
    drawing = Figure()
    axes = drawing.subplots()
    axes.plot([0, 1], color="#D55E00", label="red")
    axes.plot([1, 0], color="#4F8A3C", label="green")  # as light as the red
    axes.plot([1, 1], color="#4F8A3C", ls="--", label="dashed")
    axes.plot([0, 0], color="#101010", label="black")
    assert alike(drawing) == [("red", "green")]


@pytest.mark.parametrize("number", sorted({one.number for one in OURS} - NEED_A_SURVEY))
def test_every_figure_has_labels_and_data(material: Material, number: int) -> None:
    one = next(one for one in OURS if one.number == number)
    made = one.draw(material)
    check(one, made)
    words = [text.get_text() for text in made.findobj(lambda part: hasattr(part, "get_text"))]
    assert not [word for word in words if "nan" in word.split()]


def test_the_marked_entry_is_the_truth_s_reference(material: Material) -> None:
    made = next(one for one in FIGURES if one.number == 17).draw(material)
    star = next(line for line in made.axes[0].lines if line.get_marker() == "*")
    pictures = material.pictures
    moment, entry = pictures.known[pictures.usual.number]
    assert star.get_xdata() == [entry]
    found = pictures.quality("color")[pictures.usual.number]
    assert star.get_ydata() == [found[entry]]
    gaps = np.linalg.norm(pictures.library.poses[:, :2] - moment.truth[:2], axis=1)
    assert gaps[entry] == pytest.approx(gaps.min())
    rank = 1 + int((found > found[entry]).sum())
    assert f"rank {rank} of {pictures.library.size}" in made.get_supxlabel()
    assert "15 pictures of 2 drives" in made.get_supxlabel()


def test_the_shares_of_ranks_are_those_of_all_pictures(material: Material) -> None:
    made = next(one for one in FIGURES if one.number == 57).draw(material)
    ranks = np.concatenate([one.ranks("blended") for one in material.several])
    x, y = made.axes[1].lines[0].get_data()
    assert y[0] == pytest.approx(100 * (ranks <= 1).mean())
    assert y[np.flatnonzero(x == 10)] == pytest.approx(100 * (ranks <= 10).mean())
    assert y[-1] == 100


@pytest.mark.parametrize(("number", "channel"), [(22, "color"), (53, "edges")])
def test_the_bars_add_up_to_the_thesis_s_sum(material: Material, number: int, channel: str) -> None:
    made = next(one for one in FIGURES if one.number == number).draw(material)
    heights = [bar.get_height() for bar in made.axes[0].patches]
    pair = material.pictures.usual
    sample, _ = pair.described(channel)
    distance = DISTANCES["thesis"](sample, pair.pictures.library.index[channel])[pair.entry]
    assert len(heights) == 84
    assert sum(heights) == pytest.approx(84 * float(distance), rel=1e-4)


def test_the_best_five_are_in_order(material: Material) -> None:
    made = next(one for one in FIGURES if one.number == 18).draw(material)
    found = material.pictures.quality("color")[material.pictures.usual.number]
    titles = [axes.get_title(loc="left") for axes in made.axes[1:]]
    for title, value in zip(titles, sorted(found.tolist(), reverse=True), strict=False):
        assert f"quality {value:.3f}" in title


def test_ranks_light_and_noise() -> None:
    quality = np.array([[0.1, 0.9, 0.5], [0.3, 0.3, 0.3]], np.float32)
    assert ranks_of(quality, np.array([2, 0], np.int32)).tolist() == [2, 1]
    image = np.full((4, 5, 3), 100, np.uint8)
    assert in_other_light(image, 1.0) is image
    assert in_other_light(image, 0.5).max() < 100 < in_other_light(image, 2.0).min()
    assert (with_noise(image, 0) == image).all()
    assert (with_noise(image, 9) == with_noise(image, 9)).all()
    assert with_noise(image, 9).std() == pytest.approx(9, rel=0.4)


def test_the_figures_of_the_calibration_are_those_of_the_command() -> None:
    assert [one.number for one in constants.FIGURES[:8]] == [int(name[7:9]) for name in OF_MOTION]


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Trials of two short simulated drives in one arena: its survey is what takes time."""
    folder = tmp_path_factory.mktemp("simulated")
    (folder / "tiny.toml").write_text(PLAN)
    run_plan(read_plan(folder / "tiny.toml"), folder / "trials")
    return folder / "trials"


@pytest.mark.slow
def test_simulated_trials_make_every_figure(simulated: Path, tmp_path: Path) -> None:
    numbers = [one.number for one in OURS]
    drawn = draw_figures(simulated, tmp_path / "figures", only=numbers)
    assert len(drawn.files) == len(numbers)
    assert not drawn.left_out
    assert min(file.stat().st_size for file in drawn.files) > 10_000
    material = Material(simulated)
    check(constants.FIGURES[8], next(one for one in OURS if one.number == 14).draw(material))
    assert [len(one.known) for one in material.several] == [6, 6]


def test_figures_that_need_the_same_drives_are_the_work_of_one_process():
    numbers, ours = [one.number for one in FIGURES], {one.number for one in OURS}
    for workers, processes in ((2, 1), (3, 1), (4, 2), (8, 4)):
        work = shares(numbers, workers)
        assert all(set(share) <= ours for share in work[:processes])
        assert all(len(share) == 1 and not set(share) & ours for share in work[processes:])
        assert sorted(number for share in work for number in share) == sorted(numbers)
    assert shares([26, 27, 28], 2) == [[26], [27], [28]]
