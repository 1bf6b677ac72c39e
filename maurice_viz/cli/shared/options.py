"""Options that several commands share, each described once; those that go together are one class."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from maurice_loaders.reading.options import FIELDS, Reading
from maurice_mcl.config.parameters import PRESETS, RULES
from maurice_mcl.sensor.descriptors.network import SCHEME
from maurice_mcl.sensor.descriptors.registry import CHANNELS, FEATURES
from maurice_mcl.values import expected_one_of

from ...entities import PHASE_NAMES
from ...errors import OptionError
from ...layouts import DETAILS, LAYOUT_NAMES
from .startup import skip_pandas
from .values import KEYS, USUAL, reading_of, sensors_of, settings_of

if TYPE_CHECKING:
    from ...running.filters import Filter
    from ...running.output import Output

FILTER, OUTPUT, LIVE, READING = "Filter", "Output", "Live", "Reading"  # panels of the help
MOST_SEED = 2**32 - 1
MOST_CHOICES = 24  # characters of names that stand beside their option; longer lists are in its help
TRUTHS = ("true", "false")


def option(names: str, text: str, panel: str | None = None, **more: Any) -> Any:
    """Describe an option: its names with spaces between them, its help, the panel that lists it."""
    return typer.Option(*names.split(), help=text, rich_help_panel=panel, **more)


def writes(metavar: str, text: str, panel: str | None = None) -> Any:
    """Describe where a command writes."""
    return option("-o --output", text, panel, metavar=metavar, show_default=False)


def argument(metavar: str | None, text: str, /, **more: Any) -> Any:
    """Describe an argument."""
    return typer.Argument(help=text, show_default=False, **more | {"metavar": metavar})


def completed(names: Iterable[str]) -> Callable[[str], list[str]]:
    """Return what a shell asks for the rest of a value: the names that begin so."""
    choices = list(dict.fromkeys(names))
    return lambda incomplete: [name for name in choices if name.startswith(incomplete)]


class RestOfWord(str):
    """A value without its key, as bash wants it, to which "=" ends a word; Typer asks for the whole pair."""

    def startswith(self, *args: object) -> bool:
        """Return that it goes on with what was typed."""
        return True


def completed_pairs(values: Mapping[str, Iterable[str]]) -> Callable[[str], Sequence[str]]:
    """Return what a shell asks for the rest of KEY=VALUE: the keys, and of a key the `values` it may have."""

    def complete(incomplete: str) -> Sequence[str]:
        key, equals, _ = incomplete.partition("=")
        if not equals:
            return completed(f"{name}=" for name in values)(incomplete)
        pairs = completed(f"{key}={value}" for value in values.get(key, ()))(incomplete)
        in_bash = os.environ.get("_MAURICE_REPLAY_COMPLETE") == "complete_bash"
        return [RestOfWord(pair.removeprefix(f"{key}=")) for pair in pairs] if in_bash else pairs

    return complete


def _words_of(rule: Callable[[str, Any], Any]) -> tuple[str, ...]:
    """Return the words that a rule of the configuration takes; none for numbers."""
    try:
        rule("", "?")
    except ValueError as refusal:  # lists them
        expected = str(refusal).partition("expected ")[2]
        if expected == "true or false":
            return TRUTHS
        if expected.startswith("one of "):
            return tuple(expected.partition(";")[0].removeprefix("one of ").split(", "))
    return ()


def one_of(known: Iterable[str], what: str, schemes: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return what an option of known names has: how they are typed, their check, and their completion.

    Names that begin with one of `schemes` are taken, too.
    """
    names = list(dict.fromkeys(known))
    choices = "|".join(names)

    def check(typed: Any) -> Any:
        for value in typed if isinstance(typed, list) else [typed]:
            if value is not None and value not in names and not value.startswith(schemes):
                raise typer.BadParameter(f"no {what} called {value!r}; {expected_one_of(value, names)}")
        return typed

    metavar = choices if len(choices) <= MOST_CHOICES else "NAME"
    return {"metavar": metavar, "callback": check, "autocompletion": completed(names)}


