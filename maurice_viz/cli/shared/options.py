"""Options that several commands share, each described once, and how their values are read."""

from __future__ import annotations

import difflib
import math
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from maurice_loaders.files.text import parse_toml
from maurice_loaders.reading.options import FIELDS, ReadingOptions, option_value, read_reading
from maurice_mcl.config.parameters import PRESETS, RULES
from maurice_mcl.sensor.descriptors.registry import CHANNELS, FEATURES

from ...errors import OptionError
from ...layouts import DETAILS, LAYOUT_NAMES
from .startup import skip_pandas

if TYPE_CHECKING:
    from ...running.output import OutputOptions

KEYS = {name.replace("_rad", "_deg"): name for name in FIELDS}  # of reading, as typed: angles in degrees
FILTER, OUTPUT, LIVE, READING = "Filter", "Output", "Live", "Reading"  # panels of the help
MOST_SEED = 2**32 - 1


def option(names: str, text: str, panel: str | None = None, **more: Any) -> Any:
    """Describe an option: its names with spaces between them, its help, the panel that lists it."""
    return typer.Option(*names.split(), help=text, rich_help_panel=panel, **more)


def argument(metavar: str | None, text: str, **more: Any) -> Any:
    """Describe an argument."""
    return typer.Argument(metavar=metavar, help=text, show_default=False, **more)


def completed(names: Iterable[str], end: str = "") -> Callable[[str], list[str]]:
    """Return what a shell asks for the rest of a value: the names that begin so, each with `end`."""
    choices = [name + end for name in dict.fromkeys(names)]
    return lambda incomplete: [name for name in choices if name.startswith(incomplete)]


def one_of(known: Iterable[str], what: str) -> dict[str, Any]:
    """Return what an option of known names has: a check of its value or values, and their completion."""
    names = list(dict.fromkeys(known))

    def check(typed: Any) -> Any:
        for value in typed if isinstance(typed, list) else [typed]:
            if value is not None and value not in names:
                raise typer.BadParameter(f"no {what} called {value!r}; there are {', '.join(names)}")
        return typed

    return {"callback": check, "autocompletion": completed(names)}


