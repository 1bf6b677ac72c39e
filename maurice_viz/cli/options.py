"""Options that several commands share, each described once, and how their values are read."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from maurice_mcl.config.presets import PRESETS
from maurice_mcl.filter.resampling import RESAMPLERS
from maurice_mcl.sensor.descriptors import CHANNELS
from maurice_mcl.sensor.features import FEATURES

from ..layouts.names import DETAILS, LAYOUT_NAMES


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
_check_resampler = _one_of(RESAMPLERS, "resampler")
_check_detail = _one_of(DETAILS, "detail")
_check_layout = _one_of(LAYOUT_NAMES, "layout")


def _check_sharpness(value: float | None) -> float | None:
    if value is not None and not 0 <= value <= SHARPEST:
        raise typer.BadParameter(f"a sharpness is a number from 0 to {SHARPEST:g}, found {value}")
    return value


_FEATURES = f"{' | '.join(FEATURES)}, or any one channel"
_PRESETS = " | ".join(PRESETS)

SessionArgument = Annotated[
    Path,
    typer.Argument(
        help="A session log, a recording of any format (see `formats`), a saved run's folder, or a live "
        "source: -, tcp://HOST:PORT, ws://HOST:PORT.",
        show_default=False,
        metavar="SESSION",
    ),
]
FeatureOption = Annotated[
    str | None,
    typer.Option(
        "--feature", help=f"What is compared: {_FEATURES}. [default: blended]", callback=_check_feature
    ),
]
FeaturesOption = Annotated[
    list[str] | None,
    typer.Option(
        "--feature",
        help=f"Once for each run: {_FEATURES}. [default: color and blended]",
        callback=_check_feature,
    ),
]
PresetOption = Annotated[
    str | None,
    typer.Option("--preset", help=f"A whole filter by name: {_PRESETS}.", callback=_check_preset),
]
PresetsOption = Annotated[
    list[str] | None,
    typer.Option("--preset", help=f"Once for all runs or once for each: {_PRESETS}.", callback=_check_preset),
]
ConfigOption = Annotated[
    Path | None,
    typer.Option("--config", metavar="FILE.toml", help="A configuration file, over the preset."),
]
ConfigsOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--config",
        metavar="FILE.toml",
        help="A configuration file, over the preset: once for all runs or once for each.",
    ),
]
LibraryOption = Annotated[
    Path | None,
    typer.Option("--library", help="A library folder or a survey log. [default: what the header names]"),
]
ParticlesOption = Annotated[
    int | None,
    typer.Option("--particles", min=1, max=10_000_000, help="How many particles. [default: 2000]"),
]
SeedOption = Annotated[
    int, typer.Option("--seed", min=0, max=2**32 - 1, help="The same seed gives the same run.")
]
SeedsOption = Annotated[
    list[int] | None,
    typer.Option(
        "--seed",
        min=0,
        max=2**32 - 1,
        help="Once for all runs, which then have the same noise, or once for each. [default: 0]",
    ),
]
StartOption = Annotated[
    str | None,
    typer.Option(
        "--start",
        help="tracking (the header's start pose), truth (the first true pose), global (anywhere), or "
        "X,Y,HEADING in the session's display units and degrees. [default: tracking where the header has a "
        "start pose, else global]",
    ),
]
ResamplerOption = Annotated[
    str | None,
    typer.Option(
        "--resampler", help=f"{' | '.join(RESAMPLERS)}. [default: systematic]", callback=_check_resampler
    ),
]
ResamplersOption = Annotated[
    list[str] | None,
    typer.Option(
        "--resampler",
        help=f"Once for all runs or once for each: {' | '.join(RESAMPLERS)}. [default: systematic]",
        callback=_check_resampler,
    ),
]
SharpnessOption = Annotated[
    float | None,
    typer.Option(
        "--sharpness",
        help="Multiplies the log-likelihood; 0 makes the sensor blind. [default: 1]",
        callback=_check_sharpness,
    ),
]
MotionOption = Annotated[
    Path | None,
    typer.Option(
        "--motion",
        metavar="FILE.toml",
        help="Motion parameters in place of the header's, as `calibrate motion -o` writes them.",
    ),
]
SaveOption = Annotated[
    Path | None,
    typer.Option("--save", metavar="OUT.rrd", help="Write the recording to this file and open no viewer."),
]
HeadlessOption = Annotated[
    bool,
    typer.Option("--headless", help="Open no viewer, as where there is no display: write <stem>.rrd."),
]
NoRecordingOption = Annotated[
    bool, typer.Option("--no-recording", help="Neither viewer nor recording: only the figures.")
]
RunOption = Annotated[
    Path | None,
    typer.Option("--run", metavar="DIR", help="Save every step to this new folder, for replay and `verify`."),
]
ForceOption = Annotated[bool, typer.Option("--force", help="Overwrite what is there.")]
KeepGoingOption = Annotated[
    bool, typer.Option("--keep-going", help="Skip broken lines and pictures, and say how many at the end.")
]
LayoutOption = Annotated[
    str | None,
    typer.Option(
        "--layout",
        help=f"The layout to begin with; all are tabs in the viewer: {' | '.join(LAYOUT_NAMES)}. "
        "[default: overview, or compare for several runs]",
        callback=_check_layout,
    ),
]
AsRecordedOption = Annotated[
    bool,
    typer.Option(
        "--as-recorded",
        help="Of a bag: show the particles of the localizer that was recorded; no filter runs.",
    ),
]
DetailOption = Annotated[
    str,
    typer.Option(
        "--detail",
        help=f"{' | '.join(DETAILS)}: every panel at every step, only around events, or little everywhere.",
        callback=_check_detail,
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")]

SHARPEST = 10_000.0  # beyond it only the best entry has any likelihood


@dataclass(frozen=True, slots=True)
class RunOptions:
    """What was asked of every run, still as typed."""

    seed: int = 0
    start: str | None = None
    particles: int | None = None
    resampler: str | None = None
    sharpness: float | None = None
    motion: Path | None = None  # in place of the header's parameters
    config: Path | None = None

    @property
    def typed(self) -> dict[str, Any]:
        """What was given of the configuration on the command line, by key."""
        given = {
            "particles": self.particles,
            "resampling.scheme": self.resampler,
            "sensor.sharpness": self.sharpness,
        }
        return {key: value for key, value in given.items() if value is not None}


@dataclass(frozen=True, slots=True)
class OutputOptions:
    """Where the result goes. A usage error where a recording is both wanted and not."""

    stem: str  # of the recording, where no --save names it
    save: Path | None
    headless: bool
    no_recording: bool
    force: bool
    json: bool
    run: Path | None = None  # folder of the saved run
    layout: str | None = None  # the one that is open at first, by name
    detail: str = DETAILS[0]  # how much of each step is drawn

    def __post_init__(self) -> None:
        if self.no_recording and self.save is not None:
            raise typer.BadParameter("--save and --no-recording exclude each other")
