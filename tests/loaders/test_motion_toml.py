from pathlib import Path

import pytest

from maurice_loaders.config_files import motion_to_toml, read_motion
from maurice_loaders.errors import InputError

MOTION = {
    "model": "maurice",
    "turn_gain": 0.73,
    "straight_bias_m": -1e-05,
    "drift": {
        "": {"bias_rad_per_m": 0.1, "sd_rad_per_m": 0.2},
        'old "oak".\x7f': {"bias_rad_per_m": -0.1, "sd_rad_per_m": 0.0},
    },
}


def test_what_is_written_reads_back(tmp_path: Path) -> None:
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
def test_other_files_are_refused(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "m.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=said):
        read_motion(file)


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_motion(tmp_path / "none.toml")
