"""Make the sections of commands in docs/commands.md: .venv/bin/python docs/make_commands.py.

Descriptions, options and defaults come from the commands themselves, samples of JSON from running them on a
small drive: half a minute. What stands before and after the two marks of the page is written by hand.
"""

from __future__ import annotations

import json
import os
import re
import sys
import tempfile
import textwrap
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import typer

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from helpers.json_outputs import (  # noqa: E402
    WORDS,
    output_of,
    sample,
    samples_on,
    shortened,
    write_material,
)
from maurice_viz.cli.app import COMMANDS, help_record, load, name_of  # noqa: E402

PAGE = ROOT / "docs" / "commands.md"
BEGIN, END = "<!-- commands: made by docs/make_commands.py -->", "<!-- end of commands -->"
WIDTH = 118
SHARED = 3  # commands that have an option in the same words: it is described once
COMMON = "Options of several commands"
DEFAULT = re.compile(r"\s*\[default: ([^\]]*)\]")
REQUIRED = re.compile(r"\s*\[required\]")
RANGE = re.compile(r"\s*\[(-?[\d.]+ to|at least) -?[\d.]+\]")
PAGES = re.compile(r"docs/([\w-]+)\.md")


def made(page: str, samples: Mapping[str, Any]) -> str:
    """Return the page with the sections of all commands as they are now."""
    before, rest = page.split(BEGIN)
    after = rest.split(END)[1]
    commands = {name: _rows(name) for name in COMMANDS}
    counts = Counter(text for rows in commands.values() for text in rows.values())
    shared = {
        name: text for rows in commands.values() for name, text in rows.items() if counts[text] >= SHARED
    }
    shown = shortened({name: samples[name] for name in commands if name in samples})
    parts = [section(name, rows, shared, shown.get(name)) for name, rows in commands.items()]
    parts.append("\n".join([f"## {COMMON}", "", *shared.values(), "", ""]))
    return f"{before}{BEGIN}\n\n{''.join(parts)}{END}{after}"


def section(name: str, rows: Mapping[str, str], shared: Mapping[str, str], shown: Any) -> str:
    """Return what is to be known of a command: its words, what it does, its options, its JSON."""
    command, page = load(COMMANDS[name]), COMMANDS[name].page
    text = "\n\n".join(" ".join(part.split()) for part in (command.help or "").split("\n\n"))
    see = f" See [{page}]({page}.md)." if page else ""
    words = " ".join(("maurice-replay", name, *(name_of(one) for one in command.params if _is_argument(one))))
    own = [row for row in rows.values() if row not in shared.values()]
    common = ", ".join(f"`{option}`" for option, row in rows.items() if row in shared.values())
    lines = [f"## maurice-replay {name}", "", f"`{words}`: {_linked(text)}{see}", "", *own]
    if common:
        lines.append(f"* {common}: [{COMMON.lower()}](#{COMMON.lower().replace(' ', '-')})")
    if shown is not None:
        lines += ["", "```json", *json_lines(shown), "```"]
    return "\n".join(lines) + "\n\n"


def _rows(name: str) -> dict[str, str]:
    """Return the rows of a command's arguments and options, by their first name."""
    command = load(COMMANDS[name])
    context = typer.Context(command, info_name=name)
    named = {name_of(one) if _is_argument(one) else max(one.opts, key=len): one for one in command.params}
    return {name: row(one, context) for name, one in named.items() if one.name != "help"}


def _is_argument(parameter: Any) -> bool:
    return bool(parameter.param_type_name == "argument")


def row(parameter: Any, context: typer.Context) -> str:
    """Return an option or argument as a line: what it means, and its default."""
    parameter.hidden, hidden = False, getattr(parameter, "hidden", False)
    record = help_record(parameter, context)
    assert record is not None
    words, text = record
    parameter.hidden = hidden
    default = DEFAULT.search(text)
    usual = default[1].split(";")[0].strip("()") if default else "required" if parameter.required else ""
    for pattern in (DEFAULT, REQUIRED, RANGE):
        text = pattern.sub("", text)
    text = _linked(" ".join(text.split()))
    return f"* `{words}`: {text}" + (f" *{usual}*" if usual else "")


def _linked(text: str) -> str:
    return PAGES.sub(r"[\1](\1.md)", text)


def json_lines(value: Any) -> list[str]:
    """Write JSON in full lines; a text is never broken."""
    text = json.dumps(_hidden(value), ensure_ascii=False)
    lines = textwrap.wrap(text, WIDTH, break_long_words=False, break_on_hyphens=False)
    return [line.replace("\u00a0", " ") for line in lines]


def _hidden(value: Any) -> Any:
    """Hide the blanks of texts from the breaking of lines."""
    if isinstance(value, dict):
        return {key: _hidden(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_hidden(inner) for inner in value]
    return value.replace(" ", "\u00a0") if isinstance(value, str) else value


def main() -> None:
    """Run what prints JSON, and write the page."""
    page = PAGE.read_text(encoding="utf-8")
    if "--options-only" in sys.argv:
        samples = samples_on(page)
    else:
        with tempfile.TemporaryDirectory() as name:
            os.chdir(name)
            write_material(Path())
            samples = {command: sample(output_of(command)) for command in WORDS}
    PAGE.write_text(made(page, samples), encoding="utf-8")
    print(PAGE)


if __name__ == "__main__":
    main()
