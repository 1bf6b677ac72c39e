"""Figures of drives, traces and costs: all are drawn, and show the numbers of the rows."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from benchmarks.thesis import clouds, costs, drawn, drives, traces
from benchmarks.thesis.drawn import draw_figures
from benchmarks.thesis.figures import OVER_PARTICLES
from benchmarks.thesis.material import Material, MissingRuns
from benchmarks.thesis.timing import COMPARE, DESCRIBE, UPDATE, measure
from helpers.figures import alike
from maurice_datasets.trials.engine import run_plan
from maurice_datasets.trials.plan import read_plan
from maurice_datasets.trials.rows import TYPES
from maurice_datasets.trials.table import with_settings
from maurice_loaders.errors import InputError
from maurice_mcl.values.geometry import INCH_M

OURS = (*clouds.FIGURES, *costs.FIGURES, *drives.FIGURES, *traces.FIGURES)
SESSION = 'seeds = 2\n[[sessions]]\ntask = "{task}"\nupdates = 14\narenas = 1\n{more}\n'
THESIS = '[settings]\npreset = "thesis"\n'
PARTS = {
    "position-tracking": SESSION.format(task="tracking", more="") + THESIS + "particles = 100\n",
    "global-localization": SESSION.format(task="global", more="")
    + THESIS
    + 'feature = "color"\n[grid]\nparticles = [20, 500]\n',
    "kidnapped": SESSION.format(task="kidnapped", more="kidnap_at = 6")
    + '[grid]\npreset = ["thesis", "robust"]\n',
    "recovery": SESSION.format(task="kidnapped", more="kidnap_at = 6")
    + '[settings]\nfeature = "blended"\nparticles = 300\n'
    + '[grid]\n"recovery.strategy" = ["none", "threshold"]\n',
}
FEATURES = '{session}[settings]\npreset = "thesis"\nparticles = 100\n[grid]\nfeature = {features}\n'
for _name, _features in (
    ("smoothing", '["color", "smoothed", "blurred"]'),
    ("blended", '["color", "edges", "blended", "best"]'),
):
    _session = SESSION.format(task="global", more="")
    PARTS[_name] = FEATURES.format(session=_session, features=_features)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Trials of all parts that these figures need, on tiny drives in one arena."""
    home = tmp_path_factory.mktemp("plans")
    for name, text in PARTS.items():
        (home / f"{name}.toml").write_text(text)
    (home / "tiny.toml").write_text(f"include = {[f'{name}.toml' for name in PARTS]}")
    assert run_plan(read_plan(home / "tiny.toml"), home / "trials").failed == 0
    measure(home / "trials", rounds=2, drives=2)
    return home / "trials"


@pytest.mark.slow
def test_every_figure_is_drawn_and_its_axes_have_labels(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clouds, "RUNS_A_PLACE", 2)
    monkeypatch.setattr(clouds, "DRIVES", 1)
    monkeypatch.setattr(clouds, "TURNS", 5)
    material, left = Material(folder), set()
    for one in OURS:
        try:
            made = one.draw(material)
        except MissingRuns:
            left.add(one.number)
            continue
        labels = {axes.get_xlabel() for axes in made.axes} | {axes.get_ylabel() for axes in made.axes}
        assert labels - {""}, one.number
        assert made.legends or any(axes.get_legend() for axes in made.axes), one.number
        assert not alike(made), one.number
    assert left <= {36, 65}  # perhaps no run of these few failed, or needed fresh particles
    written = draw_figures(folder, tmp_path / "figures", only=[24, 69], formats=["png", "svg"])
    assert [file.name for file in written.files] == [
        f"figure-{number}.{kind}" for number in (24, 69) for kind in ("png", "svg")
    ]


@pytest.mark.slow
def test_a_run_made_again_from_its_row_is_the_same(folder: Path) -> None:
    material = Material(folder)
    row = material.part("recovery").row(0, named=True)
    again = [record.mean_estimate.sd_m for _, record in material.run_of(row)]
    assert np.hypot(*np.array(again).T).astype(np.float32).tolist() == row["sd_m"]


def made_of(tmp_path: Path, rows: pl.DataFrame) -> Material:
    """Return material of made-up rows."""
    material = Material(tmp_path)
    material.__dict__["rows"] = rows
    return material


def test_a_curve_is_the_mean_of_its_runs_and_its_band_holds_it(tmp_path: Path) -> None:
    values = np.random.default_rng(1).uniform(0.1, 0.9, (6, 9)).astype(np.float32)
    rows = pl.DataFrame(
        {
            "part": ["smoothing"] * 6,
            "session": ["global"] * 6,
            "feature": ["color", "smoothed"] * 3,
            "seed": [0, 0, 1, 1, 2, 2],
            "arena": [1, 1, 1, 2, 2, 2],
            "sd_m": values.tolist(),
        }
    )
    made = traces.by_feature(made_of(tmp_path, rows), "smoothing", ("color", "smoothed"))
    color, smoothed = made.axes[0].get_lines()
    assert color.get_label() == "color, 3 runs"
    np.testing.assert_allclose(color.get_ydata(), values[::2].mean(0) / INCH_M, rtol=1e-6)
    np.testing.assert_allclose(smoothed.get_ydata(), values[1::2].mean(0) / INCH_M, rtol=1e-6)
    assert all(one.low <= one.value <= one.high for one in traces.curve(rows, "sd_m"))


def test_a_run_that_ended_earlier_is_left_out_after_its_end(tmp_path: Path) -> None:
    named = {"arena": [1, 2], "session": ["global", "global"], "seed": [0, 1]}
    rows = pl.DataFrame(named | {"error_m": [[1.0, 2.0, 3.0], [3.0, None]]}, strict=False)
    assert [(one.value, one.count) for one in traces.curve(rows, "error_m")] == [(2, 2), (2, 1), (3, 1)]


