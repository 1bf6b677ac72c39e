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
from ..files.paths import (
    A_LIBRARY,
    A_RUN,
    EMPTY,
    PICTURE,
    RERUN,
    RUNS,
    TRIALS,
    UNPACK,
    first_bytes,
    kind_of,
    look_again,
    manifest_of,
)
from ..files.text import expect_regular
from ..reading.options import Reading
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


Opening = Callable[[Path, Reading], Recording]  # InputError for what cannot be read


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
    """Return all formats by name, in the order in which they are tried."""
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
        if kind_of(path) is not None:
            raise unlike(path, RECORDING)
        description, names = describe(path), ", ".join(formats())
        raise InputError(path, f"found {description}, expected one of {names}; see --reading format=...")
    return form


def _guess(path: Path) -> Format | None:
    _expect_there(path)
    return next((form for form in _in_order() if form.looks_like(path)), None)


def open_recording(path: Path, options: Reading | None = None, *, unchecked: bool = False) -> Recording:
    """Open any recording as a stream of records; with `unchecked`, as the doctor looks at it."""
    options = options or Reading()
    form = chosen(path, options)
    opening = form.open_unchecked if unchecked and form.open_unchecked else form.open
    if options.plane in TURNED and not form.in_space:
        fault = f"found --reading plane={options.plane}, which is for poses in space"
        raise InputError(path, f"{fault}, and the format {form.name} holds poses in x-y; leave it out")
    rest = replace(options, odometry_offset_s=0.0, truth_offset_s=0.0) if form.shifts else options
    recording = corrected(opening(path, options), rest)
    if not options.odometry_from_truth:
        return recording
    return odometry_from_truth(recording, options.odometry_seed)


def open_session(path: str | Path, reading: Reading | None = None, **changes: Any) -> RecordedSession:
    """Open a recording of any format as a session, whose `moments()` are what a robot saw and did.

    Keyword arguments are fields of `Reading`, over those of `reading`. Only the header is read; every
    moment holds a picture (H, W, 3) uint8 RGB, motions (M, 3) in meters and radians, and the true pose (3,)
    or None. Raises InputError for an unknown format, and where reading goes wrong.

        >>> from maurice_loaders import open_session
        >>> session = open_session("session.log", turn_scale=-1.0, keep_going=True)
        >>> [moment.frame.image.shape for moment in session.moments()]
        [(4, 6, 3), (4, 6, 3)]
    """
    path, options = Path(path), replace(reading or Reading(), **changes)
    form = chosen(path, options)
    options = replace(options, format=form.name)  # which is asked for once
    recording = open_recording(path, options)
    return RecordedSession(with_frames(recording) if form.readings else recording, options)


def chosen(path: Path, options: Reading) -> Format:
    """Return the format that was named, or the guess. Raises InputError for an unknown name."""
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
        raise unlike(path, RECORDING)
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


def describe(path: Path) -> str:
    """Return what a path of no kind is. Pictures alone are not meant where a folder has other formats."""
    if not path.is_dir():
        return f"a file that begins with {first_bytes(path)[:16]!r}{table_hint(path)}"
    names = sorted((entry.name for entry in path.iterdir()), key=lambda name: (name.startswith("."), name))
    below = _below(path)
    candidates = [inside for inside, form in below.items() if not form.bare]
    hint = _did_you_mean(candidates) or table_hint(path) or _did_you_mean(list(below))
    return f"a folder with {', '.join(names[:MOST_LISTED])}{hint}"


def unlike(path: Path, wanted: str) -> InputError:
    """Return the error of a path that is not what was wanted: what it is instead, and what to do.

    `wanted` is A_RUN, A_LIBRARY, TRIALS or RECORDING.
    """
    expected = EXPECTED[wanted]
    if not path.exists():
        how = look_again(path, HOW_TO.get(wanted, "check the path"))
        return InputError(path, f"found no such file or folder, expected {expected}; {how}")
    if not (path.is_file() or path.is_dir()):  # reading a pipe might never end
        return InputError(path, f"found no regular file, expected {expected}; save it to a file first")
    kind, form = kind_of(path), _known(path)
    if kind is None and form is not None:
        kind = RECORDING
    what = f"a recording ({form.name})" if kind == RECORDING and form is not None else kind or describe(path)
    how = _instead(path, kind, wanted, bare=form is not None and form.bare) or HOW_TO.get(
        wanted, "is it another file?"
    )
    return InputError(path, f"found {what}, expected {expected}; {how}")


RECORDING = "a recording"
EXPECTED = {
    A_RUN: "a saved run's folder",
    A_LIBRARY: "a library, a survey log or a table of pictures",
    TRIALS: "a folder that `maurice-replay trials run` has made",
    RECORDING: "a robot's recording",
}
HOW_TO = {
    A_RUN: "make one with: maurice-replay SESSION -o none --save-run my-run",
    A_LIBRARY: "build one from a drive with true poses: maurice-replay library build DRIVE -o LIBRARY",
    TRIALS: "make one with: maurice-replay trials run PLAN -o DIR",
}


def _instead(path: Path, kind: str | None, wanted: str, *, bare: bool) -> str:
    """Return what to do with a path of one kind where another was wanted; "" where nothing is known."""
    name, manifest = quote(str(path)), manifest_of(path)
    surveys = sorted(path.glob("*/survey.log")) if wanted == A_LIBRARY and path.is_dir() else []
    if surveys:
        return f"did you mean {surveys[0]}?"
    if kind == RECORDING:
        using = " --library LIBRARY" if bare else ""
        commands = {
            A_RUN: f"{name}{using} -o none --save-run my-run",
            A_LIBRARY: f"library build {name} -o my-library",
        }
        if bare and wanted == A_LIBRARY:  # pictures alone have no poses
            return ""
        return f"make one with: maurice-replay {commands[wanted]}" if wanted in commands else ""
    if kind == RERUN:
        look = f"look at it with: maurice-replay {name}"
        return f"it holds drawings, not steps: replay its session with --save-run, or {look}"
    if kind is not None and UNPACK in kind:
        return "then name what was in it"
    if kind in (A_RUN, RUNS) and wanted == RECORDING:
        session = manifest.get("session")
        return f"its session is {session['path']}" if isinstance(session, dict) and "path" in session else ""
    if kind == RUNS and wanted == A_RUN and manifest.get("runs"):
        return f"name one of its runs: {path / str(manifest['runs'][0])}"
    kinds = {
        A_LIBRARY: f"a recording is replayed with it by: maurice-replay SESSION --library {name}",
        TRIALS: f"their figures are printed by: maurice-replay trials table {name}",
        PICTURE: "put the pictures of a drive into a folder, and name that",
        EMPTY: "was anything written to it?" if wanted == RECORDING else "",
    }
    return kinds.get(str(kind), "")


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
