"""Options that several commands share, each described once, and how their values are read."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from maurice_mcl.config.parameters import PRESETS
from maurice_mcl.sensor.descriptors.registry import CHANNELS, FEATURES

from ..errors import OptionError
from ..layouts import DETAILS, LAYOUT_NAMES

if TYPE_CHECKING:
    from ..app.output import OutputOptions


def _one_of(known: Iterable[str], what: str) -> Callable[[Any], Any]:
    """Make what checks an option's value, or each of its values, to be the name of a known one."""
    names = list(known)

    def check(typed: Any) -> Any:
        for value in typed if isinstance(typed, list) else [typed]:
            if value is not None and value not in names:
                raise typer.BadParameter(f"no {what} called {value!r}; there are {', '.join(names)}")
        return typed

    return check


_check_feature = _one_of([*FEATURES, *(name for name in CHANNELS if name not in FEATURES)], "feature")
_check_preset = _one_of(PRESETS, "preset")
_check_detail = _one_of(DETAILS, "detail")
_check_layout = _one_of(LAYOUT_NAMES, "layout")


FILTER, OUTPUT, LIVE, READING = "Filter", "Output", "Live", "Reading"  # panels of the help

SessionArgument = Annotated[
    Path,
    typer.Argument(
        help="A session log, a recording of any format (see `formats`), a saved run's folder, or a live "
        "source: -, tcp://HOST:PORT, ws://HOST:PORT.",
        show_default=False,
        metavar="SESSION",
    ),
]
_FEATURE: Any = typer.Option(
    "--feature",
    metavar="NAME",
    help=f"What is compared: {', '.join(FEATURES)}, or any one channel. [default: blended]",
    callback=_check_feature,
    rich_help_panel=FILTER,
)
_PRESET: Any = typer.Option(
    "--preset",
    metavar="|".join(PRESETS),
    help="A complete filter by name.",
    callback=_check_preset,
    rich_help_panel=FILTER,
)
_CONFIG: Any = typer.Option(
    "--config", metavar="FILE.toml", help="A configuration file, over the preset.", rich_help_panel=FILTER
)
_PARTICLES: Any = typer.Option(
    "--particles",
    min=1,
    max=10_000_000,
    help="Number of particles. [default: 2000]",
    rich_help_panel=FILTER,
)
_SEED: Any = typer.Option(
    "--seed",
    min=0,
    max=2**32 - 1,
    help="Seed of all randomness: the same seed gives the same run. [default: 0]",
    rich_help_panel=FILTER,
    show_default=False,
)
_START: Any = typer.Option(
    "--start",
    metavar="tracking|truth|global|X,Y,HEADING",
    help="Where the particles begin: on the header's start pose, on the first true pose, anywhere, or on a "
    "pose in display units and degrees. [default: tracking where there is a start pose, else global]",
    rich_help_panel=FILTER,
)
FeatureOption = Annotated[str | None, _FEATURE]
FeaturesOption = Annotated[list[str] | None, _FEATURE]
PresetOption = Annotated[str | None, _PRESET]
PresetsOption = Annotated[list[str] | None, _PRESET]
ConfigOption = Annotated[Path | None, _CONFIG]
ConfigsOption = Annotated[list[Path] | None, _CONFIG]
ParticlesOption = Annotated[int | None, _PARTICLES]
ParticleCountsOption = Annotated[list[int] | None, _PARTICLES]
SeedOption = Annotated[int, _SEED]
SeedsOption = Annotated[list[int] | None, _SEED]
StartOption = Annotated[str | None, _START]
StartsOption = Annotated[list[str] | None, _START]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Set any key of the configuration, such as sensor.sharpness=2 or resampling.scheme=residual; "
        "motion=FILE.toml takes motion parameters from a file. Repeatable; `config show` lists the keys.",
        rich_help_panel=FILTER,
    ),
]
LibraryOption = Annotated[
    Path | None,
    typer.Option(
        "--library",
        metavar="PATH",
        help="A library folder or a survey log. [default: the one that the header names]",
        rich_help_panel=FILTER,
    ),
]
RrdOption = Annotated[
    str | None,
    typer.Option(
        "--rrd",
        metavar="OUT.rrd|auto|none",
        help="Open no viewer, and write the Rerun recording to this file; auto: <name>.rrd; none: write no "
        "recording. [default: the viewer where there is a display, else auto]",
        rich_help_panel=OUTPUT,
    ),
]
SaveRunOption = Annotated[
    Path | None,
    typer.Option(
        "--save-run",
        metavar="DIR",
        help="Save every step to this new folder, for `explain`, `report`, `verify` and others.",
        rich_help_panel=OUTPUT,
    ),
]
ForceOption = Annotated[bool, typer.Option("--force", help="Overwrite what exists.", rich_help_panel=OUTPUT)]
KeepGoingOption = Annotated[
    bool,
    typer.Option(
        "--keep-going",
        help="Skip broken lines and pictures, and report how many at the end.",
        rich_help_panel=READING,
    ),
]
LayoutOption = Annotated[
    str | None,
    typer.Option(
        "--layout",
        metavar="NAME",
        help=f"The layout to begin with, of the tabs in the viewer: {', '.join(LAYOUT_NAMES)}. "
        "[default: overview, or compare for several runs]",
        callback=_check_layout,
        rich_help_panel=OUTPUT,
    ),
]
AsRecordedOption = Annotated[
    bool,
    typer.Option(
        "--as-recorded",
        help="Of a bag: show the particles of the localizer that was recorded; no filter runs.",
        rich_help_panel=READING,
    ),
]
DetailOption = Annotated[
    str,
    typer.Option(
        "--detail",
        metavar="|".join(DETAILS),
        help="Draw every panel at every step, only around events, or little everywhere.",
        callback=_check_detail,
        rich_help_panel=OUTPUT,
    ),
]
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print JSON instead of a table.", rich_help_panel=OUTPUT)
]
FollowOption = Annotated[
    bool,
    typer.Option(
        "--follow",
        help="SESSION is a file that is still being written: continue as it grows.",
        rich_help_panel=LIVE,
    ),
]
CaptureOption = Annotated[
    Path | None,
    typer.Option(
        "--capture",
        metavar="DIR",
        help="Of a live source: write all that comes to DIR/session.log.",
        rich_help_panel=LIVE,
    ),
]
KeepUpOption = Annotated[
    bool | None,
    typer.Option(
        "--keep-up/--every-picture",
        help="Of a live source: leave out the oldest of more than four waiting pictures, and count them; or "
        "use every one, however late. [default: --keep-up for tcp:// and ws://]",
        rich_help_panel=LIVE,
    ),
]
PatienceOption = Annotated[
    float | None,
    typer.Option(
        "--patience",
        hidden=True,  # of `replay`, which has enough options; `record` shows its own
        min=0.0,
        metavar="SECONDS",
        help="Of a live source: end when it was away, or silent, for this long. "
        "[default: 30 away; silent forever]",
        rich_help_panel=LIVE,
    ),
]


def output_of(
    stem: str,
    rrd: str | None,
    *,
    save_run: Path | None = None,
    layout: str | None = None,
    detail: str = DETAILS[0],
    force: bool = False,
) -> OutputOptions:
    """Return where the output goes; `stem` names the recording where `rrd` does not."""
    from ..app.output import OutputOptions  # imports Rerun, which `inspect` and others do without

    file = None if rrd in (None, "auto", "none") else Path(str(rrd))
    return OutputOptions(stem, file, rrd == "auto", rrd == "none", force, save_run, layout, detail)


def settings_of(pairs: Iterable[str] | None) -> dict[str, Any]:
    """Read `--set KEY=VALUE` pairs; a value may be TOML, such as a table. OptionError for anything else."""
    found: dict[str, Any] = {}
    for pair in pairs or ():
        key, equals, value = pair.partition("=")
        if not equals or not key.strip():
            raise OptionError(f"--set takes KEY=VALUE, such as sensor.sharpness=2; found {pair!r}")
        found[key.strip()] = value.strip() if not value.strip().startswith(("{", "[")) else _toml(pair, value)
    return found


def _toml(pair: str, value: str) -> Any:
    try:
        return tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError as problem:
        raise OptionError(f"--set {pair}: {problem}") from None