Session = Annotated[
    Path,
    argument(
        "SESSION",
        "A session log, a recording of any format (see `inspect`), a saved run's folder, or a live "
        "source: -, tcp://HOST:PORT, ws://HOST:PORT, cmucam:///dev/NAME.",
    ),
]
Run = Annotated[
    Path, argument("RUN", "A saved run's folder, or a comparison's; of it, one run is COMPARISON/LABEL.")
]
_FEATURE = option(
    "--feature",
    f"Feature to compare: {', '.join(FEATURES)}, any one channel, or a network, {SCHEME}FILE.onnx. "
    "[default: blended]",
    FILTER,
    **one_of([*FEATURES, *CHANNELS], "feature", (SCHEME,)),
)
_PRESET = option(
    "--preset",
    f"A complete filter by name: {', '.join(PRESETS)}.",
    FILTER,
    **one_of(PRESETS, "preset"),
)
_CONFIG_WORDS = "A configuration file, applied after the preset; or AMCL's parameters, as nav2_params.yaml."
_CONFIG = option("--config --amcl", _CONFIG_WORDS, FILTER, metavar="FILE.toml|FILE.yaml")
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
        "motion=FILE.toml takes motion parameters from a file. Repeatable; `config` lists the keys.",
        FILTER,
        metavar="KEY=VALUE",
        autocompletion=completed_pairs({key: _words_of(rule) for key, rule in RULES.items()}),
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
_LIBRARY = "A library, survey log or table of pictures; for a laser a map.yaml. [default: the header's]"
Library = Annotated[Path | None, option("--library --map", _LIBRARY, FILTER, metavar="PATH")]
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
    option("--map-unit", "Unit of wall segments.", **one_of(("mm", "m"), "unit of a map")),
]
Force = Annotated[bool, option("--force", "Overwrite what exists.", OUTPUT)]
AllRows = Annotated[
    bool,
    option("--all", "Print how and why each run was wrong, and the whole table of scores.", OUTPUT),
]
Json = Annotated[bool, option("--json", "Print JSON instead of a table.", OUTPUT)]
Layout = Annotated[
    str | None,
    option(
        "--layout",
        f"The layout (the viewer's tab) to begin with: {', '.join(LAYOUT_NAMES)}. [default: story]",
        OUTPUT,
        **one_of(LAYOUT_NAMES, "layout"),
    ),
]
RunName = Annotated[
    str | None,
    option("--run", "Of several runs, the one of this name.", metavar="NAME"),
]
RUN_NEEDS = "--run goes with a --layout that has a tab a run: overview, inside-a-step, explain, sensors"
OnePhase = Annotated[
    str | None,
    option(
        "--phase",
        f"One phase of the step, in the tab `inside-a-step`: {', '.join(PHASE_NAMES)}.",
        **one_of(PHASE_NAMES, "phase"),
    ),
]
Detail = Annotated[
    str,
    option(
        "--detail",
        "Draw every panel at every step, every panel only around events, or few panels throughout.",
        OUTPUT,
        **one_of(DETAILS, "detail"),
    ),
]
_KEEP_GOING = "Skip broken lines and pictures, and report how many at the end."
KeepGoing = Annotated[bool, option("--keep-going", _KEEP_GOING, READING)]
_RECORDED = "For a bag: show the particles of the recorded localizer; no filter runs."
AsRecorded = Annotated[bool, option("--as-recorded", _RECORDED, READING)]
ReadingPairs = Annotated[
    list[str] | None,
    option(
        "--reading",
        "How the recording is read: format, camera, topics, columns, clocks, units, frames, which "
        "pictures. Repeatable; `help reading` lists the keys. [default: detected, printed]",
        READING,
        metavar="FILE.toml|KEY=VALUE",
        autocompletion=completed_pairs(
            {
                key: FIELDS[name].choices or (isinstance(getattr(USUAL, name), bool) * TRUTHS)
                for key, name in KEYS.items()
            }
        ),
    ),
]


@dataclass(frozen=True, slots=True)
class FilterSet:
    """Which filter a session is run with, and which library it is compared with."""

    library: Library = None
    preset: Preset = None
    feature: Feature = None
    particles: Particles = None
    start: Start = None
    config: Config = None
    settings: Set = None
    sensors: Sensors = None

    def filter(self, seed: int = 0) -> Filter:
        """Return the filter."""
        return filter_from(self, seed=seed)


def filter_from(options: Any, **more: Any) -> Filter:
    """Return the filter that a set of options asks for."""
    from ...running.filters import Filter

    names = ("preset", "feature", "particles", "start", "config")
    values = {name: value for name in names if (value := getattr(options, name, None)) is not None}
    return Filter(
        settings=settings_of(options.settings), sensors=sensors_of(options.sensors), **values, **more
    )


