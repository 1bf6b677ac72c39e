"""Which numbers of the rules and the scores can change without a test that fails: each is made 1.3 times.

    python -m benchmarks.studies.mutants                 # every constant of mcl/reasons and mcl/scoring
    python -m benchmarks.studies.mutants LONG_GAP        # some of them, by name

A constant is a number under a name in capital letters at the top of a file; an entry of a table counts by
itself, an integer grows by one at least. No file is changed: the tests get the mutant in their process.
"""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from collections.abc import Iterator
from importlib.machinery import SourceFileLoader
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
FOLDERS = ("mcl/reasons", "mcl/scoring")
QUICK = (
    "tests/mcl/reasons/test_thresholds.py",
    "tests/mcl/reasons/test_reason_thresholds.py",
    "tests/mcl/scoring/test_thresholds.py",
)
TESTS = ("tests/mcl/reasons", "tests/mcl/scoring", "tests/golden")
TIMES, ASKED = 1.3, "MAURICE_MUTANT"  # FILE:NUMBER of the constant


def main() -> None:
    names, lived, count = set(sys.argv[1:]), list[str](), 0
    for file in sorted(path for folder in FOLDERS for path in (ROOT / folder).glob("*.py")):
        for number, (name, constant) in enumerate(constants_of(ast.parse(file.read_text(encoding="utf-8")))):
            if names and name not in names:
                continue
            count += 1
            where = f"{file.relative_to(ROOT)}:{constant.lineno} {name} {constant.value!r}"
            if _lives(f"{file}:{number}"):
                lived.append(where)
            print(f"{'LIVES ' if where in lived else 'killed'} {where}", flush=True)
    print(f"{len(lived)} of {count} live")


def constants_of(tree: ast.Module) -> Iterator[tuple[str, ast.Constant]]:
    """Yield each number that a file assigns to a name in capital letters at its top, with the name."""
    for node in tree.body:
        if not isinstance(node, (ast.Assign, ast.AnnAssign)) or node.value is None:
            continue
        (target,) = node.targets if isinstance(node, ast.Assign) else (node.target,)
        names, values = [target], [node.value]
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
            names, values = target.elts, node.value.elts
        for name, value in zip(names, values, strict=True):
            if isinstance(name, ast.Name) and name.id.isupper():
                yield from ((name.id, one) for one in ast.walk(value) if _is_number(one))


def _is_number(node: ast.AST) -> Any:
    return (
        isinstance(node, ast.Constant) and type(node.value) in (int, float) and node.value not in (0, 1 << 30)
    )


def _lives(mutant: str) -> bool:
    """Return whether all tests pass with a mutant; the quickest are asked first."""
    env = os.environ | {ASKED: mutant, "PYTHONPATH": str(ROOT)}
    words = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-x",
        "-p",
        "benchmarks.studies.mutants",
        "-p",
        "no:cacheprovider",
    ]
    return all(
        subprocess.run(
            [*words, "-m", "not slow", *some], cwd=ROOT, env=env, capture_output=True, check=False
        ).returncode
        == 0
        for some in (QUICK, TESTS)
    )


def _mutated(self: SourceFileLoader, fullname: str) -> Any:
    """Load a module with its constant changed."""
    file, _, number = os.environ[ASKED].rpartition(":")
    path = self.get_filename(fullname)
    if Path(path).resolve() != Path(file).resolve():
        return _get_code(self, fullname)
    tree = ast.parse(Path(path).read_text(encoding="utf-8"))
    _, constant = list(constants_of(tree))[int(number)]
    value = constant.value
    assert isinstance(value, (int, float))
    constant.value = max(round(TIMES * value), value + 1) if isinstance(value, int) else TIMES * value
    return compile(tree, path, "exec")


_get_code = SourceFileLoader.get_code
if ASKED in os.environ and __name__ != "__main__":  # as a plugin of pytest
    SourceFileLoader.get_code = _mutated  # type: ignore[method-assign]

if __name__ == "__main__":
    main()
