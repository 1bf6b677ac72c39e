"""Every reader of TOML refuses what has no bounds, in one line and at once."""

from __future__ import annotations

import os
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest

from maurice_datasets.surveys import read_poses
from maurice_datasets.trials.plan import read_plan as read_trials
from maurice_datasets.worlds.read_plan import read_plan
from maurice_loaders.config_files import check_config, read_config, read_motion
from maurice_loaders.errors import InputError
from maurice_loaders.files.text import (
    MOST_TOML_BYTES,
    parse_toml,
    read_number_rows,
    read_toml,
)
from maurice_loaders.reading.options import read_reading
from maurice_viz.cli.shared.values import settings_of
from maurice_viz.errors import OptionError

READERS: dict[str, Callable[[Path], object]] = {
    "settings": check_config,
    "layer": read_config,
    "motion": read_motion,
    "reading": read_reading,
    "plan": read_trials,
    "world": read_plan,
}
TEXTS = {
    "a key of many parts": "a." * 100_000 + "a = 1",
    "quoted parts": '"a".' * 50_000 + "a = 1",
    "a table's name of many parts": "[" + "a . " * 50_000 + "a]",
    "many keys": "".join(f"k{number} = 1\n" for number in range(300_000)),
    "lists in lists": "a = " + "[" * 400_000,
    "tables in tables": "a = " + "{a=" * 100_000,
    "a long number": "a = " + "9" * 900_000,
    "a long text": 'a = "' + "x" * 900_000 + '"',
    "a text without an end": 'a = "' + '\\"' * 400_000,
    "a paragraph without an end": 'a = """' + '\\"""' * 200_000,
    "only quotes": "'" * 999_999,
    "bytes of Latin-1": "a = 'é'".encode("latin-1"),
}


@pytest.mark.parametrize("text", TEXTS)
@pytest.mark.parametrize("reader", READERS)
def test_what_has_no_bounds_is_refused_in_one_line(reader: str, text: str, tmp_path: Path) -> None:
    file, content = tmp_path / "a.toml", TEXTS[text]
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    began_s = time.process_time()
    if text == "a long text" and reader == "layer":
        READERS[reader](file)  # which only checks its form
        return
    with pytest.raises(InputError) as refused:
        READERS[reader](file)
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 3000
    assert time.process_time() - began_s < 10


@pytest.mark.parametrize("reader", READERS)
def test_only_regular_files_are_read(reader: str, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "zero.toml").symlink_to("/dev/zero")
    (tmp_path / "folder.toml").mkdir()
    for name in ("pipe.toml", "zero.toml", "folder.toml", "none.toml"):
        with pytest.raises(InputError, match=r"found no|found a folder|cannot be read|there is no"):
            READERS[reader](tmp_path / name)


def test_a_setting_typed_on_the_command_line_has_the_same_bounds() -> None:
    assert settings_of(["a.b={x = [1.5, 'y.z']}"]) == {"a.b": {"x": [1.5, "y.z"]}}
    for value in ("[" * 100_000, "{a=" * 50_000, "[" + "9" * 50_000 + "]"):
        with pytest.raises(OptionError, match="found"):
            settings_of([f"sensor.weights={value}"])


def test_dots_that_are_no_keys_are_read() -> None:
    numbers = ", ".join(["1.5"] * 1000)
    words = ". ".join(["two words"] * 1000)
    text = (
        f'''a = [{numbers}]\nb = "{words}"\nc = """{words}\n"" [ {words}"""\n# {"[" * 9} {words}\nd.e = 1'''
    )
    assert parse_toml(text)["d"] == {"e": 1}
    with pytest.raises(ValueError, match="at line 2"):
        parse_toml("b = 1\n" + "a." * 40 + "a = 1")


def test_a_large_file_is_not_read_to_its_end(tmp_path: Path) -> None:
    file = tmp_path / "large.toml"
    with file.open("wb") as large:
        large.truncate(10**10)  # takes no room on the disk
    tracemalloc.start()
    with pytest.raises(InputError, match="found more than 1 MB, expected settings"):
        read_toml(file, "settings")
    assert tracemalloc.get_traced_memory()[1] < 4 * MOST_TOML_BYTES
    tracemalloc.stop()


def test_a_message_stays_short_whatever_was_found() -> None:
    message = InputError(Path("a.toml"), f"found {'x' * 10**6}, expected less").message
    assert len(message) < 2100
    assert message.startswith("found xxx")
    assert message.endswith("xxx, expected less")


def test_tables_are_regular_files_too(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "zero.csv").symlink_to("/dev/zero")
    for name in ("pipe.csv", "zero.csv"):
        for read in (read_poses, lambda file: read_number_rows(file, "a map", "a map", 4, "four")):
            with pytest.raises(InputError, match="found no regular file"):
                read(tmp_path / name)