@dataclass(frozen=True, slots=True)
class FiltersSet:
    """Which filters a session is run with; one of these options is given several times."""

    library: Library = None
    presets: Presets = None
    features: Features = None
    particles: ParticleCounts = None
    seeds: Seeds = None
    starts: Starts = None
    configs: Configs = None
    settings: Set = None
    sensors: Sensors = None

    def filters(self, sessions: int = 1) -> list[Filter]:
        """Return a filter for each value of the one option that has several; the others hold for all.

        AMCL's parameters are a filter of their own, and compared with presets. There is none where nothing is
        asked for. OptionError for others, and for several filters of several sessions.
        """
        from ...running.filters import Filter

        values_of = {field: getattr(self, option) or () for field, option in FILTERS.items()}
        values_of["settings"] = _settings_of_each(self.settings or ())
        several = [kind for kind, values in values_of.items() if len(values) > 1]
        if sessions > 1 and several:
            raise OptionError(f"sessions are compared with one filter; give --{_option(several[0])} once")
        if len(several) > 1:
            words = " and ".join(f"--{_option(kind)}" for kind in several)
            raise OptionError(f"{words} are given several times; give exactly one option several times")
        amcl = values_of["config"] and Filter(config=values_of["config"][0]).amcl
        if amcl and values_of["preset"] and several in ([], ["config"], ["preset"]):
            apart = (
                self._each("config", {**values_of, "preset": ()}),
                self._each("preset", {**values_of, "config": ()}),
            )
            return [*apart[0], *apart[1]]
        if not (self.sensors or any(values_of.values())):
            return []
        if sessions > 1 or several:
            values_of["seed"] = values_of["seed"] or [0]
            return self._each(several[0] if several else "seed", values_of)
        if values_of["feature"]:
            raise OptionError(f"found 1 run to compare; give one of {KINDS} several times")
        return self._each("feature", {**values_of, "feature": COLOR_AND_BLENDED})

    def _each(self, kind: str, given: Mapping[str, Sequence[Any]]) -> list[Filter]:
        """Return a filter for each value of one option; the first of every other holds for all."""
        from ...running.filters import Filter

        common = {name: values[0] for name, values in given.items() if values and name != kind}
        common["sensors"] = sensors_of(self.sensors)
        return [Filter(**common, **{kind: value}) for value in given[kind]]


COLOR_AND_BLENDED = ("color", "blended")  # what is compared where nothing is asked for
KINDS = "--feature, --preset, --particles, --seed, --start, --config and --set"
FILTERS = {  # field of a filter to the option of several
    "feature": "features",
    "preset": "presets",
    "particles": "particles",
    "seed": "seeds",
    "start": "starts",
    "config": "configs",
}


def _option(kind: str) -> str:
    return "set" if kind == "settings" else kind


def _settings_of_each(pairs: Iterable[str]) -> list[dict[str, Any]]:
    """Return the settings of each run: a key with several values makes one run per value."""
    values: dict[str, list[Any]] = {}
    for pair in pairs:
        for key, value in settings_of([pair]).items():
            values.setdefault(key, []).append(value)
    common = {key: value[0] for key, value in values.items() if len(value) == 1}
    several = {key: value for key, value in values.items() if len(value) > 1}
    if len(several) > 1:
        raise OptionError(f"--set gives {' and '.join(several)} several times; vary one key")
    varied = [common | {key: value} for key, some in several.items() for value in some]
    return varied or ([common] if common else [])


@dataclass(frozen=True, slots=True)
class ReadingSet:
    """How a recording is read."""

    reading: ReadingPairs = None
    keep_going: KeepGoing = False

    def options(self) -> Reading:
        """Return what was typed as one value."""
        return reading_of(self.reading, keep_going=self.keep_going)


@dataclass(frozen=True, slots=True)
class DrawingSet:
    """Where a Rerun recording goes, and what it shows."""

    rrd: Rrd = None
    web: Web = False
    layout: Layout = None
    detail: Detail = DETAILS[0]
    force: Force = False

    def output(self, stem: str, save_run: Path | None = None, **more: Any) -> Output:
        """Return where the output goes; `stem` names the recording where `-o` does not."""
        from ...running.output import Output

        if self.web and self.rrd is not None:
            raise OptionError("--web serves the recording and -o writes it: give one of them")
        if self.rrd not in (None, "auto", "none") and Path(str(self.rrd)).suffix != ".rrd":
            raise OptionError(
                f"-o is a Rerun recording that ends in .rrd, or auto, or none; found {self.rrd!r}"
            )
        if self.rrd != "none":
            skip_pandas()
        server = None
        if self.web:
            from ...viewer.web import WebViewer  # imports Rerun

            server = WebViewer()
        return Output(
            to=None if self.rrd == "none" else self.rrd,
            save_run=save_run,
            layout=self.layout,
            detail=self.detail,
            force=self.force,
            viewer=self.rrd is None and not self.web,
            stem=stem,
            web=server,
            **more,
        )
