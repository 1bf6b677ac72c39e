"""`rerun-importer-maurice`: what it takes, what it gives back, what Rerun makes of it."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from rerun.chunk import RrdReader

from helpers.commands import one_line
from maurice_viz.cli import importer as program
from maurice_viz.cli.importer import NOT_MINE, is_ours

CODE = "from maurice_viz.cli.importer import main; main()"


Importer = Callable[..., tuple[bytes, str]]


@pytest.fixture
def importer(monkeypatch: pytest.MonkeyPatch, capfdbinary: pytest.CaptureFixture[bytes]) -> Importer:
    """Run it in this process; return what it wrote to standard output, and what it said."""
    monkeypatch.setattr(program, "_end_with_reader", lambda: None)  # this process has another one

    def run(*words: str | Path, expect: int = 0) -> tuple[bytes, str]:
        monkeypatch.setattr(sys, "argv", ["", *map(str, words)])
        with pytest.raises(SystemExit) as end:
            program.main()
        out, said = capfdbinary.readouterr()
        assert end.value.code == expect, said
        return out, said.decode()

    return run


def recording(data: bytes, folder: Path) -> RrdReader:
    file = folder / "imported.rrd"
    file.write_bytes(data)
    return RrdReader(file)


def entities(reader: RrdReader) -> set[str]:
    return {chunk.entity_path for chunk in reader.stream().to_chunks() if not chunk.is_empty}


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("empty.log", b""),
        ("carmen.log", b"# CARMEN Logfile\nODOM 1 2 3\n"),
        ("other.log", b'{"format": "another-log", "version": 1}\n'),
        ("manifest.json", b'{"name": "an app"}'),
        ("manifest.json", b"[1"),
        ("manifest.json", b"[" * 100_000),
        ("binary.mcap", b"\x89MCAP0\r\n" + bytes(100)),
        ("quoted.txt", b'see "maurice-session-log"\n'),
    ],
)
def test_files_of_others_are_given_back(tmp_path, name, data):
    (tmp_path / name).write_bytes(data)
    assert not is_ours(tmp_path / name)


def test_other_files_are_given_back(tmp_path, importer):
    assert not is_ours(tmp_path)
    assert not is_ours(tmp_path / "nothing")
    os.mkfifo(tmp_path / "pipe.log")
    assert not is_ours(tmp_path / "pipe.log")
    (tmp_path / "a.txt").write_text("hello")
    assert importer(tmp_path / "a.txt", "--recording-id", "x", expect=NOT_MINE) == (b"", "")
    code = f"import sys; sys.argv = ['x', {str(tmp_path / 'a.txt')!r}]\n"
    code += f"try:\n  {CODE}\nexcept SystemExit: pass\n"
    code += "print([m for m in ('rerun', 'numpy', 'typer', 'cv2') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_session_becomes_a_replay_in_the_recording_asked_for(small_session, tmp_path, importer):
    words = ("--application-id", "session", "--recording-id", "rec_1", "--opened-recording-id", "rec_0")
    reader = recording(importer(small_session, *words)[0], tmp_path)
    (found,) = reader.recordings()
    assert (found.application_id, found.recording_id) == ("maurice-replay", "rec_1")
    assert len(reader.blueprints()) == 1
    shown = entities(reader)
    assert {"/session/camera", "/world/walls"} <= shown
    assert any(path.startswith("/blended/") and "particles" in path for path in shown)


def test_without_a_library_drive_or_survey_are_shown(small_session, tmp_path, importer):
    survey = small_session.with_name("survey.log")
    assert "/session/camera" in entities(recording(importer(survey)[0], tmp_path))
    survey.unlink()
    data, said = importer(small_session)
    assert "only the drive itself is shown" in said
    shown = entities(recording(data, tmp_path))
    assert {"/session/camera", "/world/walls"} <= shown
    assert not any("particles" in path for path in shown)


def test_a_broken_session_is_one_line(small_session, importer):
    small_session.write_text(
        small_session.read_text().splitlines()[0].replace('"version": 1', '"version": 9')
    )
    assert "expected 1" in one_line(importer(small_session, expect=1)[1])


def test_rerun_itself_opens_a_session_through_it(small_session, tmp_path):
    script = tmp_path / "bin" / "rerun-importer-maurice"
    script.parent.mkdir()
    script.write_text(f'#!/bin/sh\nexec "{sys.executable}" -c "{CODE}" "$@"\n')
    script.chmod(0o755)
    (tmp_path / "home").mkdir()
    settings = os.environ | {"PATH": f"{script.parent}:{os.environ['PATH']}", "HOME": str(tmp_path / "home")}
    words = ["--save", "out.rrd", "--bind", "127.0.0.1", "--port", "0"]
    rerun = [sys.executable, "-m", "rerun", small_session, *words]
    done = subprocess.run(rerun, cwd=tmp_path, env=settings, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    recordings = RrdReader(tmp_path / "out.rrd").recordings()
    assert [one.application_id for one in recordings].count("maurice-replay") == 1


def test_a_viewer_that_goes_away_is_no_defect_of_ours(small_session):
    command = [sys.executable, "-c", CODE, str(small_session)]
    reading, writing = os.pipe()
    with subprocess.Popen(command, stdout=writing, stderr=subprocess.PIPE) as going:
        os.close(writing)
        os.read(reading, 1000)
        os.close(reading)
        try:
            _, said = going.communicate(timeout=60)
        finally:
            going.kill()
    assert b"Traceback" not in said
    assert b"went away" in said
    assert going.returncode == 1
