"""`map build`: a laser's map from a recording with scans and true poses."""

from __future__ import annotations

import numpy as np
import pytest

import maurice_viz as mv
from helpers.commands import failure, maurice, run
from maurice_loaders import InputError, SessionWriter
from maurice_loaders.files.maps import read_occupancy
from maurice_mcl.values.laser import FREE, OCCUPIED, UNKNOWN, LaserScan
from maurice_mcl.values.session import SessionInfo
from maurice_viz.errors import OptionError

ROUND_M = 1.98  # reach of the laser in every direction


@pytest.fixture
def drive(tmp_path):
    """A drive of 10 m along +x, with a round wall about the robot wherever it is."""
    scan = LaserScan(np.full(720, ROUND_M, np.float32), 0.0, np.radians(0.5), 0.1, 8.0)
    with SessionWriter(tmp_path / "drive.log", SessionInfo("drive")) as log:
        for number in range(11):
            log.odometry_pose(number, (number, 0.0, 0.0))
            log.truth(number, (number + 5.0, 1.0, 0.0))
            log.scan(number, scan)
    return tmp_path / "drive.log"


def test_the_map_is_where_the_true_poses_are_and_reads_back_the_same(drive, tmp_path):
    built = mv.build_map(drive, tmp_path / "deep" / "map")
    assert (built.scans, built.of_scans) == (11, 11)
    again = read_occupancy(built.file)
    np.testing.assert_array_equal(again.cells, built.occupancy.cells)
    np.testing.assert_allclose(built.occupancy.bounds, (3, -1, 17, 3), atol=0.1)
    points = np.array([[5.5, 1.0], [10.5, 1.5], [3.03, 1.0], [16.97, 1.0], [3.1, 2.9]])
    assert again.states_at(points).tolist() == [FREE, FREE, OCCUPIED, OCCUPIED, UNKNOWN]


def test_a_share_of_the_scans_is_the_first_ones(drive, tmp_path):
    built = mv.build_map(drive, tmp_path / "half.yaml", until=0.5)
    assert built.file == tmp_path / "half.yaml"
    assert (built.scans, built.of_scans) == (6, 11)  # of 11 scans 5.5
    np.testing.assert_allclose(built.occupancy.bounds, (3, -1, 12, 3), atol=0.1)


def test_larger_cells_make_a_map_of_fewer(drive, tmp_path):
    fine, coarse = (mv.build_map(drive, tmp_path / str(m), cell_m=m).occupancy for m in (0.05, 0.2))
    assert coarse.cell_m == 0.2
    assert coarse.cells.size < fine.cells.size / 14
    assert read_occupancy(tmp_path / "0.2" / "map.yaml").cell_m == 0.2
    np.testing.assert_allclose(coarse.bounds, fine.bounds, atol=0.4)
    assert coarse.states_at(np.array([[5.5, 1.0], [3.03, 1.0]])).tolist() == [FREE, OCCUPIED]


def test_a_map_that_is_too_large_leaves_nothing_and_says_which_cells_would_do(tmp_path):
    scan = LaserScan(np.full(720, ROUND_M, np.float32), 0.0, np.radians(0.5), 0.1, 8.0)
    with SessionWriter(tmp_path / "far.log", SessionInfo("far")) as log:
        for number, x_m in enumerate((0.0, 900.0)):
            log.odometry_pose(number, (x_m, x_m, 0.0))
            log.truth(number, (x_m, x_m, 0.0))
            log.scan(number, scan)
    with pytest.raises(InputError, match=r"is a pose wrong\? If not, cells of 0.12 m would do"):
        mv.build_map(tmp_path / "far.log", tmp_path / "map")
    assert not (tmp_path / "map").exists()
    mv.build_map(tmp_path / "far.log", tmp_path / "map", cell_m=0.12)
    with pytest.raises(OptionError, match=r"found 0\.001"):
        mv.build_map(tmp_path / "far.log", tmp_path / "tiny", cell_m=0.001)


def test_the_command_says_what_it_built_and_replaces_nothing(drive):
    assert (
        "MAP/map.yaml: 11 of 11 scans, 14.0 x 4.0 m in cells of 0.05 m"
        in maurice("map", "build", drive, "-o", "MAP")[0]
    )
    assert "map.yaml" in failure("map", "build", drive, "-o", "MAP")
    maurice("map", "build", drive, "-o", "MAP", "--force")
    assert "share" in run("map", "build", drive, "-o", "other", "--until", "50", expect=2).stderr


def test_recordings_without_scans_or_true_poses_are_refused(small_session, tmp_path):
    with pytest.raises(InputError, match="found no scan of a laser"):
        mv.build_map(small_session, tmp_path / "map")
    scan = LaserScan(np.full(8, 1.0, np.float32), 0.0, 0.7, 0.1, 8.0)
    with SessionWriter(tmp_path / "blind.log", SessionInfo("blind")) as log:
        log.odometry_pose(0.0, (0.0, 0.0, 0.0))
        log.scan(0.0, scan)
    with pytest.raises(InputError, match="none with a true pose"):
        mv.build_map(tmp_path / "blind.log", tmp_path / "map")
    assert not (tmp_path / "map").exists()
