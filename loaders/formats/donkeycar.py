"""Donkeycar tubs, version 2: `manifest.json`, `catalog_*.catalog` (a JSON object a line), `images/`.

Layout: https://docs.donkeycar.com/utility/donkey/#data-format. Tubs hold commands, not odometry.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np

from maurice_mcl.values import Camera, SessionInfo

from ..errors import InputError, ReadingNotes
from ..files.text import MOST_T_S, items, mapping, number, read_json, text, whole
from ..reading.options import Reading
from ..reading.recording import Picture, Record, camera_named
from ._poses import read_picture
from ._tables import Row, begin_lines, rows
from .registry import Format

MANIFEST = "manifest.json"
PICTURES = "image_array"  # the type of a column of camera pictures
TIME = "_timestamp_ms"
LOOKED_AT = 200  # pictures from which it is seen whether their times are of use
SHORTEST_S = 0.01  # between pictures in the median; a car's loop runs at 20 Hz, and none at over 100
USUAL_HZ = 20.0  # Donkeycar's DRIVE_LOOP_HZ unless changed


@dataclass(frozen=True, slots=True, eq=False)
class TubRecording:
    """The pictures of a tub in the order of its catalogs, without the deleted ones."""

    path: Path
    info: SessionInfo
    camera: str  # the column of the pictures' names
    catalogs: tuple[Path, ...]
    deleted: frozenset[int]

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield the pictures. Times that are too close together to be true are replaced, with a note."""
        notes.warning("a tub holds commands (angle, throttle) and no odometry: no motion is read")
        first = islice(self._rows(ReadingNotes(keep_going=True)), LOOKED_AT)
        step_s = float(np.median(np.diff([t_s for _, _, t_s, _ in first] or [0.0, 1.0])))
        useless = step_s < SHORTEST_S
        if useless:
            fault = f"times {1000 * step_s:.0f} ms apart, which no camera's are"
            notes.warning(f"found {fault}; {USUAL_HZ:g} pictures per second are assumed")
        last_t_s = -np.inf
        for count, (file, row, t_s, name) in enumerate(self._rows(notes)):
            t_s = count / USUAL_HZ if useless else t_s
            if t_s < last_t_s:
                fault = f"found t {t_s:.15g} after t {last_t_s:.15g}, expected time not to fall"
                notes.problem(InputError(file, fault, row.number))
                continue
            last_t_s = t_s
            yield Picture(t_s, partial(read_picture, self.path / "images", name), f"images/{name}")

    def _rows(self, notes: ReadingNotes) -> Iterator[tuple[Path, Row, float, str]]:
        for file in self.catalogs:
            for row in rows(file):
                try:
                    fields = mapping(read_json(row.text), "a record")
                    if whole(fields.get("_index"), "_index") not in self.deleted:
                        t_s = number(fields.get(TIME), TIME, 1000 * MOST_T_S) / 1000
                        yield file, row, t_s, text(fields.get(self.camera), self.camera)
                except ValueError as problem:
                    notes.problem(InputError(file, f"{problem}; was the tub cut?", row.number))


def open_donkeycar(path: Path, options: Reading) -> TubRecording:
    """Open a tub; `options.camera` chooses among its cameras. Raises InputError if it is none."""
    file = path / MANIFEST
    try:
        lines = [read_json(row.text) for row in rows(file)]
        names, types = (items(line, "the columns") for line in (lines[0], lines[1]))
        last = mapping(lines[-1], "the catalogs")
        catalogs = [text(name, "paths") for name in items(last.get("paths"), "paths")]
        deleted = [
            whole(index, "deleted_indexes") for index in items(last.get("deleted_indexes", []), "deleted")
        ]
    except (ValueError, IndexError) as problem:
        reason = f"is no manifest of a tub of version 2 ({problem}), expected columns, types and catalogs"
        raise InputError(file, reason) from None
    cameras = [name for name, kind in zip(names, types, strict=False) if kind == PICTURES]
    camera = camera_named(file, list(map(str, cameras)), options.camera)
    if camera is None or not catalogs:
        counts = f"found {len(cameras)} cameras and {len(catalogs)} catalogs"
        raise InputError(file, f"{counts}, expected at least one of each")
    info = SessionInfo(path.resolve().name, cameras=(Camera(camera),))
    files = tuple(path / name for name in catalogs)
    return TubRecording(path, info, camera, files, frozenset(deleted))


def looks_like_tub(path: Path) -> bool:
    """Recognize a tub by its manifest, whose first line is a list of columns, with a catalog beside it."""
    try:
        first = next(iter(begin_lines(path / MANIFEST)), "") if path.is_dir() else ""
        return first.lstrip().startswith("[") and any(path.glob("*.catalog"))
    except OSError:
        return False


FORMATS = (
    Format(
        "donkeycar",
        "a Donkeycar tub: manifest.json, catalogs, images",
        looks_like_tub,
        open_donkeycar,
        beside=lambda path: [path / MANIFEST],  # which a saved run's hash of a folder leaves out
    ),
)
