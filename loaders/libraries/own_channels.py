"""Libraries with the user's own channels: their pictures are measured when a filter asks for it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from maurice_mcl.sensor.descriptors.registry import CHANNELS, OwnChannel, reduced
from maurice_mcl.values import F32, ChannelIndex, Library, NamedProgress

from ..errors import InputError, PictureError
from ..files.pictures import decode_picture, picture_file
from .measured import known_descriptors


def with_own_channels(
    library: Library, names: Iterable[str], progress: NamedProgress | None = None
) -> Library:
    """Return a library whose pictures are measured by those of the named channels that are the user's.

    InputError where a picture is not kept, is gone or cannot be read.
    """
    own = [name for name in names if isinstance(CHANNELS.get(name), OwnChannel)]
    if not own:
        return library
    rows: dict[str, list[F32]] = {name: [] for name in own}
    known, what = known_descriptors(), f"measuring by {', '.join(own)}"
    for number, path in enumerate(library.pictures, start=1):
        if path is None:
            message = f"the library {library.name!r} keeps no pictures, which {own[0]} has to measure"
            raise InputError(None, f"{message}; build it again from its survey")
        try:
            image = reduced(decode_picture(picture_file(path)))
        except PictureError as problem:
            raise InputError(path, f"{problem}; {own[0]} measures the library's pictures") from None
        remembered = {} if known is None else known.find(image, own)
        measured = {name: CHANNELS[name].describe(image) for name in own if name not in remembered}
        if known is not None and measured:
            known.keep(image, measured)
        for name, descriptor in (remembered | measured).items():
            rows[name].append(descriptor)
        if progress is not None:
            progress(number, library.size, what)
    if known is not None:
        known.flush()
    index = {name: _index(name, descriptors) for name, descriptors in rows.items()}
    return replace(library, index={**library.index, **index})


def _index(name: str, rows: list[F32]) -> ChannelIndex:
    sizes = {len(row) for row in rows}
    if len(sizes) > 1:
        fault = f"found {min(sizes)} and {max(sizes)} numbers, expected as many for each picture"
        raise InputError(None, f"channel {name}: {fault}")
    references = np.array(rows, np.float32)
    return ChannelIndex(references, np.zeros(references.shape[1], np.float32), references.max(axis=0))
