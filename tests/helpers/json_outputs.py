"""The JSON of every command, on a small drive that gets lost, and its shape: keys without the values."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from helpers.commands import run
from helpers.pages import prepare
from helpers.small_session import picture_at, small_arena, write_small_survey
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.values.geometry import compose
from maurice_mcl.values.laser import LaserScan
from maurice_mcl.values.session import SessionInfo

LOST = "--preset thesis --particles 200 -o none"
FIRST = (f"replay drive {LOST} --save-run lost", "trials run plan.toml -o made --workers 1")
WORDS: Mapping[str, str] = {
    "replay": f"replay drive {LOST}",
    "compare": f"compare drive {LOST} --seed 0 --seed 1",
    "verify": "verify lost",
    "diagnose": "diagnose lost",
    "what-if": "what-if lost --from 3 --particles 60 -o none",
    "inspect": "inspect drive",
    "doctor": "doctor drive --reading turn_scale=-1",
    "check": "check drive --max-error 1m --localized-by 3 --particles 60 --seeds 2",
    "explain": "explain lost --step 9",
    "budget": "budget drive --particles 30 --seeds 2",
    "record": "record drive/session.log -o recorded --patience 0.2",
    "convert": "convert drive converted.log",
    "export": "export lost -o lost.csv",
    "import pictures": "import pictures own-pictures --poses own-pictures/poses.csv -o mine",
    "library show": "library show survey.log",
    "library check": "library check survey.log",
    "library tune": "library tune survey.log drive --channels color",
    "map build": "map build laser.log -o map",
    "calibrate motion": "calibrate motion movements.csv",
    "calibrate noise": "calibrate noise survey.log",
    "calibrate belief": "calibrate belief lost --lost",
    "calibrate drive": "calibrate drive drive",
    "trials run": "trials run plan.toml -o trials --workers 1",
    "trials table": "trials table made --by particles",
    "config": "config",
    "simulate": "simulate tracking --updates 2 -o simulated",
    "survey": "survey --spacing 6ft --headings 2 -o surveyed",
    "demo": "demo --session-only demo",
}
SLOW = ("simulate", "survey", "demo")  # the simulated rooms are rendered
MANY = 8  # entries of an object, all with the same keys: two are enough for a sample
LONGEST = 48  # characters of a text in a sample
FEWEST = 4  # keys of a value that is shown once
AS_IN = "as in "
MEASURED = {"steps_per_s": 500.0}  # differs each time; a sample has a round number instead


def write_material(folder: Path) -> None:
    """Write what the commands read: a drive of a robot that is carried away, its survey, and others."""
    write_small_survey(folder)
    (folder / "drive").mkdir()
    pose = np.array([1.6, 0.6, 0.3])
    survey = Path("../survey.log")
    info = SessionInfo("small drive", "m", start=pose, survey=survey, arena=small_arena())
    with SessionWriter(folder / "drive" / "session.log", info) as log:
        for step in range(22):
            motion = np.array([0.12, 0.0, 0.21])
            pose = compose(pose, motion)
            t_s = 2.0 * step + 1
            log.odometry(t_s, motion)
            if step == 7:
                pose = np.array([0.5, 1.5, -2.0])
                log.event(t_s, "kidnapped")
            log.truth(t_s + 1, pose)
            log.image(t_s + 1, picture_at(pose))
    prepare(folder)
    with SessionWriter(folder / "laser.log", SessionInfo("round room")) as log:
        log.truth(0.0, (0.0, 0.0, 0.0))
        log.scan(0.0, LaserScan(np.full(360, 2.0, np.float32), 0.0, np.radians(1), 0.1, 8.0))
    table = ["kind,measured,actual,heading_error_deg,floor"]
    table += [f"turn,{30 + k},{22 + 0.7 * k + k % 3},," for k in range(12)]
    table += [f"straight,{0.4 + k / 20},{0.39 + k / 20},{k % 3},wood" for k in range(12)]
    (folder / "movements.csv").write_text("\n".join(table) + "\n")
    plan = 'seeds = 2\n[[sessions]]\npath = "drive/session.log"\n[grid]\nparticles = [30, 60]\n'
    (folder / "plan.toml").write_text(plan)
    for words in FIRST:
        run(*words.split())


def output_of(name: str) -> Any:
    """Run a command with --json in the working folder; return what it prints, its status 0 or 1."""
    words = [*WORDS[name].split(), "--json"]
    for status in (0, 1):
        try:
            return json.loads(run(*words, expect=status).stdout, parse_constant=_refused)
        except AssertionError:
            if status:
                raise
    raise AssertionError


def _refused(word: str) -> None:
    raise ValueError(f"{word} is no JSON")


def sample(value: Any) -> Any:
    """Shorten JSON: of several objects one with all their keys, of other lists three, of texts the begin."""
    if isinstance(value, dict):
        shapes = {tuple(one) if isinstance(one, dict) else () for one in value.values()}
        alike = len(value) > MANY and len(shapes) == 1 and () not in shapes
        keys = list(value)[: 2 if alike else None]
        return {key: MEASURED[key] if key in MEASURED else sample(value[key]) for key in keys}
    if isinstance(value, list) and value and all(isinstance(one, dict) for one in value):
        return [sample(_merged(value))]
    if isinstance(value, list):
        return [sample(one) for one in value[:3]]
    if isinstance(value, str):
        value = Path(value).name if Path(value).is_absolute() else value
        return value if len(value) <= LONGEST else f"{value[: LONGEST - 3]}..."
    return float(f"{value:.3g}") if isinstance(value, float) else value


def _merged(objects: list[dict[str, Any]]) -> dict[str, Any]:
    """Return an object with every key of several, and for each the first value that tells most."""
    keys = dict.fromkeys(key for one in objects for key in one)
    merged = {}
    for key in keys:
        values = [one[key] for one in objects if key in one]
        inner = [one for one in values if isinstance(one, dict)]
        lists = [item for one in values if isinstance(one, list) for item in one]
        if inner:
            merged[key] = _merged(inner)
        elif lists:
            merged[key] = lists if all(isinstance(one, dict) for one in lists) else lists[:3]
        else:
            merged[key] = next((one for one in values if one is not None), values[0])
    return merged


def keys_of(value: Any, before: str = "") -> Iterator[str]:
    """Yield the path of every key: `runs[].label`."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield f"{before}{key}"
            yield from keys_of(inner, f"{before}{key}.")
    elif isinstance(value, list):
        for inner in value:
            yield from keys_of(inner, f"{before.removesuffix('.')}[].")


