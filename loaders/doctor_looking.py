"""What a session's pictures say, compared with a library: some of them, over the whole drive."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from maurice_mcl.assembly import make_localizer
from maurice_mcl.diagnosis import Drive
from maurice_mcl.diagnosis_pictures import Looks
from maurice_mcl.features import FEATURES
from maurice_mcl.library import Library
from maurice_mcl.localizer import Localizer
from maurice_mcl.parameters import of_feature
from maurice_mcl.session import Moment, SessionInfo
from maurice_mcl.typing import U8

from .doctor_reading import raw_records
from .errors import LogError
from .findings import Findings
from .formats import OpenOptions
from .pictures import PictureError
from .recording import Picture

MOST_PICTURES = 60
BETWEEN_S = 2.0  # pictures that come more often are passed over

Progress = Callable[[int, int], None]


def look(
    path: Path,
    options: OpenOptions,
    library: Library,
    info: SessionInfo,
    drive: Drive,
    factor: float,
    progress: Progress | None = None,
) -> Looks:
    """Compare some pictures with a library, their times multiplied by `factor`.

    LogError for a library without any of the channels wanted.
    """
    localizer = _localizer(path, library, info)
    spacing = float(np.median(np.diff(drive.picture_t_s))) if len(drive.picture_t_s) > 1 else 0.0
    stride = max(1, round(BETWEEN_S / spacing)) if spacing > 0 else 1
    total = min(MOST_PICTURES, -(-len(drive.picture_t_s) // stride))
    times, comparisons = [], []
    for t_s, image in _pictures(path, options, stride):
        times.append(t_s * factor)
        comparisons.append(localizer.sensor.compare(localizer.sensor.measure(image)))
        if progress:
            progress(len(times), total)
        if len(times) >= MOST_PICTURES:
            break
    return Looks(np.array(times), comparisons, localizer)


def _localizer(path: Path, library: Library, info: SessionInfo) -> Localizer:
    wanted = {name: weight for name, weight in FEATURES["blended"].items() if name in library.index}
    if not wanted:
        raise LogError(path, f"the library {library.name!r} holds neither color nor edges; build it again")
    parameters = of_feature("blended" if len(wanted) > 1 else next(iter(wanted)))
    return make_localizer(library, _Named(info), parameters)


def _pictures(path: Path, options: OpenOptions, stride: int) -> Iterator[tuple[float, U8]]:
    """Give time and pixels of every first, second, ... picture; those that cannot be read are left out."""
    records = raw_records(path, options, Findings(keep_going=True))
    pictures = (record for record in records if isinstance(record, Picture))
    for picture in islice(pictures, 0, None, stride):
        with suppress(PictureError):
            yield picture.t_s, picture.read()


@dataclass(frozen=True, slots=True)
class _Named:
    """What a localizer wants to know of a session: its header."""

    info: SessionInfo

    def moments(self) -> Iterator[Moment]:
        """Nothing is replayed here."""
        return iter(())
