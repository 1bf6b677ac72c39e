"""Put what trials show into docs/thesis.md: .venv/bin/python docs/make_trials.py TRIALS.

TRIALS is a folder that `maurice-replay trials thesis -o TRIALS` has made.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from maurice_viz.plots.drawn import draw_figures
from maurice_viz.plots.material import Material
from maurice_viz.reports.claims import CLAIMS, judged

HERE = Path(__file__).parent
SHOWN = (26, 37, 58, 68)  # pictures of the page


def main() -> None:
    trials = Path(sys.argv[1])
    material, page = Material(trials), HERE / "thesis.md"
    lines = ["| claim | thesis | here | verdict |", "|---|---|---|---|"]
    results = judged([one.check(material) for one in CLAIMS])
    for one, found in zip(CLAIMS, results, strict=True):
        lines.append(f"| {one.name} ({one.section}) | {one.stated} | {found.ours} | {found.verdict} |")
    told = "\n".join(lines)
    text = page.read_text(encoding="utf-8")
    text = re.sub(r"(<!-- claims -->\n).*?(<!-- end -->)", rf"\1\n{told}\n\n\2", text, flags=re.DOTALL)
    page.write_text(text, encoding="utf-8")
    draw_figures(trials, HERE / "pictures", only=SHOWN, force=True)


if __name__ == "__main__":
    main()