def shortened(samples: Mapping[str, Any]) -> dict[str, Any]:
    """Replace each value that has the keys of an earlier one of its name by "as in COMMAND"."""
    earlier: dict[tuple[str, str], set[str]] = {}

    def short(key: str, value: Any, command: str) -> Any:
        keys, inner = set(keys_of(value)), _each(value, lambda name, part: short(name, part, command))
        if len(keys) < FEWEST:
            return inner
        for (name, other), theirs in earlier.items():
            if name == key and theirs == keys:
                return f"{AS_IN}{other}"
        earlier.setdefault((key, command), keys)
        return inner

    return {command: short("", value, command) for command, value in samples.items()}


def in_full(samples: Mapping[str, Any]) -> dict[str, Any]:
    """Undo `shortened`."""
    earlier: dict[tuple[str, str], Any] = {}

    def full(key: str, value: Any, command: str) -> Any:
        if isinstance(value, str) and value.startswith(AS_IN):
            return earlier[key, value.removeprefix(AS_IN)]
        value = _each(value, lambda name, part: full(name, part, command))
        if len(set(keys_of(value))) >= FEWEST:
            earlier.setdefault((key, command), value)
        return value

    return {command: full("", value, command) for command, value in samples.items()}


def _each(value: Any, change: Callable[[str, Any], Any]) -> Any:
    """Change what the keys of an object, or of the objects of a list, stand for."""
    if isinstance(value, dict):
        return {key: change(key, inner) for key, inner in value.items()}
    return [_each(inner, change) for inner in value] if isinstance(value, list) else value


def samples_on(page: str) -> dict[str, Any]:
    """Return the sample that a page shows for each command, in full, by the command's name."""
    sections = re.split(r"^## maurice-replay ", page, flags=re.MULTILINE)[1:]
    found = {}
    for section in sections:
        block = re.search(r"```json\n(.*?)\n```", section, re.DOTALL)
        if block is not None:
            found[section.splitlines()[0]] = json.loads(block[1].replace("\n", " "))
    return in_full(found)
