"""The commands as a person runs them: what they print, what they write, how they fail."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import time

import pytest
from rerun.chunk import RrdReader
from typer.testing import CliRunner

from helpers.commands import COMMAND, failure, no_display, run, runs_of
from helpers.small_session import write_small_session, write_small_survey
from maurice_viz.cli.app import app
from maurice_viz.errors import Terminated

RUN_KEYS = {
    "label", "updates", "distance_m", "error_mean_m", "error_median_m",
    "error_final_m", "heading_error_mean_rad", "localized_at_step", "lost_at_step",
    "localized_share", "lost", "wrong_confident_share", "relative_error", "steps_per_s",
}  # fmt: skip


def test_a_session_alone_writes_a_recording_and_a_table(small_session, tmp_path):
    done = run(small_session)
    assert f"{tmp_path.name}.rrd written; open it with:" in done.stderr
    assert "error, mean (m)" in done.stdout
    assert "blended" in done.stdout
    assert RrdReader(tmp_path / f"{tmp_path.name}.rrd").recordings()[0].application_id == "maurice-replay"
    assert "--force" in failure(small_session)
    run(small_session, "--force")


def test_json_has_the_documented_keys_and_repeats(small_session, tmp_path):
    done = run("--json", "--seed", "3", small_session, "-o", "none")
    (found,) = json.loads(done.stdout)["runs"]
    assert set(found) >= RUN_KEYS
    assert (found["label"], found["updates"]) == ("blended", 14)
    assert 0 < found["error_mean_m"] < 0.5
    assert found["lost"] is False
    assert not list(tmp_path.glob("*.rrd"))

    def figures(seed: str) -> list[dict[str, object]]:
        return runs_of(run(small_session, "--json", "-o", "none", "--seed", seed).stdout)

    assert runs_of(done.stdout) == figures("3") != figures("2")


def test_compare_has_a_column_and_a_branch_for_each_run(small_session, tmp_path):
    done = run(*f"compare {small_session} --feature edges --feature edges -o both.rrd --json".split())
    assert [run["label"] for run in json.loads(done.stdout)["runs"]] == ["edges", "edges-2"]
    paths = {str(chunk.entity_path) for chunk in RrdReader(tmp_path / "both.rrd").stream()}
    assert any(path.startswith("/edges/") for path in paths)
    assert any(path.startswith("/edges-2/") for path in paths)


@pytest.mark.parametrize(
    ("words", "name"),
    [
        ("replay {} --preset robust --seed 3", "-robust-particles-50-seed-3"),
        ("replay {} --start global --set sensor.sharpness=0", "-global-particles-50-sensor.sharpness-0"),
        ("compare {} --feature color --feature edges --detail light", "-color-edges"),
    ],
)
def test_a_recording_is_named_after_what_it_holds(small_session, tmp_path, words, name):
    words = [*words.format(small_session).split(), "--particles", "50", "-o", "auto"]
    run(*words)
    assert [file.name for file in tmp_path.glob("*.rrd")] == [f"{tmp_path.name}{name}.rrd"]
    assert "exists already" in run(*words, expect=1).stderr


def test_without_truth_figures_are_null_and_the_replay_still_draws(small_session, tmp_path):
    lines = small_session.read_text().splitlines(keepends=True)
    small_session.write_text("".join(line for line in lines if '"truth"' not in line))
    (found,) = runs_of(run(small_session, "--json").stdout)
    assert found["error_mean_m"] is None
    assert found["lost"] is None
    assert found["distance_m"] == pytest.approx(14 * 0.12)
    assert (tmp_path / f"{tmp_path.name}.rrd").exists()


def test_inspect_and_one_picture(small_session):
    facts = json.loads(run("inspect", small_session, "--json").stdout)
    assert (facts["records"]["image"], facts["truth_share"]) == (14, 1.0)
    assert "kleine Fahrt" in run("inspect", small_session).stdout
    lines = small_session.read_text().splitlines(keepends=True)
    small_session.write_text("".join(lines[:4]))
    (found,) = runs_of(run(small_session, "--json").stdout)
    assert found["updates"] == 1
    assert found["error_mean_m"] is None  # scored from the fourth update on


def test_starts_and_motion_are_checked(small_session, tmp_path):
    run(small_session, "-o", "none", "--start", "global")
    run(small_session, "-o", "none", "--start", "1.6,0.6,17")
    wrong = run(small_session, "-o", "none", "--start", "somewhere", expect=2)
    assert "X,Y,HEADING (m and degrees)" in " ".join(wrong.stderr.replace("│", " ").split())
    lines = small_session.read_text().splitlines(keepends=True)
    header = json.loads(lines[0])
    header["robot"] = {"name": "Maurice", "motion": {"model": "maurice", "turn_gian": 0.7}}
    small_session.write_text("".join([json.dumps(header) + "\n", *lines[1:]]))
    said = failure(small_session)
    assert "session.log:1:" in said
    assert "turn_gian" in said


def test_a_library_takes_a_map_of_ros_and_without_walls_this_is_said(small_session, tmp_path):
    header, *rest = (tmp_path / "survey.log").read_text().splitlines()
    info = {key: value for key, value in json.loads(header).items() if key != "map"}
    (tmp_path / "survey.log").write_text("\n".join([json.dumps(info), *rest]) + "\n")
    bare = run("library", "build", "survey.log", "-o", "bare")
    assert "found no walls, so all of" in bare.stderr
    assert "found no walls, so all of" in run(small_session, "--particles", "20", "-o", "none").stderr
    (tmp_path / "map.pgm").write_bytes(b"P5\n# made\n60 60\n255\n" + bytes([254] * 3600))
    (tmp_path / "map.yaml").write_text("image: map.pgm\nresolution: 0.1\norigin: [-1, -1, 0]\n")
    done = run("library", "build", "survey.log", "-o", "kept", "--map", "map.yaml")
    assert "found no walls" not in done.stderr
    shown = json.loads(run("library", "show", "kept", "--json").stdout)
    assert (shown["width_m"], shown["walls"]) == (pytest.approx(6.0), 4)


def test_one_unit_in_all_that_a_command_says(small_session, tmp_path):
    header, *rest = small_session.read_text().splitlines()
    info = json.loads(header) | {"display_units": "in"}
    small_session.write_text("\n".join([json.dumps(info), *rest]) + "\n")
    shown = run("inspect", small_session).stdout
    assert "distance by truth (in)" in shown
    assert " m)" not in shown
    assert "(m)" not in shown
    assert "(-100.0, -100.0) in is outside the map (x 0.0 to" in failure(
        small_session, "-o", "none", "--start", "-100,-100,0"
    )


def test_library_build_show_and_use(small_session, tmp_path):
    run("library", "build", "survey.log", "-o", "kept")
    assert "--force" in failure("library", "build", "survey.log", "-o", "kept")
    facts = json.loads(run("library", "show", "kept", "--json").stdout)
    assert (facts["entries"], facts["places"]) == (160, 20)
    assert set(facts["channels"]) >= {"color", "edges", "chromaticity"}
    assert "160 pictures" in run("library", "show", "survey.log").stdout
    kept = run(small_session, "--json", "-o", "none", "--library", "kept")
    named = run(small_session, "--json", "-o", "none")
    errors = [json.loads(d.stdout)["runs"][0]["error_mean_m"] for d in (kept, named)]
    assert errors[0] == errors[1]


def test_keep_going_skips_counts_and_says_so(small_session, tmp_path):
    lines = small_session.read_text().splitlines(keepends=True)
    lines[4] = "{broken\n"
    small_session.write_text("".join(lines))
    assert "session.log:5:" in failure(small_session, "-o", "none")
    done = run(small_session, "-o", "none", "--keep-going")
    assert "skipped 1 broken record" in done.stderr


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda p: None, "no session or command of that name"),
        (lambda p: p.mkdir(), "folder"),
        (lambda p: p.write_bytes(b""), "empty"),
        (lambda p: p.write_bytes(os.urandom(4096)), "bad.log"),
        (lambda p: p.write_text('{"format": "maurice-session-log", "version": 99}\n'), "version"),
    ],
    ids=["missing", "directory", "empty", "random bytes", "unknown version"],
)
def test_bad_sessions_give_one_line_and_status_1(make, said, tmp_path):
    bad = tmp_path / "bad.log"
    make(bad)  # type: ignore[operator]  # a lambda of the table above
    assert said in failure(bad)


def test_mistakes_are_one_line(tmp_path, small_session):
    assert "did you mean the command compare" in failure("compair")
    assert "found a survey log" in failure("survey.log")
    for word, meant in {"--save": "--save-run", "--particels": "--particles"}.items():
        assert meant in run(small_session, word, expect=2).stderr
    for option in ("--feature=smell", "--set=resampling.scheme=fair", "--set=sensor.sharpness=nan"):
        run(small_session, option, expect=2)
    run("compare", small_session, "--feature", "color", expect=2)
    run(small_session, "--web", "-o", "x.rrd", expect=2)


def test_being_stopped_leaves_a_recording_and_the_figures_so_far(small_session, tmp_path):
    """Stop a replay that is slow because it has very many particles."""
    args = [*COMMAND, str(small_session), "--particles", "300000", "--save-run", "kept", "--json"]
    with subprocess.Popen(args, env=no_display(), stdout=subprocess.PIPE, stderr=subprocess.PIPE) as going:
        while not any((tmp_path / "kept" / "steps").glob("0*.parquet")):  # one a step, as these are large
            assert going.poll() is None, "it should still be running"
            time.sleep(0.02)
        going.send_signal(signal.SIGINT)
        out, err = going.communicate(timeout=120)
    assert going.returncode == 130, err.decode()
    assert b"Traceback" not in err
    (found,) = json.loads(out)["runs"]
    assert 0 < found["updates"] < 14
    assert RrdReader(tmp_path / f"{tmp_path.name}-particles-300000.rrd").recordings()
    kept = run("kept", "-o", "none", "--json")
    assert runs_of(kept.stdout) == runs_of(out)
    assert f"the run stopped; it holds {found['updates']} of 14 steps" in " ".join(kept.stderr.split())


@pytest.mark.parametrize(("kind", "status"), [(KeyboardInterrupt, 130), (Terminated, 143)])
def test_stopped_before_the_first_step_blames_no_recording(monkeypatch, small_session, kind, status):
    def stop(*_: object) -> None:
        raise kind

    monkeypatch.setattr("maurice_viz.running.run.step_through", stop)
    stopped = CliRunner().invoke(app, [str(small_session), "-o", "none", "--save-run", "kept"])
    assert stopped.exit_code == status
    assert "stopped" in stopped.stderr
    assert "picture" not in stopped.stderr


def test_a_start_outside_the_map_is_refused_and_one_in_no_free_space_is_told(small_session, tmp_path):
    args = [small_session, "-o", "none", "--start"]
    assert "outside the map" in failure(*args, "-100,-100,0")
    run(*args, "1e300,0,0", expect=2)
    assert "outside" not in run(*args, "-0.001,0.7,0").stderr  # the map ends at 0
    on_a_wall = run(*args, "0,1,180")
    assert "not in the map's free space" in on_a_wall.stderr
    assert "all weights were zero" in on_a_wall.stderr


@pytest.mark.parametrize("strategy", ["none", "always", "mixture"])
def test_a_map_without_free_space_is_refused(small_session, tmp_path, strategy):
    header, *rest = (tmp_path / "survey.log").read_text().splitlines()
    info = json.loads(header)
    everywhere = [[-9.0, -9.0], [99.0, -9.0], [99.0, 99.0], [-9.0, 99.0]]
    info["map"]["obstacles"] = [{"name": "flood", "polygon_m": everywhere}]
    (tmp_path / "survey.log").write_text("\n".join([json.dumps(info), *rest]) + "\n")
    (tmp_path / "c.toml").write_text(f'recovery.strategy = "{strategy}"\n')
    args = [small_session, "-o", "none", "--config", "c.toml"]
    assert "has no free space" in failure(*args)


def test_a_dead_display_counts_as_none(small_session, tmp_path):
    done = run(small_session, env={"DISPLAY": ":987"})
    assert "writing a file instead" in done.stderr
    assert (tmp_path / f"{tmp_path.name}.rrd").exists()


@pytest.mark.parametrize(
    "words",
    [
        "replay {} --json --particles 50 -o none",
        "compare {} --json --particles 50 -o none",
        "diagnose {} --json --particles 50",
        "budget {} --json --particles 20 --seeds 2",
        "check {} --max-error 5m --particles 50",
        "inspect {}",
        "doctor {}",
        "convert {} out.log --force",
        "calibrate drive {} --json",
        "library build {} -o built --force",
        "library tune survey.log {} --channels color --json",
        "library check survey.log --drive {} --json",
    ],
)
def test_a_folder_stands_for_the_session_in_it(words, tmp_path, monkeypatch):
    """As `simulate`, `demo`, `convert` and `record` write it."""
    (tmp_path / "drive" / "pictures").mkdir(parents=True)
    write_small_survey(tmp_path)
    log = write_small_session(tmp_path, updates=12).rename(tmp_path / "drive" / "session.log")
    log.write_text(log.read_text().replace("survey.log", "../survey.log", 1))
    for picture in (tmp_path / "pictures").glob("session*"):
        picture.rename(tmp_path / "drive" / "pictures" / picture.name)
    outputs = []
    for path in ("drive/session.log", "drive"):
        done = run(*words.format(path).split(), expect=None)
        said = re.sub(r'"(filter_)?steps_per_s": [\d.]+', "", done.stdout)
        outputs.append((done.exit_code, said or done.stderr))  # this drive is too short for some
    assert outputs[0] == outputs[1]
    assert outputs[0][0] in (0, 1)
