"""A plan of trials: which drives, which filters, how many seeds. A TOML file, or the name of a shipped plan.

A plan is parts; a part is sessions times variants times seeds. Run k of every variant sees the same drive and
starts from the same seed, so that variants are compared run by run (common random numbers). Nothing is held
for each run: variants are numbered, and run and variant are found by their numbers.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

from maurice_loaders.errors import InputError
from maurice_loaders.files.text import read_toml, show
from maurice_loaders.reading.options import RULES, Reading
from maurice_loaders.session_log.header import drive_name
from maurice_mcl.config.parameters import PRESETS, Configuration, Layer, configure, flatten
from maurice_mcl.sensor.descriptors.registry import feature_name, settings_of_feature
from maurice_mcl.values import (
    Plain,
    Rule,
    checked,
    choice,
    entries,
    expected_one_of,
    plain,
    rules_of,
    table,
    text,
    whole,
)

from ..sessions import simulation_plan
from ..tasks import TASKS, TEST, TIERS

SHIPPED = Path(__file__).parent / "plans"
MOST_SEEDS = 10_000_000  # a session
MOST_NESTING = 20  # plans that include each other
MOST_DRIVES = len(TEST)  # seeds of drives that nothing was fitted on
SHUFFLED, MISJUDGED = "shuffled references", "motion constants +30 %"  # controls
# settings that are no keys of the configuration
SPECIAL: Mapping[str, Rule] = {
    "preset": choice(*PRESETS),
    "feature": feature_name,
    "control": choice(SHUFFLED, MISJUDGED),
}
KEYS: Mapping[str, Rule] = {
    "title": text,
    "seeds": whole(1, MOST_SEEDS),
    "include": entries,
    "sessions": entries,
    "settings": table,
    "grid": table,
    "variants": entries,
}  # of a plan
COUNT = whole(0, 1_000_000)
WANTED = "a plan has sessions, and settings, a grid or variants"


def _spacing(key: str, value: Any) -> int:
    spacing_in: int = whole(0, 100)(key, value)
    if 0 < spacing_in < 4:
        raise ValueError(f"{key}: found {spacing_in}, expected 4 to 100 in, or 0 for the world's")
    return spacing_in


def _reading(key: str, value: Any) -> str:
    """Take options of reading, a table, as the one text that sessions are told apart by."""
    return reading_text(replace(Reading(), **checked(table(key, value), RULES, f"{key}.")))


def reading_text(options: Reading) -> str:
    """Return the options that differ from their defaults, as JSON; "" for none."""
    changes = {name: getattr(options, name) for name in options.changed}
    return json.dumps(plain(changes)) if changes else ""


@dataclass(frozen=True, slots=True)
class SessionSpec:
    """What is driven: a simulated task, drawn anew for every seed, or a recorded session."""

    label: Annotated[str, text]
    task: Annotated[str, choice(*TASKS)] = "tracking"
    world: Annotated[str, text] = "two-rooms"
    tier: Annotated[str, choice(*TIERS)] = "nominal"
    updates: Annotated[int, COUNT] = 120
    kidnap_at: Annotated[int | None, COUNT] = None  # an update; None: halfway
    slip_at: Annotated[str, text] = ""
    lights: Annotated[str, text] = ""  # as in docs/simulate.md
    moved: Annotated[int, COUNT] = 0
    people: Annotated[int, COUNT] = 0  # percent of the pictures in which people stand in view
    spacing_in: Annotated[int, _spacing] = 0  # between the places of the survey; 0: as the world has it
    headings: Annotated[int, whole(0, 36)] = 0  # at each place of the survey; 0: as the world has it
    # by the survey; "unknown": left out of it, so that landmarks fit it
    camera: Annotated[str, choice("stated", "unknown")] = "stated"
    arenas: Annotated[int, whole(1, MOST_DRIVES)] = 5  # run k drives in arena k modulo this number
    path: Annotated[str, text] = ""  # of a recorded session; `kidnap_at` is then of a stretch, others unused
    library: Annotated[str, text] = ""  # of a recorded session; "": the one that its header names
    # a map of the recording's scans instead: of all; or of its first half, and then its second is driven
    mapped: Annotated[str, choice("", "all", "first half")] = ""
    stretch: Annotated[int, COUNT] = 0  # updates of run k from a place of its own in the recording; 0: whole
    reading: Annotated[str, _reading] = ""  # of a recorded session: how it is read, a table of options
    start: Annotated[str, choice("", "anywhere")] = ""  # "": the header's start, else anywhere; "anywhere"

    @property
    def is_cut(self) -> bool:
        """Whether a part of a recording is driven, or all of it on a map of its own scans."""
        return bool(self.mapped or self.stretch)

    @property
    def read_as(self) -> Reading:
        """How the recording is read."""
        return replace(Reading(), **checked(json.loads(self.reading or "{}"), RULES))

    @property
    def drive(self) -> SessionSpec:
        """The same session under no name: equal for sessions that share their drives."""
        return replace(self, label="")


SESSION_KEYS: Mapping[str, Rule] = rules_of(SessionSpec, "", {})


@dataclass(frozen=True, slots=True)
class Variant:
    """One filter: what a plan sets, by keys of the configuration, `preset` and `feature`."""

    label: str
    settings: Mapping[str, Any]

    def configuration(self) -> Configuration:
        """Return the complete configuration. ValueError, in one line, for what none can be."""
        return configuration_of(self.settings)


@dataclass(frozen=True, slots=True)
class Variants:
    """All variants of a part: every combination of the grid, then the listed ones."""

    settings: Mapping[str, Any] = field(default_factory=dict)  # of all
    grid: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    listed: tuple[Variant, ...] = ()

    @property
    def combinations(self) -> int:
        """The number of combinations of the grid; a part without a grid and a list has one."""
        return math.prod(map(len, self.grid.values())) if self.grid or not self.listed else 0

    def __len__(self) -> int:
        return self.combinations + len(self.listed)

    def __getitem__(self, number: int) -> Variant:
        if number >= self.combinations:
            variant = self.listed[number - self.combinations]
            return Variant(variant.label, {**self.settings, **variant.settings})
        chosen: dict[str, Any] = {}
        for key, values in reversed(list(self.grid.items())):
            number, at = divmod(number, len(values))
            chosen[key] = values[at]
        chosen = dict(reversed(chosen.items()))
        return Variant(label_of(chosen), {**self.settings, **chosen})

    @property
    def varied(self) -> list[str]:
        """The keys in which variants differ."""
        keys = [key for variant in self.listed for key in variant.settings]
        return list(dict.fromkeys([*self.grid, *keys]))


@dataclass(frozen=True, slots=True)
class Part:
    """One experiment of a plan."""

    name: str
    title: str
    sessions: tuple[SessionSpec, ...]
    variants: Variants
    seeds: int

    @property
    def runs(self) -> int:
        """The number of runs."""
        return len(self.sessions) * len(self.variants) * self.seeds


@dataclass(frozen=True, slots=True)
class Plan(Plain):
    """Parts, in order.

    >>> from maurice_datasets.trials.plan import read_plan
    >>> plan = read_plan("kidnapped")
    >>> plan.parts[0].sessions[0].task
    'kidnapped'
    """

    name: str
    title: str
    parts: tuple[Part, ...]

    @property
    def runs(self) -> int:
        """The number of runs of all parts."""
        return sum(part.runs for part in self.parts)

    @property
    def hash(self) -> str:
        """A hash of all that the runs depend on."""
        return hashlib.sha256(json.dumps(self.to_json(), sort_keys=True).encode()).hexdigest()[:16]

    def with_seeds(self, seeds: int | None) -> Plan:
        """Return the plan with another number of seeds in every part."""
        if seeds is None:
            return self
        return replace(self, parts=tuple(replace(part, seeds=seeds) for part in self.parts))

    def quick(self) -> Plan:
        """Return the plan cut down to what shows that it works: two seeds, two arenas, short drives."""
        return replace(self, parts=tuple(_quick(part) for part in self.parts))

    def only(self, words: Sequence[str]) -> Plan:
        """Return the parts whose names contain one of some words; InputError if there is none."""
        parts = tuple(part for part in self.parts if not words or any(word in part.name for word in words))
        if not parts:
            names = ", ".join(part.name for part in self.parts)
            raise InputError(None, f"found no part called {', '.join(words)}, expected one of {names}")
        return replace(self, parts=parts)


def _quick(part: Part) -> Part:
    """Cut a part down; of numbers in a grid, the first and the last stay: figures show every named value."""
    sessions = tuple(
        replace(
            spec,
            arenas=min(spec.arenas, 2),
            updates=min(spec.updates, 20),
            kidnap_at=None if spec.kidnap_at is None else min(spec.kidnap_at, 8),
        )
        for spec in part.sessions
    )
    grid = {
        key: [values[0], values[-1]] if len(values) > 2 and not isinstance(values[0], str) else values
        for key, values in part.variants.grid.items()
    }
    return replace(
        part, sessions=sessions, variants=replace(part.variants, grid=grid), seeds=min(part.seeds, 2)
    )


def configuration_of(settings: Mapping[str, Any]) -> Configuration:
    """Return the configuration that settings describe, as `make_localizer` does. ValueError in one line."""
    checked({key: value for key, value in settings.items() if key in SPECIAL and value is not None}, SPECIAL)
    preset, feature = settings.get("preset"), settings.get("feature")
    layers = [Layer(f"preset {preset}", PRESETS[preset])] if preset else []
    layers += [Layer("feature", settings_of_feature(feature))] if feature else []
    own = {key: value for key, value in settings.items() if key not in SPECIAL}
    return configure([*layers, Layer("plan", own)])


def label_of(chosen: Mapping[str, Any]) -> str:
    """Return a label like "blended, 500" of what a variant sets."""
    return ", ".join(f"{value:,}" if isinstance(value, int) else str(value) for value in chosen.values())


def shipped_plans() -> list[str]:
    """Return the names of the plans that come along."""
    return sorted(file.stem for file in SHIPPED.glob("*.toml"))


def read_plan(source: str | Path, seeds: int | None = None) -> Plan:
    """Read a plan that comes along, by its name, or a TOML file; `seeds` replaces its own number.

    Raises InputError, in one line, for what is no plan: with the file, the key and what was expected.

        >>> import maurice_datasets as md
        >>> md.read_plan("kidnapped", seeds=5).runs
        15
    """
    return _read(_file_of(source), ()).with_seeds(seeds)


def _file_of(source: str | Path) -> Path:
    shipped = SHIPPED / f"{source}.toml"
    file = shipped if isinstance(source, str) and shipped.is_file() else Path(source)
    if not file.exists():
        expected = expected_one_of(str(source), shipped_plans())
        raise InputError(file, f"there is no plan and no TOML file of that name; {expected}")
    if file.is_dir():
        raise InputError(file, f"found a folder, expected a TOML file or one of {', '.join(shipped_plans())}")
    return file


def _read(file: Path, within: tuple[Path, ...]) -> Plan:
    """Read a plan, and those that it includes; `within` are the files that include it."""
    within = (*within, file.resolve())
    if within[-1] in within[:-1]:
        raise InputError(file, f"include: found {file.name} within itself, expected another plan")
    if len(within) > MOST_NESTING:
        raise InputError(file, f"include: found more than {MOST_NESTING} plans within each other")
    tree = _checked(file, read_toml(file, "a plan of trials"), KEYS)
    included = [_read(_included(file, name), within) for name in tree.get("include", [])]
    parts = [part for plan in included for part in plan.parts]
    if "sessions" in tree:
        parts.append(_part(file, tree))
    if not parts:
        raise InputError(file, f"found no [[sessions]]; {WANTED}")
    _expect_distinct(file, "include: found the part", [part.name for part in parts])
    return Plan(file.stem, tree.get("title", file.stem), tuple(parts))


def _included(file: Path, name: object) -> Path:
    if not isinstance(name, str):
        raise InputError(file, f"include: found {show(name)}, expected the name of a plan")
    return _file_of(name if name in shipped_plans() else file.parent / name)


def _part(file: Path, tree: Mapping[str, Any]) -> Part:
    seeds = tree.get("seeds", 20)
    sessions = tuple(
        spec
        for number, session in enumerate(tree["sessions"], 1)
        for spec in _sessions(file, number, session)
    )
    _expect_distinct(file, "sessions: found the label", [spec.label for spec in sessions])
    if seeds > MOST_DRIVES and any(not spec.path for spec in sessions):
        raise InputError(file, f"seeds: found {seeds}, expected at most {MOST_DRIVES} for simulated sessions")
    return Part(file.stem, tree.get("title", file.stem), sessions, _variants(file, tree), seeds)


def _variants(file: Path, tree: Mapping[str, Any]) -> Variants:
    grid = {
        key: value if isinstance(value, list) else [value]
        for key, value in flatten(tree.get("grid", {})).items()
    }
    listed = []
    for number, entry in enumerate(tree.get("variants", []), 1):
        if not isinstance(entry, Mapping):
            raise InputError(file, f"variant {number}: found {show(entry)}, expected a table")
        own = flatten({key: value for key, value in entry.items() if key != "label"})
        listed.append(Variant(str(entry.get("label", label_of(own))), own))
    _expect_distinct(file, "variants: found the label", [variant.label for variant in listed])
    variants = Variants(flatten(tree.get("settings", {})), grid, tuple(listed))
    alone = [{key: value} for key, values in grid.items() for value in values]
    first = {key: values[0] for key, values in grid.items() if values}
    try:
        listed_settings = [dict(variant.settings) for variant in listed]
        for own in ({}, *({**first, **setting} for setting in alone), *listed_settings):
            configuration_of({**variants.settings, **own})
    except ValueError as problem:
        raise InputError(file, str(problem).removeprefix("plan: ")) from None
    if not len(variants):
        raise InputError(file, "grid: found an empty list, expected values")
    return variants


def _sessions(file: Path, number: int, given: Mapping[str, Any]) -> Iterator[SessionSpec]:
    """Yield one session for every combination of the fields that hold a list."""
    if not isinstance(given, Mapping):
        raise InputError(file, f"session {number}: found {show(given)}, expected a table")
    lists = {key: value for key, value in given.items() if isinstance(value, list)}
    if [] in lists.values():
        raise InputError(file, f"session {number}: found an empty list, expected values")
    for values in itertools.product(*lists.values()):
        chosen = dict(zip(lists, values, strict=True))
        spec = _checked(file, {**given, **chosen}, SESSION_KEYS, f"session {number}: ")
        name = spec.get("label") or spec.get("task") or drive_name(file.parent / spec.get("path", "session"))
        both = "both task and path" if "path" in spec else "neither task nor path"
        if ("path" in spec) == ("task" in spec):
            raise InputError(file, f"session {number}: found {both}, expected one of them")
        if spec.get("library") and spec.get("mapped"):
            raise InputError(file, f"session {number}: found both library and mapped, expected one of them")
        more = "".join(f", {value or 'unchanged'}" for value in chosen.values())
        yield _simulated_or_recorded(file, number, SessionSpec(**{**spec, "label": f"{name}{more}"}))


def _simulated_or_recorded(file: Path, number: int, spec: SessionSpec) -> SessionSpec:
    """Return a session with complete paths. InputError for a simulation that cannot be."""
    if not spec.path and (why := _why_no_simulation(spec)):
        raise InputError(file, f"session {number}: {why}")
    path, library = (
        str((file.parent / name).resolve()) if name else "" for name in (spec.path, spec.library)
    )
    reading = spec.read_as
    if reading.table is not None:
        reading = replace(reading, table=(file.parent / reading.table).resolve())
    return replace(spec, path=path, library=library, reading=reading_text(reading))


def _why_no_simulation(spec: SessionSpec) -> str:
    """Say why no session can be simulated so; "" where one can."""
    names = ("tier", "updates", "kidnap_at", "slip_at", "lights", "moved", "people")
    try:
        simulation_plan(spec.task, **{name: getattr(spec, name) for name in names})
    except InputError as problem:
        return str(problem)
    return ""


def _checked(
    file: Path, given: Mapping[str, Any], rules: Mapping[str, Rule], where: str = ""
) -> dict[str, Any]:
    """Return the values of a table of the file. InputError for unknown keys and bad values."""
    try:
        return checked(given, rules, where)
    except ValueError as problem:
        raise InputError(file, str(problem)) from None


def _expect_distinct(file: Path, what: str, names: Sequence[str]) -> None:
    twice = next((name for number, name in enumerate(names) if name in names[:number]), None)
    if twice is not None:
        raise InputError(file, f"{what} {twice!r} twice; give each a name of its own")
