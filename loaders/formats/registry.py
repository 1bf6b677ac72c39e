"""The formats that can be read, by name, and detecting one from a file's content before its name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from shlex import quote
from typing import Any

from maurice_mcl.values import expected_one_of

from ..errors import InputError
from ..files.text import expect_regular
from ..reading.options import ReadingOptions
from ..reading.plane import TURNED
from ..reading.recording import Recording
from ..reading.session import RecordedSession
from ..reading.transforms import corrected, odometry_from_truth, with_frames

MODULES = (  # in the order in which they are asked whether a file looks like theirs; each has `FORMATS`
    "..session_log.reader",
    "..bags.recording",
    ".tum",
    ".openloris",
    ".euroc",
    ".kitti",
    ".posed_pictures",
    ".carmen",
    ".cmucam",
    ".donkeycar",
    ".video",
    ".picture_folder",
)


def nothing_beside(path: Path) -> Sequence[Path]:
    """Return no files: nearly all recordings are in one place."""
    return ()


Opening = Callable[[Path, ReadingOptions], Recording]  # InputError for what cannot be read


@dataclass(frozen=True, slots=True)
class Format:
    """A format that can be read."""

    name: str  # as `--reading format=` takes it
    what: str  # one line
    looks_like: Callable[[Path], bool]  # by content before name; quick, never raises
    open: Opening
    open_unchecked: Opening | None = None  # for the doctor: also what breaks the format's rules
    extra: str | None = None  # the extra that has to be installed for it
    module: str | None = None  # that the extra installs
    shifts: bool = False  # whether it adds the offsets of odometry and truth itself
    in_space: bool = False  # whether it holds poses in space, whose plane `plane` says
    takes_unit: bool = False  # whether `time_unit` says in which unit its times are
    readings: bool = False  # whether it may hold readings, and so frames without pictures
    ours: bool = False  # whether it is our own, so that opening needs no remark
    bare: bool = False  # whether it holds pictures alone, which a table may go beside
    beside: Callable[[Path], Sequence[Path]] = nothing_beside  # files outside the path that are read too

    @property
    def installed(self) -> bool:
        """Whether it can be read here."""
        return self.module is None or find_spec(self.module) is not None

    @property
    def remarks(self) -> tuple[str, ...]:
        """What to say of it when a recording is opened."""
        return () if self.ours else (f"read as {self.name}, {self.what}",)


def pose_format(name: str, what: str, looks_like: Callable[[Path], bool], opening: Opening) -> Format:
    """Return a format of poses in space, in files of which each has its own clock."""
    return Format(name, what, looks_like, opening, shifts=True, in_space=True, takes_unit=True)


@cache
def formats() -> dict[str, Format]:
    """Return all formats by name, in the order in which they are asked."""
    return {form.name: form for form in _in_order()}


def _in_order() -> Iterator[Format]:
    """Yield the formats; the module of one is imported only when those before it did not do."""
    package = __name__.rpartition(".")[0]
    for module in MODULES:
        yield from import_module(module, package).FORMATS


def guess(path: Path) -> Format:
    """Return the format of a file or folder. InputError naming what was found, and the formats there are."""
    form = _guess(path)
    if form is None:
        found, names = describe(path), ", ".join(formats())
        raise InputError(path, f"found {found}, expected one of {names}; see --reading format=...")
    return form


def _guess(path: Path) -> Format | None:
    _expect_there(path)
    return next((form for form in _in_order() if form.looks_like(path)), None)


def open_recording(
    path: Path, options: ReadingOptions | None = None, *, unchecked: bool = False
) -> Recording:
    """Open any recording as a stream of records; with `unchecked`, as the doctor looks at it."""
    options = options or ReadingOptions()
    form = chosen(path, options)
    opening = form.open_unchecked if unchecked and form.open_unchecked else form.open
    if options.plane in TURNED and not form.in_space:
        fault = f"found --reading plane={options.plane}, which is for poses in space"
        raise InputError(path, f"{fault}, and the format {form.name} holds poses in x-y; leave it out")
    rest = replace(options, odometry_offset_s=0.0, truth_offset_s=0.0) if form.shifts else options
    recording = corrected(opening(path, options), rest)
    if options.odometry_from_pictures:
        if options.odometry_from_truth:
            both = "found odometry_from_truth and odometry_from_pictures"
            raise InputError(path, f"{both}, expected one of them; leave one out")
        from ..reading.picture_odometry import odometry_from_pictures

        return odometry_from_pictures(recording, options)
    if not options.odometry_from_truth:
        return recording
    return odometry_from_truth(recording, options.odometry_seed)


def open_session(path: str | Path, reading: ReadingOptions | None = None, **changes: Any) -> RecordedSession:
    """Open a recording of any format as a session, whose `moments()` are what a robot saw and did.

    Keyword arguments are fields of `ReadingOptions`, over those of `reading`. Only the header is read; every
    moment holds a picture (H, W, 3) uint8 RGB, motions (M, 3) in meters and radians, and the true pose (3,)
    or None. Raises InputError for an unknown format, and where reading goes wrong.

        >>> from maurice_loaders import open_session
        >>> session = open_session("session.log", turn_scale=-1.0, keep_going=True)
        >>> [moment.frame.image.shape for moment in session.moments()]
        [(4, 6, 3), (4, 6, 3)]
    """
    path, options = Path(path), replace(reading or ReadingOptions(), **changes)
    recording = open_recording(path, options)
    return RecordedSession(with_frames(recording) if chosen(path, options).readings else recording, options)


def chosen(path: Path, options: ReadingOptions) -> Format:
    """Return the format that was named, or the guess. Raises InputError for a name that is none."""
    if options.format is None:
        if not (options.table or options.columns):
            return guess(path)
        form = _guess(path)  # a table whose columns have other names looks like nothing
        return formats()["table"] if form is None or form.bare else form
    form = next((form for form in _in_order() if form.name == options.format), None)
    if form is None:
        expected = expected_one_of(options.format, formats())
        raise InputError(path, f"there is no format {options.format!r}; {expected}")
    _expect_there(path)
    return form


def _expect_there(path: Path) -> None:
    if not path.exists():
        raise InputError(path, "found no such file or folder, expected a recording; check the path")
    if path.is_file() and not path.stat().st_size:
        raise InputError(path, "found an empty file, expected a recording; was anything written to it?")
    expect_regular(path, "a recording")


def _known(path: Path) -> Format | None:
    try:
        return _guess(path)
    except InputError:
        return None


# The description of a path that is no recording: what it is, and what was probably meant.

DEPTH = 2  # folders below that are looked into, as KITTI's sequences need
MOST_LOOKED_AT = 200  # files and folders of a level
MOST_NAMED = 3
MOST_LISTED = 4
ARCHIVES = {  # by their first bytes
    b"PK\x03\x04": ("a ZIP archive", "unzip {}"),
    b"\x1f\x8b": ("a file packed by gzip", "gunzip {}"),
    b"BZh": ("a file packed by bzip2", "bunzip2 {}"),
    b"\xfd7zXZ": ("a file packed by xz", "unxz {}"),
    b"\x28\xb5\x2f\xfd": ("a file packed by zstd", "zstd -d {}"),
    b"7z\xbc\xaf\x27\x1c": ("a 7z archive", "7z x {}"),
    b"Rar!": ("a RAR archive", "unrar x {}"),
}
TAR_NAMES = (".tgz", ".tbz2", ".txz", ".tar.gz", ".tar.bz2", ".tar.xz", ".tar.zst")


def describe(path: Path) -> str:
    """Return what a path is. Pictures alone are not meant where a folder holds other formats."""
    if not path.is_dir():
        return _describe_file(path)
    names = sorted((entry.name for entry in path.iterdir()), key=lambda name: (name.startswith("."), name))
    if not names:
        return "an empty folder"
    below = _below(path)
    meant = [inside for inside, form in below.items() if not form.bare]
    hint = _did_you_mean(meant) or table_hint(path) or _did_you_mean(list(below))
    return f"a folder with {', '.join(names[:MOST_LISTED])}{hint}"


def _describe_file(path: Path) -> str:
    with path.open("rb") as file:
        begin = file.read(512)
    for magic, (what, command) in ARCHIVES.items():
        if begin.startswith(magic):
            command = "tar xf {}" if path.name.lower().endswith(TAR_NAMES) else command
            return f"{what} (unpack it: `{command.format(quote(path.name))}`)"
    if begin[257:262] == b"ustar":
        return f"a tar archive (unpack it: `tar xf {quote(path.name)}`)"
    if begin.startswith(b"RRF"):
        return "a Rerun recording, which `maurice-replay open` shows"
    return f"a file that begins with {begin[:16]!r}{table_hint(path)}" if begin else "an empty file"


def _below(path: Path) -> dict[Path, Format]:
    level = [path]
    for _ in range(DEPTH):
        inside = sorted(islice((entry for folder in level for entry in _entries(folder)), MOST_LOOKED_AT))
        if forms := {entry: form for entry in inside if (form := _known(entry)) is not None}:
            return forms
        level = [entry for entry in inside if entry.is_dir()]
    return {}


def _entries(folder: Path) -> Iterator[Path]:
    try:
        yield from (entry for entry in folder.iterdir() if not entry.name.startswith("."))
    except OSError:
        return


def _did_you_mean(paths: Sequence[Path]) -> str:
    if not paths:
        return ""
    named = ", ".join(map(str, paths[:MOST_NAMED])) + (", ..." if len(paths) > MOST_NAMED else "")
    return f" (did you mean {named}?)" if len(paths) == 1 else f" (did you mean one of {named}?)"


def table_hint(path: Path) -> str:
    """Return a hint at `columns` for a table with column names of its own; "" without a table."""
    tables = sorted(path.glob("*.[ct]sv")) if path.is_dir() else [path]
    if not tables or tables[0].suffix.lower() not in (".csv", ".tsv"):
        return ""
    return f" (if {tables[0].name} is a table, say what its columns are with --reading columns=...)"