def test_certainty_is_the_mean_since_the_kidnapping() -> None:
    named = {"arena": [1, 1], "session": ["kidnapped", "kidnapped"], "seed": [0, 1]}
    since = {"kidnapped_at_update": [2, 3], "confidence": [[1.0, 0.2, 0.4], [1.0, 1.0, 0.5]]}
    rows = pl.DataFrame(named | since)
    found = traces.after_kidnapping(rows, traces.CONFIDENCE)
    assert (round(found.value, 6), found.count) == (40, 2)


def test_points_of_costs_are_the_medians(tmp_path: Path) -> None:
    one = {"low_s": 0.001, "high_s": 0.004, "of_color": 2.0, "of_color_low": 1.5, "of_color_high": 3.0}
    rows = [
        {"what": UPDATE, "feature": "color", "particles": n, "median_s": n / 1e5, **one} for n in (100, 200)
    ]
    rows += [{"what": what, "feature": "hog", "median_s": 1.0, **one} for what in (DESCRIBE, COMPARE)]
    material = Material(tmp_path)
    material.__dict__["timing"] = pl.DataFrame(rows)
    axes = costs.update(material).axes[0]
    assert axes.get_lines()[0].get_xydata().tolist() == [[100, 1], [200, 2]]
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    relative = costs.of_color(material, DESCRIBE, "time over that of color (ratio)").axes[0]
    assert relative.get_lines()[0].get_xdata().tolist() == [2.0]


def test_figure_36_says_why_it_is_not_drawn(tmp_path: Path) -> None:
    """Quick trials have global runs, but none with 500 particles; of others, none may have failed."""
    named = {"part": "global-localization", "feature": "color", "settings": "{}"}
    for particles, why in ((20, "with particles 500 and feature color"), (500, "with 500 particles failed")):
        rows = pl.DataFrame([dict.fromkeys(TYPES) | named | {"particles": particles}], schema=TYPES)
        with pytest.raises(MissingRuns, match=why):
            drives.failed_run(made_of(tmp_path, with_settings(rows)))


def test_figures_of_no_trials_are_refused_before_a_folder_is_made(tmp_path):
    with pytest.raises(InputError, match="expected a folder that `maurice-replay trials run` has made"):
        draw_figures(tmp_path, tmp_path / "figures")
    assert not (tmp_path / "figures").exists()


@pytest.mark.parametrize("figure", OVER_PARTICLES, ids=lambda figure: str(figure.number))
@pytest.mark.parametrize("value", [None, 0.0])
def test_a_figure_of_runs_without_values_is_a_note(figure, value, tmp_path, monkeypatch):
    """As of few short drives, none of which was localized or lost: a note, and the other figures go on."""
    names = {"part": ("position-tracking", "global-localization"), "seed": (0, 1), "particles": (100, 2000)}
    runs = [dict(zip(names, values, strict=True)) for values in itertools.product(*names.values())]
    named = {"feature": "color", "session": "drive", "arena": 0, "settings": "{}", "pictures_after": 9}
    lengths = ("error_mean_m", "before_loss_m", "localized_m", "after_m", "error_final_m", "distance_m")
    known = None if value is None else False
    rows = [
        dict.fromkeys(TYPES) | named | dict.fromkeys(lengths, value) | {"lost": known} | run for run in runs
    ]
    table = with_settings(pl.DataFrame(rows, schema=TYPES))
    monkeypatch.setattr(drawn, "_material", lambda folder, changed: made_of(tmp_path, table))
    monkeypatch.setattr(drawn, "rows_changed", lambda folder: 0.0)
    rendered = drawn._render_one(tmp_path, ("png",), True, None, figure.number)
    assert bool(rendered.files) != bool(rendered.missing)
    if figure.number == 38:
        assert bool(rendered.files) == (value is not None)


def test_the_end_of_a_drive_is_no_loss_and_no_place_where_it_was_localized(tmp_path):
    """With few particles only easy drives are localized, and soon; half of them never are."""
    names = {"feature": "color", "session": "drive", "settings": "{}", "variant": 0}
    search = names | {"part": "global-localization", "after_m": 30.0}
    track = names | {"part": "position-tracking", "distance_m": 40.0, "error_mean_m": 0.2}
    rows = []
    for seed in range(12):
        run = {"seed": seed, "arena": seed % 6}
        rows.append(search | run | {"particles": 100, "localized_m": 1.0 if seed < 4 else None})
        rows.append(search | run | {"particles": 2000, "localized_m": 5.0})
        lost = seed < 6
        rows.append(track | run | {"particles": 100, "lost": lost, "before_loss_m": 10.0 if lost else 40.0})
        rows.append(track | run | {"particles": 2000, "lost": False, "before_loss_m": 40.0})
    table = with_settings(pl.DataFrame([dict.fromkeys(TYPES) | row for row in rows], schema=TYPES))
    figure = {one.number: one for one in OVER_PARTICLES}
    material = made_of(tmp_path, table)
    medians = figure[38].draw(material).axes[0].get_lines()[0].get_ydata()
    np.testing.assert_allclose(medians, [30 / INCH_M, 5 / INCH_M])  # few particles are not faster
    lines = {str(line.get_label()): line for line in figure[26].draw(material).axes[0].get_lines()}
    (mean,) = [container[0] for container in figure[26].draw(material).axes[0].containers]
    np.testing.assert_allclose(mean.get_ydata(), [(10 / INCH_M + 1000) / 2, 1000], rtol=1e-6)
    assert {label for label in lines if label.startswith(("lost", "not lost"))} == {
        "lost there, 6 runs",
        "not lost: end of the drive, 18 runs of 12 drives",
    }
