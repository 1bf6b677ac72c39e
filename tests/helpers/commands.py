"""The command, as a person types it where there is no display: in this process, or in one of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from typing import Any

from typer.testing import CliRunner, Result

from maurice_viz.cli.app import app

COMMAND = [sys.executable, "-c", "from maurice_viz.cli.main import main; main()"]


def no_display() -> dict[str, str]:
    return {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}


def process(*words: object, expect: int = 0, **env: str) -> subprocess.CompletedProcess[str]:
    """Run the command in a process of its own; this takes seconds to start."""
    args = [*COMMAND, *map(str, words)]
    done = subprocess.run(args, env=no_display() | env, capture_output=True, text=True, check=False)
    assert done.returncode == expect, (done.stdout, done.stderr)
    assert "Traceback" not in done.stderr
    return done


def run(*words: object, expect: int | None = 0, **how: Any) -> Result:
    """Run the command; a defect is raised, and another exit code than expected fails (None: any is)."""
    done = CliRunner(env={"DISPLAY": None, "WAYLAND_DISPLAY": None}).invoke(
        app, [str(word) for word in words], **how
    )
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert expect is None or done.exit_code == expect, (done.stdout, done.stderr)
    return done


def maurice(*words: object, expect: int = 0) -> tuple[str, str]:
    """Run the command; return what it printed: `out, err = maurice("verify", "kept", expect=1)`."""
    done = run(*words, expect=expect)
    return done.stdout, done.stderr


def runs_of(out: str) -> list[dict[str, Any]]:
    """Return the runs of printed JSON without the one figure that does not repeat."""
    return [{k: v for k, v in one.items() if k != "steps_per_s"} for one in json.loads(out)["runs"]]


def one_line(err: str) -> str:
    (line,) = err.strip().splitlines()
    return line


def failure(*words: object) -> str:
    """Run what ends with exit code 1 and one line; return the line."""
    return one_line(run(*words, expect=1).stderr)
