"""The events of saved runs, as `inspect RUN` lists them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

import maurice_viz as mv
from helpers.commands import maurice
from helpers.small_session import write_small_session, write_small_survey
from maurice_loaders.errors import InputError

ROUTINE = ("resampled", "floor")


def told(log: Path) -> None:
    """Let the log tell of things that happened before the fifth and the tenth picture."""
    lines = log.read_text().splitlines(keepends=True)
    pictures = [number for number, line in enumerate(lines) if '"image"' in line]
    for picture, text in ((9, "lights off"), (4, "kidnapped")):
        at = json.loads(lines[pictures[picture]])["t"]
        lines.insert(pictures[picture], json.dumps({"t": at, "event": text}) + "\n")
    log.write_text("".join(lines))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder with a session, a saved run `kept` and a saved comparison `both`."""
    folder = tmp_path_factory.mktemp("made")
    write_small_survey(folder)
    log = write_small_session(folder)
    told(log)
    two = ["--feature", "color", "--feature", "edges"]
    for args in (
        [log, "--particles", 200, "--save-run", folder / "kept"],
        ["compare", log, *two, "--particles", 100, "--save-run", folder / "both"],
    ):
        maurice(*args, "-o", "none")
    return folder


@pytest.fixture
def runs(made: Path, tmp_path: Path) -> Path:
    """Copy what was made into the test's folder."""
    for name in ("kept", "both"):
        shutil.copytree(made / name, tmp_path / name)
    return tmp_path


def listed(run: str | Path, routine: bool = False) -> list[dict[str, object]]:
    """Return the events of a saved run as JSON: those that a table has too, or all."""
    (one,) = json.loads(maurice("inspect", run, "--json")[0])["runs"]
    events: list[dict[str, object]] = one["events"]
    return events if routine else [event for event in events if event["kind"] not in ROUTINE]


def test_the_events_of_a_saved_run_are_a_table_and_json(runs):
    out, err = maurice("inspect", "kept")
    assert err == ""
    assert "kleine Fahrt" in out
    assert "time (s)" in out
    assert "the robot was carried away" in out
    assert "resampled" not in out
    events = listed("kept")
    assert {"step": 5, "kind": "kidnapped", "text": "the robot was carried away"}.items() <= events[
        [event["kind"] for event in events].index("kidnapped")
    ].items()
    assert [set(event) for event in events] == [{"step", "last", "time_s", "kind", "text"}] * len(events)
    assert [event["step"] for event in events] == sorted(int(str(event["step"])) for event in events)
    assert len(listed("kept", routine=True)) > len(events)


def test_kinds_choose_and_a_comparison_has_the_events_of_each_run(runs):
    (chosen,) = mv.events("kept", kinds=["kidnapped", "lights-changed"]).runs
    assert [(event.step, event.kind) for event in chosen.events] == [(5, "kidnapped"), (10, "lights-changed")]
    (resampled,) = mv.events("kept", kinds=["resampled"]).runs
    assert [event.step for event in resampled.events] == [
        event["step"] for event in listed("kept", routine=True) if event["kind"] == "resampled"
    ]
    with pytest.raises(InputError, match="expected one of failure, kidnapped, lights-changed"):
        mv.events("kept", kinds=["b"])
    out, _ = maurice("inspect", "both")
    (line,) = [line for line in out.splitlines() if "carried away" in line]
    assert "all" in line, "what happened to both stands once"
    labels = [run["label"] for run in json.loads(maurice("inspect", "both", "--json")[0])["runs"]]
    assert labels == ["color", "edges"]
    assert "run" not in maurice("inspect", "both/color")[0].splitlines()[1].split()


def test_without_truth_nothing_is_judged(runs, made):
    log = made / "no truth.log"
    lines = (made / "session.log").read_text().splitlines(keepends=True)
    log.write_text("".join(line for line in lines if '"truth"' not in line))
    maurice(log, "--particles", 50, "--save-run", "blind", "-o", "none")
    assert {"lost", "localized", "recovered", "beyond-three-sigma"}.isdisjoint(
        str(one["kind"]) for one in listed("blind", routine=True)
    )


def test_a_run_that_ended_early_does_not_cut_the_others_short(runs, made):
    whole = json.loads(maurice("inspect", "both", "--json")[0])["runs"]
    for table in ("particles", "renewed", "steps"):
        (part,) = (runs / "both" / "edges" / table).glob("*.parquet")
        part.unlink()
    manifest = runs / "both" / "edges" / "manifest.json"
    held = json.loads(manifest.read_text()) | {"state": "writing", "steps": None}
    manifest.write_text(json.dumps(held))
    cut = json.loads(maurice("inspect", "both", "--json")[0])["runs"]
    assert cut[0] == whole[0]
    assert cut[1] == {"label": "edges", "events": []}


def test_parted_runs_say_so_at_the_second(runs):
    """Moved apart by hand: from step 6 on the second run's estimate is a metre away."""
    import polars as pl

    (file,) = (runs / "both" / "edges" / "steps").glob("*.parquet")
    (other,) = (runs / "both" / "color" / "steps").glob("*.parquet")
    table, first = pl.read_parquet(file), pl.read_parquet(other)
    moved = first["estimate_x_m"] + pl.Series([0.0] * 5 + [1.0] * 9)
    table.with_columns(moved.alias("estimate_x_m"), first["estimate_y_m"]).write_parquet(file)
    color, edges = mv.events("both", kinds=["parted"]).runs
    (event,) = edges.events
    assert color.events == ()
    assert event.step == 7
    assert event.text == "edges and color are 1.00 m apart, since step 6"
