"""Writing a session log or a survey log, line by line, so that it can be read while it grows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Self

import numpy as np

from maurice_mcl.values import F64, U8, LaserScan, SessionInfo

from ..errors import InputError
from ..files.pictures import PictureKind, encode_picture
from ..files.text import MOST, MOST_T_S, up_to
from ..files.writing import expect_absent
from ..reading.recording import Motion, Note, OdometryPose, Readings, Record, Scan, TruthPose, scan_fault
from .header import FORMAT, KINDS, Kind, header_to_json
from .records import line_of, scan_to_json

Numbers = F64 | Sequence[float]


class LogLines:
    """Records of a session as lines of a log; subclasses say where a line goes. Seconds, meters, radians."""

    def odometry(self, t_s: float, motion: Numbers, encoders_m: Numbers | None = None) -> None:
        """Write a movement (forward_m, left_m, turn_rad) since the last one, as the robot measured it.

        `encoders_m` are the raw advances of the four wheels: front left, front right, rear left, rear right.
        """
        record: dict[str, Any] = {"odometry": _numbers(motion, 3, "odometry")}
        if encoders_m is not None:
            record["encoders_m"] = _numbers(encoders_m, 4, "encoders_m")
        self._record(t_s, record)

    def odometry_pose(self, t_s: float, pose: Numbers) -> None:
        """Write the robot's pose by its odometry: x_m, y_m, heading_rad in a frame of the odometry's own."""
        self._record(t_s, {"odometry_pose": _numbers(pose, 3, "odometry_pose")})

    def scan(self, t_s: float, scan: LaserScan) -> None:
        """Write a scan of a planar laser, its ranges to the last bit."""
        fault = scan_fault(scan)
        if fault:
            raise ValueError(fault)
        self._record(t_s, {"scan": scan_to_json(scan)})

    def truth(self, t_s: float, pose: Numbers) -> None:
        """Write where the robot really was: x_m, y_m, heading_rad."""
        self._record(t_s, {"truth": _numbers(pose, 3, "truth")})

    def reading(self, t_s: float, values: Mapping[str, float]) -> None:
        """Write what sensors other than cameras measured: numbers by name, in whatever unit they have."""
        numbers = _numbers(list(values.values()), len(values), "reading")
        self._record(t_s, {"reading": dict(zip(values, numbers, strict=True))})

    def event(self, t_s: float, text: str) -> None:
        """Write what happened, in free text (`kidnapped`, `floor carpet`, `lights off`)."""
        self._record(t_s, {"event": text})

    def add(self, record: Record) -> None:
        """Write a record that is no picture."""
        if isinstance(record, Motion):
            self.odometry(record.t_s, record.motion, record.encoders_m)
        elif isinstance(record, OdometryPose):
            self.odometry_pose(record.t_s, record.pose)
        elif isinstance(record, TruthPose):
            self.truth(record.t_s, record.pose)
        elif isinstance(record, Note):
            self.event(record.t_s, record.text)
        elif isinstance(record, Readings):
            self.reading(record.t_s, record.values)
        elif isinstance(record, Scan):
            self.scan(record.t_s, record.scan)

    def image(self, t_s: float, image_rgb: U8, *, camera: str | None = None) -> object:
        """Write an RGB picture (H, W, 3)."""
        raise NotImplementedError

    def _record(self, t_s: float, record: dict[str, Any]) -> None:
        raise NotImplementedError


class SessionWriter(LogLines):
    """A session log or survey log being written; every line is flushed complete. Use it as a context manager.

    Times in seconds, meters, radians. Pictures (H, W, 3) uint8 RGB go to `pictures/` beside the log, named
    after the log and a number, never after a pose: as JPEG (quality 95, 4:4:4), or as PNG without loss.
    Raises InputError if the log or a picture exists, unless `force`, and ValueError for values that no log
    may hold (NaN, numbers too large, a time before the last one, a survey's picture without its pose).

        >>> from maurice_loaders import SessionWriter
        >>> from maurice_mcl.values.session import SessionInfo
        >>> with SessionWriter("new.log", SessionInfo(name="new"), force=True) as log:
        ...     log.odometry(0.1, (0.05, 0.0, 0.0))
    """

    def __init__(
        self,
        path: str | Path,
        info: SessionInfo,
        kind: Kind = "session",
        *,
        pictures: PictureKind = "jpeg",
        force: bool = False,
    ) -> None:
        if kind not in KINDS:
            raise ValueError(f"found kind {kind!r}, expected one of {KINDS}")
        path = Path(path)
        self._path, self._kind, self._form, self._force = path, kind, pictures, force
        self._last_t_s = -np.inf
        self._pictures = 0
        header = line_of(header_to_json(info, kind, path.parent))  # before the file is touched
        if force:
            expect_absent(path, force=force, form=FORMAT)
        self._file = _create(path, "found a log already", force)
        self._put(header)

    def image(
        self,
        t_s: float,
        image_rgb: U8,
        *,
        pose: Numbers | None = None,
        covered: bool = False,
        camera: str | None = None,
        name: str | None = None,
    ) -> str:
        """Save an RGB picture (H, W, 3), then write its line; return its relative path.

        `name` is the file's name without folder and ending; by default the log's name and a number.
        """
        record = self._image_record(pose, covered, camera)  # checked before a file is written
        self._pictures += 1
        ending = "jpg" if self._form == "jpeg" else "png"
        relative = f"pictures/{name or f'{self._path.stem}-{self._pictures:05d}'}.{ending}"
        self._check_time(t_s)
        self._save_picture(relative, encode_picture(image_rgb, self._form))
        self._record(t_s, {"image": relative} | record)
        return relative

    def image_path(
        self,
        t_s: float,
        relative_path: str,
        *,
        pose: Numbers | None = None,
        covered: bool = False,
        camera: str | None = None,
    ) -> None:
        """Write the line of a picture that exists already, by its path relative to the log."""
        self._record(t_s, {"image": relative_path} | self._image_record(pose, covered, camera))

    def close(self) -> None:
        """Close the file; closing twice does no harm."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _image_record(self, pose: Numbers | None, covered: bool, camera: str | None) -> dict[str, Any]:
        surveyed = self._kind == "survey" and not covered
        if surveyed != (pose is not None):
            raise ValueError("a pose goes with every picture of a survey that is not covered, and no other")
        record: dict[str, Any] = {} if camera is None else {"camera": camera}
        if covered:
            record["covered"] = True
        if pose is not None:
            record["pose"] = _numbers(pose, 3, "pose")
        return record

    def _save_picture(self, relative: str, data: bytes) -> None:
        file = self._path.parent / relative
        with _create(file, "found a picture already", self._force) as out, _clear_errors(file):
            out.write(data)

    def _check_time(self, t_s: float) -> None:
        if not np.isfinite(t_s) or t_s < self._last_t_s:
            raise ValueError(f"found t {t_s}, expected a finite time not before {self._last_t_s}")
        if abs(t_s) > MOST_T_S:
            raise ValueError(f"found t {t_s}, expected {up_to(MOST_T_S)}")

    def _record(self, t_s: float, record: dict[str, Any]) -> None:
        self._check_time(t_s)
        self._put(line_of({"t": float(t_s)} | record))
        self._last_t_s = float(t_s)

    def _put(self, line: bytes) -> None:
        with _clear_errors(self._path):
            self._file.write(line)
            self._file.flush()


def _create(file: Path, found: str, force: bool) -> BinaryIO:
    with _clear_errors(file):
        if file.parent.exists() and not file.parent.is_dir():
            raise InputError(file.parent, "found a file, expected a folder; write elsewhere")
        file.parent.mkdir(parents=True, exist_ok=True)
        try:
            return file.open("wb" if force else "xb")
        except FileExistsError:
            raise InputError(file, f"{found}; write elsewhere, or overwrite it with --force") from None


@contextmanager
def _clear_errors(file: Path) -> Iterator[None]:
    try:
        yield
    except OSError as problem:
        raise InputError(file, f"cannot be written: {problem.strerror}") from None


def _numbers(values: Numbers, count: int, what: str) -> list[float]:
    numbers = [float(v) for v in values]
    if len(numbers) != count or not np.isfinite(numbers).all():
        raise ValueError(f"found {what} {numbers}, expected {count} finite numbers")
    if np.abs(numbers).max(initial=0.0) > MOST:
        raise ValueError(f"found {what} {numbers}, expected each {up_to()}")
    return numbers
