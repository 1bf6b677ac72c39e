from pathlib import Path

import numpy as np
import pytest

from maurice_loaders.calibration import read_trials, write_trials
from maurice_loaders.errors import InputError
from maurice_mcl.calibration.motion import Straights, Trials, Turns

GOOD = """kind,measured,actual,heading_error_deg,floor
turn,137,100,,
straight,10,9.5,3,carpet
straight,20,19,,
"""


def written(folder: Path, text: str) -> Path:
    file = folder / "trials.csv"
    file.write_text(text, encoding="utf-8")
    return file


def test_turns_are_degrees_and_lengths_are_in_the_unit_that_was_named(tmp_path: Path) -> None:
    trials = read_trials(written(tmp_path, GOOD), "in")
    assert np.degrees(trials.turns.measured_rad) == pytest.approx([137])
    assert np.degrees(trials.turns.actual_rad) == pytest.approx([100])
    assert trials.straights.measured_m == pytest.approx([0.254, 0.508])
    assert trials.straights.floors == ("carpet", "")
    assert np.degrees(trials.straights.drift_rad[0]) == pytest.approx(3)
    assert np.isnan(trials.straights.drift_rad[1])


def test_three_columns_are_enough(tmp_path: Path) -> None:
    trials = read_trials(written(tmp_path, "actual,kind,measured\n1,turn,2\n"))
    assert np.degrees(trials.turns.measured_rad) == pytest.approx([2])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "found columns none"),
        ("kind,measured,actual\n", "found no rows"),
        ("kind,measured,actual,speed\nturn,1,1,1\n", "found columns kind, measured, actual, speed"),
        ("kind,measured\nturn,1\n", "expected kind, measured, actual"),
        ("kind,measured,actual,actual\nturn,1,1,1\n", "each once"),
        ("kind,measured,actual\nspin,1,1\n", ":2: found kind 'spin'"),
        ("kind,measured,actual\nturn,1,nan\n", ":2: found 'nan' in column 'actual'"),
        ("kind,measured,actual\nturn,,1\n", "found '' in column 'measured'"),
        ("kind,measured,actual\nturn,1e300,1\n", "expected a number up to 1e9"),
        ("kind,measured,actual\nturn,0,1\n", "found measured 0"),
        ("kind,measured,actual\nturn,1,1,1\n", "more values than the 3 columns"),
        ("kind;measured;actual\nturn;1;1\n", "found columns kind;measured;actual"),
    ],
)
def test_bad_tables_name_the_row_and_the_column(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError, match=said.replace("?", r"\?")):
        read_trials(written(tmp_path, text))


def test_missing_and_binary_files(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_trials(tmp_path / "none.csv")
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="cannot be read"):
        read_trials(tmp_path / "b.csv")
    with pytest.raises(ValueError, match="expected one of m, cm, mm, in"):
        read_trials(tmp_path / "b.csv", "feet")


def test_what_is_written_reads_back_and_is_not_overwritten(tmp_path: Path) -> None:
    file = tmp_path / "out.csv"
    straights = Straights(np.array([1.0, 2]), np.array([0.9, 1.9]), np.array([0.1, np.nan]), ("a,b", ""))
    trials = Trials(Turns(np.array([1.0]), np.array([0.7])), straights)
    write_trials(file, trials)
    again = read_trials(file)
    assert again.turns.actual_rad == pytest.approx(trials.turns.actual_rad, abs=1e-5)
    assert again.straights.actual_m == pytest.approx(straights.actual_m)
    assert again.straights.drift_rad == pytest.approx(straights.drift_rad, abs=1e-5, nan_ok=True)
    assert again.straights.floors == straights.floors
    with pytest.raises(InputError, match="--force"):
        write_trials(file, trials)
    write_trials(file, trials, force=True)
    assert [f.name for f in tmp_path.iterdir()] == ["out.csv"]
    with pytest.raises(InputError, match="found a folder"):
        write_trials(tmp_path, trials, force=True)
