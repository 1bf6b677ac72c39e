"""KITTI odometry: `sequences/NN` with `times.txt` and `image_K/`, poses in `poses/NN.txt`, and poses alone.

Format: https://www.cvlibs.net/datasets/kitti/eval_odometry.php. A row is a 3 x 4 matrix of the left camera in
the frame of its first picture (x right, y down, z forward); here x is forward, y left: z, -x.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import count, takewhile, zip_longest
from pathlib import Path

import numpy as np

from maurice_mcl.values import F64, Camera, SessionInfo

from ..errors import InputError, ReadingNotes
from ..files.text import MOST_T_S, show
from ..reading.options import Reading
from ..reading.recording import Picture, Record, TruthPose, camera_named
from ..reading.time_alignment import clock_s
from ._poses import first_file, read_picture
from ._tables import Row, begin_lines, number_of, rows, words_of
from .registry import Format

CAMERAS = ("image_2", "image_0", "image_3", "image_1")  # color before gray, left before right
RAW = tuple(name.replace("_", "_0") for name in CAMERAS)  # as raw drives have them, pictures in `data`
SIDES = ("image_l", "image_r")  # as extracts of a sequence have them, with poses.txt beside
TIMES = ("times.txt", "timestamps.txt")
WIDTHS = (6, 10)  # digits of a picture's name, in sequences and in raw drives
PERIOD_S = 0.1  # of poses without times: KITTI's cameras take ten pictures a second
NUMBERS = 12
ENDINGS = (".png", ".jpg", ".jpeg")


@dataclass(frozen=True, eq=False)
class KittiRecording:
    """A sequence, or poses alone; truth without odometry."""

    path: Path
    info: SessionInfo
    times: Path | None
    pictures: Path | None  # the camera's folder
    poses: Path | None
    truth_offset_s: float = 0.0

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Read times, pictures and poses row by row."""
        if self.times is None:
            notes.warning(f"found no {TIMES[0]}: {1 / PERIOD_S:g} pictures or poses a second are taken")
        if self.poses is None:
            notes.warning("found no poses, so the truth is unknown")
        if not self.truth_offset_s:
            yield from self._merged(notes)
            return
        truth = (record for record in self._merged(notes) if isinstance(record, TruthPose))
        others = (record for record in self._merged(ReadingNotes(True)) if not isinstance(record, TruthPose))
        shifted = (TruthPose(record.t_s + self.truth_offset_s, record.pose) for record in truth)
        yield from heapq.merge(shifted, others, key=lambda record: record.t_s)

    def _merged(self, notes: ReadingNotes) -> Iterator[Record]:
        pictures = takewhile(lambda number: self._file(number).is_file(), count() if self.pictures else ())
        times = rows(self.times) if self.times else (Row(number, "") for number in pictures)
        poses = iter(()) if self.poses is None else rows(self.poses)
        number, posed = -1, 0
        for number, (time, pose) in enumerate(zip_longest(times, poses)):
            try:
                if self.times is not None and time is None:
                    fault = f"found more poses than the {number} times of {self.times}"
                    raise InputError(self._posed(), fault, pose.number if pose else None)
                t_s = self._time(time) if time is not None and self.times else number * PERIOD_S
                truth = None if pose is None else planar_pose(self._posed(), pose)
            except InputError as problem:
                notes.problem(problem)
                continue
            if truth is not None:
                posed += 1
                yield TruthPose(t_s, truth)
            if self.pictures is not None:
                yield self._picture(number, t_s)
        if self.times is not None and self.pictures is not None and self._file(number + 1).is_file():
            notes.warning(f"{self.times}: {number + 1} times, and more pictures; those are left out")
        if self.poses is not None and posed <= number:
            notes.warning(f"{self.poses}: {posed} poses for {number + 1} times")

    def _posed(self) -> Path:
        return self.poses or self.path

    def _time(self, row: Row) -> float:
        file = self.times or self.path
        try:
            return clock_s(row.text)
        except ValueError:
            return number_of(file, row, row.text, "time", MOST_T_S)

    def _file(self, number: int) -> Path:
        folder = self.pictures or self.path
        names = [f"{number:0{width}d}{end}" for width in WIDTHS for end in ENDINGS]
        return next((folder / name for name in names if (folder / name).is_file()), folder / names[0])

    def _picture(self, number: int, t_s: float) -> Picture:
        file = self._file(number)
        name = file.relative_to(self.path).as_posix()
        return Picture(t_s, partial(read_picture, file.parent, file.name), name)