Session = Annotated[
    Path,
    argument(
        "SESSION",
        "A session log, a recording of any format (see `formats`), a saved run's folder, or a live "
        "source: -, tcp://HOST:PORT, ws://HOST:PORT.",
    ),
]
Run = Annotated[Path, argument("RUN", "A saved run's folder, or a comparison's.")]
RunLabel = Annotated[str | None, option("--run-label", "Which run of a comparison.", metavar="LABEL")]
_FEATURE = option(
    "--feature",
    f"Feature to compare: {', '.join(FEATURES)}, or any one channel. [default: blended]",
    FILTER,
    metavar="NAME",
    **one_of([*FEATURES, *CHANNELS], "feature"),
)
_PRESET = option(
    "--preset",
    "A complete filter by name.",
    FILTER,
    metavar="|".join(PRESETS),
    **one_of(PRESETS, "preset"),
)
_CONFIG = option("--config", "A configuration file, applied after the preset.", FILTER, metavar="FILE.toml")
_PARTICLES = option("--particles", "Number of particles. [default: 2000]", FILTER, min=1, max=10_000_000)
_SEED = option(
    "--seed",
    "Seed of all randomness: the same seed gives the same run. [default: 0]",
    FILTER,
    min=0,
    max=MOST_SEED,
    show_default=False,
)
_START = option(
    "--start",
    "Where the particles begin: at the header's start pose, at the first true pose, anywhere, or at a "
    "pose in display units and degrees. [default: tracking where there is a start pose, else global]",
    FILTER,
    metavar="tracking|truth|global|X,Y,HEADING",
    autocompletion=completed(("tracking", "truth", "global")),
)
Feature = Annotated[str | None, _FEATURE]
Features = Annotated[list[str] | None, _FEATURE]
Preset = Annotated[str | None, _PRESET]
Presets = Annotated[list[str] | None, _PRESET]
Config = Annotated[Path | None, _CONFIG]
Configs = Annotated[list[Path] | None, _CONFIG]
Particles = Annotated[int | None, _PARTICLES]
ParticleCounts = Annotated[list[int] | None, _PARTICLES]
Seed = Annotated[int, _SEED]
Seeds = Annotated[list[int] | None, _SEED]
Start = Annotated[str | None, _START]
Starts = Annotated[list[str] | None, _START]
Set = Annotated[
    list[str] | None,
    option(
        "--set",
        "Set any key of the configuration, such as sensor.sharpness=2 or resampling.scheme=residual; "
        "motion=FILE.toml takes motion parameters from a file. Repeatable; `config show` lists the keys.",
        FILTER,
        metavar="KEY=VALUE",
        autocompletion=completed((*RULES, "motion"), "="),
    ),
]
Sensors = Annotated[
    list[str] | None,
    option(
        "--sensor",
        "Also weigh particles by a sensor of another package: its name, or module:Class. Repeatable.",
        FILTER,
        metavar="NAME|MODULE:CLASS",
    ),
]
_LIBRARY = "A library folder, survey log or table of surveyed pictures. [default: the one the header names]"
Library = Annotated[Path | None, option("--library", _LIBRARY, FILTER, metavar="PATH")]
Rrd = Annotated[
    str | None,
    option(
        "-o --output",
        "Write the Rerun recording to this file and open no viewer; auto: name it after what it holds; "
        "none: write no recording. [default: the viewer where there is a display, else auto]",
        OUTPUT,
        metavar="OUT.rrd|auto|none",
        autocompletion=completed(("auto", "none")),
    ),
]
_WEB = "Serve the recording to a browser, also over ssh, until Ctrl-C, instead of writing it."
Web = Annotated[bool, option("--web", _WEB, OUTPUT)]
_SAVE = "Save every step to this new folder, for `explain`, `report`, `verify` and other commands."
SaveRun = Annotated[Path | None, option("--save-run", _SAVE, OUTPUT, metavar="DIR")]
MapFile = Annotated[
    Path | None,
    option("--map", "A ROS map.yaml, or a file of wall segments, x1 y1 x2 y2 per line.", metavar="FILE"),
]
MapUnit = Annotated[
    str,
    option("--map-unit", "Unit of wall segments: mm or m.", **one_of(("mm", "m"), "unit of a map")),
]
Force = Annotated[bool, option("--force", "Overwrite what exists.", OUTPUT)]
Json = Annotated[bool, option("--json", "Print JSON instead of a table.", OUTPUT)]
Layout = Annotated[
    str | None,
    option(
        "--layout",
        f"The layout (the viewer's tab) to begin with: {', '.join(LAYOUT_NAMES)}. [default: story]",
        OUTPUT,
        metavar="NAME",
        **one_of(LAYOUT_NAMES, "layout"),
    ),
]
Detail = Annotated[
    str,
    option(
        "--detail",
        "Draw every panel at every step, every panel only around events, or few panels throughout.",
        OUTPUT,
        metavar="|".join(DETAILS),
        **one_of(DETAILS, "detail"),
    ),
]
_KEEP_GOING = "Skip broken lines and pictures, and report how many at the end."
KeepGoing = Annotated[bool, option("--keep-going", _KEEP_GOING, READING)]
_RECORDED = "For a bag: show the particles of the recorded localizer; no filter runs."
AsRecorded = Annotated[bool, option("--as-recorded", _RECORDED, READING)]
Reading = Annotated[
    list[str] | None,
    option(
        "--reading",
        "How the recording is read: format, camera, topics, columns, clocks, units, frames, which "
        f"pictures. Repeatable. Keys: {', '.join(KEYS)}. [default: detected, printed]",
        READING,
        metavar="FILE.toml|KEY=VALUE",
        autocompletion=lambda incomplete: completed(KEYS, "=")(incomplete),  # KEYS stands below
    ),
]
_FOLLOW = "SESSION is a file that is still being written: continue as it grows."
Follow = Annotated[bool, option("--follow", _FOLLOW, LIVE)]
_CAPTURE = "For a live source: write everything received to DIR/session.log."
Capture = Annotated[Path | None, option("--capture", _CAPTURE, LIVE, metavar="DIR")]
KeepUp = Annotated[
    bool | None,
    option(
        "--keep-up/--every-picture",
        "For a live source: skip and count the oldest of more than four waiting pictures, or "
        "use every one, however late. [default: --keep-up for tcp:// and ws://]",
        LIVE,
    ),
]
Patience = Annotated[
    float | None,
    option(
        "--patience",
        "For a live source: end after it was disconnected, or silent, for this long. "
        "[default: 30 disconnected; silent forever]",
        LIVE,
        hidden=True,  # of `replay`, which has enough options; `record` shows its own
        min=0.0,
        metavar="SECONDS",
    ),
]


