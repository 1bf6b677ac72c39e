"""Configuration and motion parameters as TOML files."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

from maurice_mcl.config.parameters import (
    PRESETS,
    Configuration,
    FilterParameters,
    Layer,
    configure,
    flatten,
)
from maurice_mcl.filter.motion import MOTION_MODELS
from maurice_mcl.values import POSE_SENSORS, expected_one_of, is_own

from .amcl import read_amcl
from .errors import InputError
from .files.ros_maps import ENDINGS
from .files.text import read_toml, toml_value


def _recovers_by(name: str) -> Callable[[FilterParameters], bool]:
    return lambda parameters: parameters.recovery.strategy == name


STRATEGIES = ("threshold", "sensor", "augmented", "expansion", "mixture")  # of recovery, with a table each
# tables of the configuration that only some filters use
USED_IF: Mapping[str, Callable[[FilterParameters], bool]] = {
    "sensor.laser": lambda p: "laser" in p.sensor.weights,
    "references.interpolation": lambda p: p.references.method == "interpolated",
    "resampling.kld": lambda p: p.resampling.adaptive,
    **{f"recovery.{name}": _recovers_by(name) for name in STRATEGIES},
    "guided_motion": lambda p: bool(p.sensor.outside or {*p.sensor.weights} & {*POSE_SENSORS}),
}
PREFIX = "MAURICE_FILTER_"  # MAURICE_FILTER_SENSOR__SHARPNESS=2 sets sensor.sharpness


def read_config(path: Path, robot: Collection[str] = ()) -> Layer:
    """Read a configuration file, or AMCL's parameters as YAML; what its keys mean is checked later.

    `robot` as `read_amcl` takes it. InputError for one that is neither.
    """
    if path.suffix.lower() in ENDINGS:
        return Layer(str(path), read_amcl(path, robot).settings)
    if path.suffix.lower() in (".launch", ".xml", ".py"):
        dump = "`rosparam dump FILE.yaml` or `ros2 param dump /amcl` writes a running robot's"
        raise InputError(path, f"found a launch file, expected AMCL's parameters as YAML; {dump}")
    return Layer(str(path), flatten(read_toml(path, "settings of a filter")))


def environment_layers(environment: Mapping[str, str]) -> list[Layer]:
    """Return a layer for each variable that starts with MAURICE_FILTER_; two underscores stand for a dot."""
    return [
        Layer(name, {name.removeprefix(PREFIX).lower().replace("__", "."): value})
        for name, value in sorted(environment.items())
        if name.startswith(PREFIX)
    ]


def configuration_of(
    preset: str | None,
    file: Path | None,
    environment: Mapping[str, str],
    typed: Mapping[str, Any],
    robot: Collection[str] = (),
) -> Configuration:
    """Put together default, preset, file, environment and `typed`, the last one winning. InputError.

    The setting `motion` of `typed` may name a file of motion parameters; `robot` is as `read_amcl` takes it.
    """
    layers = [] if preset is None else [Layer(f"preset {preset}", PRESETS[preset])]
    layers += [] if file is None else [read_config(file, robot)]
    layers += environment_layers(environment)
    layers += [Layer("command line", {key: value}) for key, value in read_settings(typed).items()]
    try:
        return configure(layers)
    except ValueError as problem:  # its text begins with the origin
        origin, _, what = str(problem).partition(": ")
        raise InputError(Path(origin), what) from None


def check_config(file: Path) -> int:
    """Return how many values a file sets, without the environment. InputError if a run would refuse."""
    _check_motion(file, configuration_of(None, file, {}, {}).values()["motion"])
    return len(read_config(file).values)


def _check_motion(file: Path, motion: Mapping[str, Any] | None) -> None:
    if motion is None:
        return
    model = motion.get("model", "maurice")
    if isinstance(model, str) and is_own(model):
        return
    if not isinstance(model, str) or model not in MOTION_MODELS:
        raise InputError(file, f"motion.model: found {model!r}, {expected_one_of(model, MOTION_MODELS)}")
    try:
        MOTION_MODELS[model][0](motion)
    except ValueError as problem:
        raise InputError(file, str(problem)) from None


def to_toml(configuration: Configuration, *, origins: bool = False) -> str:
    """Write the effective configuration as TOML; with `origins`, comments say where values came from.

    Then tables of defaults that the filter does not use, such as a laser's without a laser, are only named.
    """
    tables: dict[str, list[str]] = {"": []}
    unused = {table for table, used in USED_IF.items() if origins and not used(configuration.parameters)}
    unused -= {_table_of(setting.key) for setting in configuration.settings if setting.origin != "default"}
    for setting in configuration.settings:
        table, name = _table_of(setting.key), setting.key.rpartition(".")[2]
        if setting.value is None or table in unused:
            continue
        comment = f"  # from {_printable(setting.origin)}" if origins else ""
        tables.setdefault(table, []).append(f"{name} = {toml_value(setting.value)}{comment}")
    parts = ["\n".join(tables.pop(""))]
    parts += [f"[{table}]\n" + "\n".join(lines) for table, lines in tables.items()]
    if unused:
        parts.append(f"# defaults of no use to this filter: {', '.join(sorted(unused))}")
    return "\n\n".join(parts) + "\n"


def _table_of(key: str) -> str:
    return key.rpartition(".")[0]


def _printable(text: str) -> str:
    """Replace unprintable characters, such as line breaks in file names: a comment is one line."""
    return "".join(c if c.isprintable() else "?" for c in text)


# Motion parameters as a TOML file: what a session header holds under robot.motion, kept apart.

TABLE = "robot.motion"


def motion_to_toml(values: Mapping[str, Any], comments: tuple[str, ...] = ()) -> str:
    """Write motion parameters, as a header holds them, as TOML that begins with comments."""
    plain = {key: value for key, value in values.items() if not isinstance(value, Mapping)}
    lines = [*(f"# {' '.join(text.splitlines())}" for text in comments), f"[{TABLE}]"]
    lines += [f"{key} = {_value(value)}" for key, value in plain.items()]
    for floor, drift in values.get("drift", {}).items():
        lines += ["", f"[{TABLE}.drift.{toml_value(floor)}]"]
        lines += [f"{key} = {_value(value)}" for key, value in drift.items()]
    return "\n".join(lines) + "\n"


def read_motion(file: Path) -> dict[str, Any]:
    """Read the table robot.motion, unchecked. InputError if the file is no TOML, or holds no such table."""
    tables = read_toml(file, "motion parameters")
    robot = tables.get("robot")
    motion = robot.get("motion") if isinstance(robot, dict) else None
    if not isinstance(motion, dict) or not motion:
        names = ", ".join(tables) or "nothing"
        raise InputError(file, f"found {names}, expected a table [{TABLE}], as calibrate motion writes it")
    return motion


def _value(value: Any) -> str:
    return toml_value(value if isinstance(value, str) else float(value))


def motion_file(settings: Mapping[str, Any]) -> Path | None:
    """Return the file of motion parameters that the setting `motion` names; None where it names none."""
    motion = settings.get("motion")
    is_named = isinstance(motion, Path) or (isinstance(motion, str) and not is_own(motion))
    return Path(str(motion)) if is_named else None


def read_settings(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return settings with the motion parameters of the file that they may name. InputError."""
    file = motion_file(settings)
    return dict(settings) if file is None else {**settings, "motion": read_motion(file)}
