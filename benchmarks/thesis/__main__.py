"""The thesis told again (`make thesis`): its figures, and its claims beside our numbers.

maurice-replay trials run thesis -o out/trials/thesis --resume
python -m benchmarks.thesis out/trials/thesis -o out/thesis           # figure-26.png and so on, and claims.md
python -m benchmarks.thesis out/trials/thesis -o out/thesis --write   # and what docs/thesis.md shows of them
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path

from maurice_datasets.trials.rows import expect_trials
from maurice_loaders.errors import InputError

from .claims import CLAIMS
from .drawn import FORMATS, draw_figures
from .material import Material, MissingRuns
from .success import exact_table
from .timing import measure, read_timing
from .verdicts import Samples, judged, write_evidence

DOCS = Path(__file__).parents[2] / "docs"
ROUNDS, QUICK = 5, (1, 2)  # of measuring times; and on how many drives
EVIDENCE = Path(__file__).parent / "evidence.parquet"  # what the verdicts of docs/thesis.md are made from
SHOWN = (26, 58, 68)  # pictures of docs/thesis.md


def main() -> None:
    """Draw and judge what was asked for."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.thesis", description=__doc__)
    parser.add_argument("trials", type=Path, help="a folder that `maurice-replay trials run` has made")
    parser.add_argument("-o", "--output", type=Path, required=True, help="the folder of figures and claims")
    parser.add_argument("--only", type=int, nargs="*", default=[], metavar="NUMBER", help="figures to draw")
    parser.add_argument("--format", nargs="*", default=["png"], choices=FORMATS)
    parser.add_argument("--write", action="store_true", help="put the claims into docs/thesis.md")
    parser.add_argument("--quick", action="store_true", help="measure times with few rounds")
    asked = parser.parse_args()
    try:
        expect_trials(asked.trials)
        if read_timing(asked.trials) is None:
            # a minute, before the processes that draw: alone on the machine
            measure(asked.trials, *(QUICK if asked.quick else (ROUNDS,)))
        drawn = draw_figures(asked.trials, asked.output, only=asked.only, formats=asked.format, force=True)
        material = Material(asked.trials)
        evidence = {claim.name: claim.samples(material) for claim in CLAIMS}
        tables = {"claims": claims_table(evidence), "exact": _exact(material)}
        if asked.write:
            draw_figures(asked.trials, DOCS / "pictures", only=SHOWN, force=True)
    except InputError as problem:
        sys.exit(f"error: {problem}")
    text = "\n\n".join(tables.values()) + "\n"
    (asked.output / "claims.md").write_text(text, encoding="utf-8")
    for number, why in drawn.left_out:
        print(f"figure {number} left out: {why}")
    print(f"{len(drawn.files)} figures and claims.md written to {asked.output}")
    write_evidence(asked.output / EVIDENCE.name, evidence)
    if asked.write:
        write_evidence(EVIDENCE, evidence)
        write(tables)


def _exact(material: Material) -> str:
    try:
        return exact_table(material)
    except MissingRuns as problem:
        return f"{problem}"


def claims_table(evidence: Mapping[str, Samples]) -> str:
    """Return every claim with its verdict, as a Markdown table; what is not tested last."""
    lines = ["| claim | verdict | true if | here | n |", "|---|---|---|---|---|"]
    return "\n".join([*lines, *(result.row() for result in judged(CLAIMS, evidence))])


def write(tables: dict[str, str]) -> None:
    """Put tables between their marks in docs/thesis.md."""
    page = DOCS / "thesis.md"
    text = page.read_text(encoding="utf-8")
    for name, table in tables.items():
        before, mark, rest = text.partition(f"<!-- {name} -->\n")
        after = rest[rest.index("<!-- end -->") :]
        text = f"{before}{mark}\n{table}\n\n{after}"
    page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
