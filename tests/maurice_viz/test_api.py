"""The public functions: the same numbers as the commands, nothing printed, nothing heavy imported."""

from __future__ import annotations

import inspect
import json
import pkgutil
import subprocess
import sys
from hashlib import sha256

import numpy as np
import polars as pl
import pytest
from typer.testing import CliRunner

import maurice_loaders as ml
import maurice_mcl
import maurice_viz as mv
from maurice_loaders.errors import InputError
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.values.session import SessionInfo
from maurice_viz.cli.app import COMMANDS, app, load
from maurice_viz.cli.shared.options import LIVE
from maurice_viz.errors import SILENT

HEAVY = ("numpy", "scipy", "polars", "cv2", "rerun")


def python(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_a_comparison_in_python_gives_the_numbers_of_the_command(small_session, tmp_path, capfd):
    session = ml.open_session(small_session)
    library = ml.open_library(small_session.with_name("survey.log"))
    found = mv.compare(
        session,
        library,
        filters=[mv.Filter("color", particles=100), mv.Filter("blended", particles=100)],
        to=tmp_path / "out.rrd",
    )
    assert capfd.readouterr() == ("", "")
    assert found.rrd == tmp_path / "out.rrd"
    words = ["compare", str(small_session), "--feature", "color", "--feature", "blended"]
    done = CliRunner().invoke(app, [*words, "--particles", "100", "-o", "none", "--json"])
    assert done.exit_code == 0, done.stderr
    ours, theirs = found.to_json()["runs"], json.loads(done.stdout)["runs"]
    for run in (*ours, *theirs):
        run.pop("steps_per_s")
    assert ours == theirs


def test_a_replay_is_saved_and_bad_input_is_an_input_error(small_session, tmp_path):
    settings = {"sensor.sharpness": 2, "resampling.scheme": "residual"}
    found = mv.replay(
        small_session, filter=mv.Filter(particles=50, seed=3, settings=settings), save_run=tmp_path / "kept"
    )
    assert found.saved_run == tmp_path / "kept"
    again = mv.replay(tmp_path / "kept")
    assert again.runs[0].score == found.runs[0].score
    (tmp_path / "empty").mkdir()
    for wrong in (tmp_path / "nowhere.log", tmp_path / "empty"):
        with pytest.raises(InputError):
            mv.replay(wrong)
    with pytest.raises(InputError, match=r"did you mean sensor\.sharpness"):
        mv.replay(small_session, filter=mv.Filter(settings={"sensor.sharpnes": 1}))


def test_motion_is_a_setting_a_file_or_its_values(small_session, tmp_path):
    scores = {}
    for name, gain in (("tight", 1.0), ("loose", 1.3)):
        values = {"model": "odometry", "turn_from_turn": gain}
        file = tmp_path / f"{name}.toml"
        file.write_text(f'[robot.motion]\nmodel = "odometry"\nturn_from_turn = {gain}\n')
        by_file, by_value = (
            mv.replay(small_session, filter=mv.Filter(particles=50, settings={"motion": motion}))
            for motion in (str(file), values)
        )
        assert by_file.runs[0].score == by_value.runs[0].score
        scores[name] = by_file.runs[0].score
    assert scores["tight"] != scores["loose"]
    both = [{"motion": tmp_path / f"{name}.toml"} for name in scores]
    together = mv.compare(
        small_session,
        filters=[mv.Filter(particles=50, settings=settings) for settings in both],
    )
    assert [run.label for run in together.runs] == list(scores)
    assert [run.score for run in together.runs] == list(scores.values())


def test_an_output_says_all_or_nothing(small_session, tmp_path):
    output = mv.Output(tmp_path / "a.rrd")
    assert mv.replay(small_session, filter=mv.Filter(particles=50), output=output).rrd == tmp_path / "a.rrd"
    with pytest.raises(InputError, match="give one"):
        mv.replay(small_session, output=output, to=tmp_path / "b.rrd")
    assert not (tmp_path / "b.rrd").exists()


def test_a_start_may_be_a_pose(small_session):
    typed, measured = (
        mv.replay(small_session, filter=mv.Filter(particles=50, start=start))
        for start in ("1.6,0.6,0", np.array([1.6, 0.6, 0.0]))
    )
    assert typed.runs[0].score == measured.runs[0].score


def test_a_drive_without_pictures_is_refused_for_that(tmp_path):
    with SessionWriter(tmp_path / "wheels.log", SessionInfo("wheels")) as log:
        log.odometry(0.0, [0.1, 0.0, 0.2])
        log.odometry(1.0, [0.1, 0.0, 0.2])
    with pytest.raises(InputError, match="found neither"):
        mv.replay(tmp_path / "wheels.log")
    with pytest.raises(InputError, match=r"which the filter needs; `inspect`"):
        mv.replay(tmp_path / "wheels.log", library=tmp_path / "library")


OWN = [name for name in mv.__all__ if getattr(getattr(mv, name), "__module__", "").startswith("maurice_viz")]
FUNCTIONS = [name for name in OWN if inspect.isfunction(getattr(mv, name))]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_public_functions_say_the_same_thing_the_same_way(name):
    signature = inspect.signature(getattr(mv, name))
    given = signature.parameters
    assert not str(signature.return_annotation).startswith("tuple"), "a result has names"
    assert not {"options", "keep_going"} & set(given), "how a recording is read is called `reading`"
    assert not {"preset", "settings", "sensors"} & set(given), "a filter is a value"
    assert len(given) <= 12
    if "reading" in given:
        assert (given["reading"].annotation, given["reading"].default) == ("Reading | None", None)
    if "listener" in given:
        assert (given["listener"].annotation, given["listener"].default) == ("Listener", SILENT)
    for path in ("to", "save_run"):
        assert path not in given or "str | Path" in given[path].annotation
    if "run" in given:
        assert next(iter(given)) == "run", "a run is what a function reads; what it writes is `save_run`"


def test_little_is_imported_for_help_and_replay():
    for word in ("--help", "--version"):
        code = (
            f"import sys\nsys.argv = ['maurice-replay', '{word}']\nfrom maurice_viz.cli.main import main\n"
            f"try: main()\nexcept SystemExit: pass\n"
            f"print([name for name in {HEAVY} if name in sys.modules])"
        )
        assert python(code).splitlines()[-1] == "[]"
    code = (
        "import sys, maurice_viz.cli.replay, maurice_viz.app.replay\n"
        "print([n for n in ('scipy.stats', 'scipy.signal') if n in sys.modules])"
    )
    assert python(code) == "[]"
    names = [
        one.name
        for one in pkgutil.walk_packages(mv.__path__, "maurice_viz.")
        if not one.name.startswith("maurice_viz.cli")
    ]
    assert len(names) > 60
    loads = "".join(f"import {name}\n" for name in names)
    assert python(f"import sys\n{loads}print('typer' in sys.modules)") == "False"


def test_a_replay_without_a_recording_imports_nothing_that_draws(small_session):
    words = ["maurice-replay", str(small_session), "--particles", "50", "-o", "none", "--json"]
    code = (
        f"import sys\nsys.argv = {words}\nfrom maurice_viz.cli.main import main\n"
        "try: main()\nexcept SystemExit: pass\n"
        "drawing = ('rerun', 'rerun_bindings', 'pyarrow', 'maurice_viz.panels', 'maurice_viz.viewer.sinks')\n"
        "print([name for name in drawing if name in sys.modules])"
    )
    shown = python(code)
    assert '"updates": 14' in shown
    assert shown.splitlines()[-1] == "[]"


@pytest.mark.parametrize("name", COMMANDS)
def test_commands_are_listed_as_they_are(name):
    command = load(COMMANDS[name])
    options = [param for param in command.params if param.param_type_name == "option" and not param.hidden]  # type: ignore[attr-defined]
    assert command.help
    most = 21 if name == "simulate" else 20
    # what only a live source has stands in a panel of its own; --web was an option that no help listed
    assert len([option for option in options if option.rich_help_panel != LIVE]) <= most  # type: ignore[attr-defined]


def test_what_is_returned_fits_a_screen_and_help_lists_the_fields(small_session, tmp_path):
    scores = mv.compare(small_session, filters=["color", "edges"], save_run=tmp_path / "kept")
    assert scores.steps.height == 2 * scores.runs[0].score.updates
    assert scores.steps["label"].unique(maintain_order=True).to_list() == ["color", "edges"]
    assert mv.traces(tmp_path / "kept").columns == scores.steps.columns
    library = mv.open_library(mv.open_session(small_session).info.survey)
    localizer = maurice_mcl.make_localizer(library, particles=50)
    _, record = next(maurice_mcl.run(localizer, mv.open_session(small_session)))
    saved = mv.open_run(tmp_path / "kept" / "color")
    for value in (library, localizer, record, scores.runs[0].table, saved):
        assert len(repr(value)) < 300
    assert len(repr(scores)) < 600
    assert "color: 14 updates" in repr(scores)
    assert "<br>" in scores._repr_html_()
    for kind, field in (
        (mv.Filter, "particles: 2000"),
        (mv.Output, "layout: the one that is open"),
        (mv.Reading, "camera: Camera whose"),
        (mv.Demands, "max_error_m: mean"),
        (mv.LiveOptions, "follow: the source"),
    ):
        assert field in (kind.__doc__ or "")


def test_the_clouds_of_a_saved_run_are_one_lazy_frame_in_the_maps_frame(small_session, tmp_path):
    mv.replay(small_session, filter=mv.Filter(particles=40, seed=2), save_run=tmp_path / "kept")
    run = mv.open_run(tmp_path / "kept")
    session = mv.open_session(small_session)
    localizer = maurice_mcl.make_localizer(
        mv.open_library(session.info.survey), particles=40, seed=2
    ).of_session(session)
    cloud = run.cloud.collect()
    for moment, record in maurice_mcl.run(localizer, session):
        step = cloud.filter(pl.col("step") == moment.frame.step)
        weighted = step.filter(phase="weighted")
        places = record.weighted.poses.astype(float) + np.append(record.weighted.origin, 0.0)
        assert np.allclose(weighted.select("x_m", "y_m", "heading_rad").to_numpy(), places, atol=1e-6)
        assert np.allclose(weighted["weight"].to_numpy(), record.weighted.weights)
        assert np.allclose(weighted.select("truth_x_m", "truth_y_m").row(0), moment.truth[:2])
        resampled = step.filter(phase="resampled")
        assert resampled["parent"].to_list() == record.parents.tolist()
        assert not resampled["fresh"].any()


def test_a_run_of_before_there_were_channels_of_ones_own_opens(small_session, tmp_path):
    mv.replay(small_session, filter=mv.Filter(particles=40), save_run=tmp_path / "kept")
    settings, manifest = tmp_path / "kept" / "configuration.toml", tmp_path / "kept" / "manifest.json"
    before = settings.read_bytes()
    after = before.replace(b"channels = []\n", b"")
    assert after != before
    settings.write_bytes(after)
    hashes = (sha256(text).hexdigest() for text in (before, after))
    manifest.write_text(manifest.read_text().replace(*hashes))
    assert mv.verify(tmp_path / "kept")[0].same
