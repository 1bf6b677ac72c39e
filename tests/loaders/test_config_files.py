"""Options of reading, and a robot's motion, in TOML files."""

from __future__ import annotations

from pathlib import Path

import pytest

from maurice_loaders.config_files import motion_to_toml, read_motion
from maurice_loaders.errors import InputError
from maurice_loaders.reading.options import (
    CORRECTIONS,
    FIELDS,
    Reading,
    read_reading,
    write_reading,
)

CHANGED = Reading(
    camera="left",
    table=Path("poses.csv"),
    columns={"x": "px", "heading": "yaw:deg"},
    time_unit="ns",
    odometry_offset_s=-0.1,
    truth_offset_s=-1_700_000_000.25,
    turn_scale=-1.0,
    odometry_are="steps",
    camera_yaw_rad=0.1 + 0.2,
    max_dt_s=0.5,
    odometry_seed=7,
    keep_going=True,
)


@pytest.mark.parametrize("options", [Reading(), CHANGED])
def test_a_file_holds_options_to_the_last_bit(
    options: Reading, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_reading("reading.toml", options)
    assert read_reading("reading.toml") == options
    assert ("degrees" in Path("reading.toml").read_text()) == (options is CHANGED)


def test_a_table_is_found_from_where_the_file_lies_which_is_replaced_only_by_force(tmp_path: Path) -> None:
    file = tmp_path / "below" / "reading.toml"
    file.parent.mkdir()
    write_reading(file, Reading(table=tmp_path / "poses.csv"))
    assert 'table = "../poses.csv"' in file.read_text()
    found = read_reading(file).table
    assert found is not None
    assert found.resolve() == (tmp_path / "poses.csv").resolve()
    write_reading(tmp_path / "a.toml", CHANGED)
    with pytest.raises(InputError, match="exists already"):
        write_reading(tmp_path / "a.toml", CHANGED)
    write_reading(tmp_path / "a.toml", Reading(), force=True)
    assert read_reading(tmp_path / "a.toml") == Reading()


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("[reading]\nturn_scael = -1\n", r"found the key 'turn_scael', did you mean turn_scale\?"),
        ('[reading]\nturn_scale = "x"\n', r"turn_scale: found 'x', expected a number from -1e\+09 to"),
        ("[reading]\nturn_scale = 0\n", "turn_scale: found 0, expected a number other than 0"),
        ('[reading]\ncamera = ""\n', "camera: found an empty text"),
        ("[reading]\ncamera = 3\n", "camera: found 3, expected a text"),
        ('[reading]\ntime_unit = "days"\n', "time_unit: found 'days', expected one of s, ms, us, ns"),
        ('[reading]\nodometry_are = "odd"\n', "odometry_are: found 'odd', expected one of poses, steps"),
        ("[reading]\ntable = 3\n", "table: found 3, expected a text"),
        ("[reading]\nkeep_going = 1\n", "keep_going: found 1, expected true or false"),
        ("reading = 3\n", "reading: found 3, expected a table"),
        ("turn_scale = -1\n", r"found turn_scale, expected one table \[reading\]"),
        ("", r"found nothing, expected one table \[reading\]"),
        ("[reading", "cannot be read as TOML"),
    ],
)
def test_a_bad_file_is_named_in_one_line(text: str, found: str, tmp_path: Path) -> None:
    file = tmp_path / "reading.toml"
    with pytest.raises(InputError, match="no such file"):
        read_reading(file)
    file.write_text(text)
    with pytest.raises(InputError, match=found) as error:
        read_reading(file)
    assert str(error.value).startswith(f"{file}: ")
    assert "\n" not in str(error.value)


def test_the_documentation_lists_every_option_and_corrections_are_a_group() -> None:
    text = (Path(__file__).parents[2] / "docs" / "formats.md").read_text(encoding="utf-8")
    for name, meaning in FIELDS.items():
        typed = "--keep-going" if name == "keep_going" else name.replace("_rad", "_deg")
        assert f"| `{name}` | `{typed}` |" in text
        assert f"| {meaning.text}" in text
    assert all(meaning.text.endswith((".", "]")) for meaning in FIELDS.values())
    assert len(CORRECTIONS) == 14


DRIFT = {"bias_rad_per_m": 0.1, "sd_rad_per_m": 0.2}
MOTION = {"model": "maurice", "straight_bias_m": -1e-05, "drift": {"": DRIFT, 'old "oak".\x7f': DRIFT}}


def test_a_motion_that_is_written_reads_back(tmp_path: Path) -> None:
    file = tmp_path / "m.toml"
    file.write_text(motion_to_toml(MOTION, ("two\nlines",)), encoding="utf-8")
    assert read_motion(file) == MOTION
    assert file.read_text().startswith("# two lines\n[robot.motion]\n")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "found nothing, expected a table"),
        ("robot = 3\n", "found robot, expected a table"),
        ("[robot]\nname = 'x'\n", "expected a table"),
        ("[robot.motion]\n", "expected a table"),
        ("turn_gain = 0.7\n", "found turn_gain, expected a table"),
        ("[robot", "cannot be read as TOML"),
    ],
)
def test_other_files_hold_no_motion(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "m.toml"
    with pytest.raises(InputError, match="no such file"):
        read_motion(file)
    file.write_text(text)
    with pytest.raises(InputError, match=said):
        read_motion(file)
