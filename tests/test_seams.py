"""What adding one thing touches: one of each is added to a copy of the tree, used, and its files are counted.

CONTRIBUTING.md says the same numbers. Documentation, tests and settings of its own come on top.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("mcl", "loaders", "datasets", "maurice_viz")

# Of each thing: the files that are touched. A text is a new file, pairs are (anchor, what comes before it).
Edits = str | tuple[tuple[str, str], ...]
ADDED: dict[str, dict[str, Edits]] = {
    "channel": {
        "mcl/sensor/descriptors/lightness.py": """
import numpy as np

class Lightness:
    name, distance, unit = "lightness", "l1", "gray levels"

    def describe(self, image):
        return image.mean(axis=(0, 1)).astype(np.float32)

    def parameters(self):
        return {"feature": "mean of each color plane"}
""",
        "mcl/sensor/descriptors/registry.py": (
            ("from .tiny import", "from .lightness import Lightness\n"),
            ("    Tiny(),\n", "    Lightness(),\n"),
        ),
    },
    "resampler": {
        "mcl/filter/resampling.py": (
            (
                "RESAMPLERS: Mapping",
                "def heaviest(weights, n, rng):\n    return np.full(n, weights.argmax(), np.int32)\n\n\n",
            ),
            ('    "multinomial": multinomial,', '    "heaviest": heaviest,\n'),
        )
    },
    "recovery strategy": {
        "mcl/filter/recovery.py": (
            (
                "STRATEGIES: Mapping",
                "def at_first(settings):\n"
                "    return lambda evidence, state: Recovery(settings.share, state)\n\n\n",
            ),
            ('    "none": lambda', '    "at_first": at_first,\n'),
        )
    },
    "motion model": {
        "mcl/filter/motion.py": (
            (
                "# by name: what reads",
                "class Standing:\n"
                "    def move(self, poses, origin, motion, noise):\n        return poses\n\n\n",
            ),
            ('    "maurice": (', '    "standing": (dict, lambda values, grid: Standing()),\n'),
        )
    },
    "format": {
        "loaders/formats/two.py": """
from .registry import Format
from .tum import open_trajectory

FORMATS = (Format("two", "poses in a file.two", lambda path: path.suffix == ".two", open_trajectory),)
""",
        "loaders/formats/registry.py": (('    ".tum",', '    ".two",\n'),),
    },
    "panel": {
        "maurice_viz/panels/clock.py": """
import rerun as rr
import rerun.blueprint as rrb

from .panel import Panel, set_phase
from ..entities import Phase

class ClockPanel(Panel):
    @classmethod
    def view(cls, run, scene):
        return rrb.TextLogView(name="Clock", origin="clock")

    def draw(self, rec, update):
        set_phase(rec, update.moment, Phase.MEASURE)
        rec.log("clock", rr.TextLog(f"{update.moment.frame.time_s} s"))
""",
        "maurice_viz/panels/registry.py": (
            ("from .events import", "from .clock import ClockPanel\n"),
            ("    WordsPanel,\n)", "    ClockPanel,\n"),
        ),
    },
    "event": {
        "mcl/scoring/events.py": (
            ("    RESEEDED: EventKind(", '    "new-step": EventKind("there is another step", NEUTRAL),\n'),
            (
                "        if RESEEDED in record.events:\n            yield",
                '        yield "new-step", f"{size} particles"\n',
            ),
        )
    },
    "command": {
        "maurice_viz/cli/hello.py": '''
from .shared.console import results

def hello() -> None:
    """Greet."""
    results.print("hello there")
''',
        "maurice_viz/cli/app.py": (
            ('        Listed("replay", ', '        Listed("hello", "hello", "Greet."),\n'),
        ),
    },
}
FILES = {
    "channel": 2,
    "resampler": 1,
    "recovery strategy": 1,
    "motion model": 1,
    "format": 2,
    "panel": 2,
    "event": 1,
    "command": 2,
}
USED = """
import sys
from pathlib import Path

import maurice_loaders as ml
import maurice_mcl as mcl
import maurice_viz as mv
from maurice_mcl.config.parameters import Layer, configure
from maurice_viz.layouts.registry import tabs_of
from maurice_viz.scene import RunView, Scene

library, session = mcl.tiny_library(), mcl.tiny_session()
settings = {"resampling.scheme": "heaviest", "recovery.strategy": "at_first"}
localizer = mcl.make_localizer(library, particles=40, settings=settings, motion={"model": "standing"})
records = [record for _, record in mcl.run(localizer, session)]
assert all(len(set(record.parents.tolist())) == 2 for record in records)  # the heaviest, and -1: fresh
assert all(record.injected.sum() == 2 for record in records)
assert (records[1].predicted.poses == records[0].belief.poses).all()
weights = Layer("test", {"sensor.weights": {"lightness": 1}})
assert dict(configure([weights]).parameters.sensor.weights) == {"lightness": 1}

drive, out = Path(sys.argv[1]), Path("out.rrd")
Path("path.two").write_text("".join(f"{t} {t / 10} 0 0 0 0 0 1\\n" for t in range(5)))
assert mv.inspect("path.two").format == "two"
mv.replay(drive, filter=mv.Filter("lightness", particles=20), to=out, save_run="run")
assert b"clock" in out.read_bytes()
shown = RunView.of("run", localizer), Scene(session.info, library, has_truth=True)
assert tabs_of([shown[0]], shown[1])[1][-1] == "more"  # where views of panels' own are seen
events = mv.events("run")
assert any(event.kind == "new-step" for run in events.runs for event in run.events)

from maurice_viz.cli.main import main
sys.argv = ["maurice-replay", "hello"]
main()
"""


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """The tree with one thing of each kind more, importable under the names that it installs as."""
    copy = tmp_path_factory.mktemp("tree")
    for package in PACKAGES:
        shutil.copytree(ROOT / package, copy / package, ignore=shutil.ignore_patterns("__pycache__"))
    links = copy / "links"
    links.mkdir()
    for package in PACKAGES:
        name = package if package == "maurice_viz" else f"maurice_{package}"
        (links / name).symlink_to(copy / package)
    for thing in ADDED.values():
        for file, edits in thing.items():
            path = copy / file
            if isinstance(edits, str):
                assert not path.exists()
                path.write_text(edits)
                continue
            text = path.read_text()
            for anchor, addition in edits:
                assert text.count(anchor) == 1, (file, anchor)
                text = text.replace(anchor, addition + anchor)
            path.write_text(text)
    return copy


def test_one_of_each_is_added_and_used(copy, small_session, tmp_path):
    links = {"PYTHONPATH": str(copy / "links")}
    words = [sys.executable, "-c", USED, str(small_session)]
    done = subprocess.run(
        words, cwd=tmp_path, env=os.environ | links, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.strip().endswith("hello there")


@pytest.mark.parametrize("thing", ADDED)
def test_the_files_that_it_touches(thing):
    assert len(ADDED[thing]) == FILES[thing]


def test_contributing_says_the_same_numbers():
    text = (ROOT / "CONTRIBUTING.md").read_text()
    rows = dict(re.findall(r"^\| ([a-z ]+) \| (\d) \|", text, re.M))
    assert {name: int(count) for name, count in rows.items()} == FILES
