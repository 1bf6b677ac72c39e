"""What goes wrong with files is one line that says what to do."""

from __future__ import annotations

import errno
import os

import pytest
import typer

from maurice_viz.commands.failing import one_line_errors

FULL = "maurice-replay: a/b.log: No space left on device"


@pytest.mark.parametrize(
    ("number", "said"),
    [
        (
            errno.ENOSPC,
            "maurice-replay: a/b.log: No space left on device; free some space, or write to another disk",
        ),
        (errno.EACCES, "maurice-replay: a/b.log: Permission denied"),
    ],
)
def test_an_error_of_the_system_is_one_line(
    number: int, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(typer.Exit) as end, one_line_errors():
        raise OSError(number, os.strerror(number), "a/b.log")
    assert end.value.exit_code == 1
    assert capsys.readouterr().err == f"{said}\n"
