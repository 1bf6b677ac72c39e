"""A folder of pictures alone, in the order of their names."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from maurice_mcl.session import SessionInfo

from .errors import LogError
from .findings import Findings
from .formats import Format, OpenOptions
from .picture_files import PICTURES, pictures_in
from .picture_lists import read_picture
from .picture_table import PERIOD_S, TABLES, TableRecording, open_table
from .recording import Picture, Record


@dataclass(frozen=True, eq=False)
class FolderRecording:
    """Pictures in the order of their names, a second apart."""

    path: Path
    info: SessionInfo

    def records(self, findings: Findings) -> Iterator[Record]:
        """Give the pictures."""
        findings.warning("found pictures without a table: one a second is taken; see --table")
        tables = [one.name for one in self.path.iterdir() if one.suffix.lower() in TABLES]
        if tables:
            why = "no table, or several, with columns of known names in UTF-8 text; see --table and --columns"
            findings.warning(f"{', '.join(sorted(tables))} beside them is not used: {why}")
        for number, file in enumerate(pictures_in(self.path)):
            yield Picture(number * PERIOD_S, partial(read_picture, file, file.name), file.name)


def open_folder(path: Path, options: OpenOptions) -> TableRecording | FolderRecording:
    """Open a folder of pictures, with `options.table` when there is one. LogError where it has none."""
    if options.table is not None:
        return open_table(path, options)
    if not path.is_dir() or not pictures_in(path):
        raise LogError(path, f"found no pictures ({', '.join(PICTURES)}), expected a folder of them")
    return FolderRecording(path, SessionInfo(path.resolve().name))


def looks_like_pictures(path: Path) -> bool:
    """Tell a folder by a picture in it."""
    try:
        return path.is_dir() and any(one.suffix.lower() in PICTURES for one in path.iterdir())
    except OSError:
        return False


FORMATS = (
    Format("pictures", "a folder of pictures, in the order of their names", looks_like_pictures, open_folder),
)