def output_of(
    stem: str,
    rrd: str | None,
    save_run: Path | None = None,
    layout: str | None = None,
    detail: str = DETAILS[0],
    *,
    web: bool,
    force: bool,
) -> OutputOptions:
    """Return where the output goes; `stem` names the recording where `rrd` does not."""
    from ...running.output import OutputOptions

    if web and rrd is not None:
        raise OptionError("--web serves the recording and -o writes it: give one of them")
    if rrd not in (None, "auto", "none") and Path(str(rrd)).suffix != ".rrd":
        raise OptionError(f"-o is a Rerun recording that ends in .rrd, or auto, or none; found {rrd!r}")
    if rrd != "none":
        skip_pandas()
    file = None if rrd in (None, "auto", "none") else Path(str(rrd))
    server = None
    if web:
        from ...viewer.web import WebViewer  # imports Rerun

        server = WebViewer()
    return OutputOptions(
        stem, file, rrd == "auto", rrd == "none", force, save_run, layout, detail, web=server
    )


def settings_of(pairs: Iterable[str] | None) -> dict[str, Any]:
    """Read `--set KEY=VALUE` pairs; a value may be TOML, such as a table. OptionError for anything else."""
    found: dict[str, Any] = {}
    for pair in pairs or ():
        key, equals, value = pair.partition("=")
        if not equals or not key.strip():
            raise OptionError(f"--set takes KEY=VALUE, such as sensor.sharpness=2; found {pair!r}")
        if key.strip() in found:
            raise OptionError(f"--set gives {key.strip()} twice; give it once")
        if key.strip() == "sensor.outside" and ":" in value and "" not in sys.path:
            sys.path.append("")  # a module that is typed may be in the current folder, as with `python -m`
        found[key.strip()] = value.strip() if not value.strip().startswith(("{", "[")) else _toml(pair, value)
    return found


def sensor_pairs(sensors: Iterable[str] | None) -> list[str]:
    """Return `--sensor` as a pair of `--set`."""
    names = ",".join(sensors or ())
    return [f"sensor.outside={names}"] if names else []


def _toml(pair: str, value: str) -> Any:
    try:
        return parse_toml(f"value = {value}")["value"]
    except ValueError as problem:
        raise OptionError(f"--set {pair}: {problem}") from None


METERS = {"in": 0.0254, "ft": 0.3048, "m": 1.0, "cm": 0.01, "mm": 0.001}