def planar_pose(file: Path, row: Row) -> F64:
    """Return the pose (3,) of a row of twelve numbers. Raises InputError for anything else."""
    words = words_of(row.text)
    if len(words) != NUMBERS:
        fault = f"found {len(words)} values ({show(row.text)}), expected {NUMBERS}"
        raise InputError(file, fault, row.number)
    matrix = np.array([number_of(file, row, word, "value") for word in words]).reshape(3, 4)
    if not np.allclose(np.linalg.norm(matrix[:, :3], axis=0), 1, atol=0.1):
        raise InputError(file, f"found {show(row.text)}, expected a rotation and a place", row.number)
    return np.array([matrix[2, 3], -matrix[0, 3], math.atan2(-matrix[0, 2], matrix[2, 2])])


def open_sequence(path: Path, options: Reading) -> KittiRecording:
    """Open a sequence; `options.camera` is image_0 to image_3. Raises InputError if there are no pictures."""
    folders = [path / name for name in (*CAMERAS, *RAW, *SIDES) if (path / name).is_dir()]
    if not folders:
        raise InputError(
            path, "found none of image_0 to image_3 and image_l, expected a KITTI odometry sequence"
        )
    folder = path / str(camera_named(path, [folder.name for folder in folders], options.camera))
    name = path.resolve().name
    places = (
        *poses_beside(path),
        *(path / place for place in (f"poses/{name}.txt", "poses.txt", f"{name}.txt")),
    )
    poses = options.table or next((file for file in places if file.is_file()), None)
    times = first_file(path, TIMES) or first_file(folder, TIMES)
    info = SessionInfo(f"KITTI {name}", cameras=(Camera(folder.name),))
    pictures = folder / "data" if (folder / "data").is_dir() else folder
    return KittiRecording(path, info, times, pictures, poses, options.truth_offset_s)


def poses_beside(path: Path) -> list[Path]:
    """Return a sequence's poses where KITTI has them, none where they are not there."""
    whole = path.resolve()
    file = whole.parent.parent / "poses" / f"{whole.name}.txt"
    return [file] if file.is_file() else []


def open_poses(path: Path, options: Reading) -> KittiRecording:
    """Open poses alone; the times of `times.txt` beside them, if any. InputError for a bad row."""
    first = next(rows(path), None)
    if first is None:
        raise InputError(path, "found no poses, expected twelve numbers a line")
    planar_pose(path, first)
    times = next(iter(times_beside(path)), None)
    return KittiRecording(path, SessionInfo(path.stem), times, None, path)


def times_beside(path: Path) -> list[Path]:
    """Return the times of poses alone, beside them or in their sequence, whichever are there."""
    sequence = path.parent.resolve().parent / "sequences" / path.stem / "times.txt"
    return [file for file in (path.parent / "times.txt", sequence) if file.is_file()]


def looks_like_sequence(path: Path) -> bool:
    """Recognize a sequence by the folders of its cameras."""
    if any((path / name).is_dir() for name in (*CAMERAS, *RAW)):
        return True
    extract = any((path / name).is_dir() for name in SIDES)
    return extract and (path / "poses.txt").is_file() and not any(path.glob("*.[ct]sv"))  # a table says more


def looks_like_poses(path: Path) -> bool:
    """Recognize poses alone by twelve numbers in each of the first rows."""
    rows_of_words = [words_of(line) for line in begin_lines(path)[:5] if line.strip()]
    try:
        return bool(rows_of_words) and all(
            len(words) == NUMBERS and [float(w) for w in words] for words in rows_of_words
        )
    except ValueError:
        return False


FORMATS = (
    Format(
        "kitti",
        "a KITTI odometry sequence: image_0 to 3, times.txt",
        looks_like_sequence,
        open_sequence,
        shifts=True,
        beside=poses_beside,
    ),
    Format(
        "kitti-poses", "poses alone: twelve numbers a line", looks_like_poses, open_poses, beside=times_beside
    ),
)