def read_length(text: str, name: str, least_m: float = 0.0, most_m: float = 1000.0) -> float:
    """Read an option's length, such as 18in, 0.6m, 45cm or 1.5ft, in meters. OptionError for other words."""
    found = re.fullmatch(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*(in|ft|mm|cm|m)\s*", text)
    length_m = float(found[1]) * METERS[found[2]] if found else 0.0
    if not (found and max(least_m, 1e-9) <= length_m <= most_m):
        limit = f" from {least_m * 100:g} cm" if least_m else " above 0"
        raise OptionError(f"{name} is a length{limit} like 18in, 45cm, 0.6m or 1.5ft, found {text!r}")
    return length_m


# How a recording is read: from a TOML file or as KEY=VALUE; the keys are those of the file.

USUAL = ReadingOptions()


def reading_of(given: Iterable[str] | None, *, keep_going: bool = False) -> ReadingOptions:
    """Return the options that files and KEY=VALUE pairs set; later ones override earlier ones.

    OptionError for a pair that is not valid, InputError for a file.
    """
    options = USUAL
    for word in given or ():
        key, equals, value = word.partition("=")
        if equals and not Path(word).exists():
            options = _with(options, key.strip(), value.strip())
        else:
            read = read_reading(word)
            changed = {name for name in FIELDS if getattr(read, name) != getattr(USUAL, name)}
            options = replace(options, **{name: getattr(read, name) for name in changed})
    return replace(options, keep_going=keep_going or options.keep_going)


def typed(options: ReadingOptions) -> list[str]:
    """Return the options that differ from their defaults, as typed on the command line."""
    words = []
    for key, name in KEYS.items():
        value = getattr(options, name)
        if value != getattr(USUAL, name):
            words += ["--reading", f"{key}={_text(name, value)}"]
    return words


def _text(name: str, value: Any) -> str:
    if isinstance(value, Mapping):
        return ",".join(f"{role}={column}" for role, column in value.items())
    return str(value).lower() if isinstance(value, bool) else option_value(name, value)


def _with(options: ReadingOptions, key: str, value: str) -> ReadingOptions:
    name = KEYS.get(key, key if key in FIELDS else None)
    if name is None:
        near = difflib.get_close_matches(key, KEYS, n=1)
        advice = f"did you mean {near[0]}?" if near else f"there are {', '.join(KEYS)}"
        raise OptionError(f"--reading has no key {key!r}; {advice}")
    try:
        found = _value(name, value)
    except ValueError as problem:
        raise OptionError(f"--reading {key}: expected {problem}, found {value!r}") from None
    changes: dict[str, Any] = {name: math.radians(found) if name != key else found}
    return replace(options, **changes)


def _value(name: str, text: str) -> Any:
    """Return a value as its field holds it. ValueError says what was expected."""
    usual, meaning = getattr(USUAL, name), FIELDS[name]
    if meaning.choices and text not in meaning.choices:
        raise ValueError(f"one of {', '.join(meaning.choices)}")
    if isinstance(usual, Mapping):
        return columns_of(text)
    if usual is None:
        return Path(text) if name == "table" else text
    if isinstance(usual, bool):
        if text not in ("true", "false"):
            raise ValueError("true or false")
        return text == "true"
    return _number(text, usual, meaning.least)


def _number(text: str, usual: float, least: float | None) -> float:
    try:
        number = int(text) if isinstance(usual, int) else float(text)
    except ValueError:
        raise ValueError("a number") from None
    if not math.isfinite(number) or (least is not None and number < least):
        raise ValueError("a finite number" + ("" if least is None else f" from {least:g}"))
    if isinstance(usual, int) and number >= 2**32:
        raise ValueError("a whole number below 2**32")
    if usual == 1 and not number:
        raise ValueError("a number other than 0")
    return number


def columns_of(text: str) -> dict[str, str]:
    """Read `image=file,heading=yaw:deg`. ValueError for anything else."""
    found: dict[str, str] = {}
    for part in text.split(","):
        role, equals, column = part.partition("=")
        if not equals or not role.strip() or not column.strip():
            raise ValueError("ROLE=COLUMN, with commas between them")
        found[role.strip()] = column.strip()
    return found
