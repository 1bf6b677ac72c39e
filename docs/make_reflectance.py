"""Drive the example of docs/sensors.md, and make its pictures: .venv/bin/python docs/make_reflectance.py.

What the page shows is what runs: its three files and its Python are taken from it. Needs a software Vulkan
driver for the viewer's picture (apt-get install mesa-vulkan-drivers libvulkan1).
"""

from __future__ import annotations

import argparse
import io
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator
from PIL import Image

import maurice_loaders as ml
import maurice_mcl as mcl
from maurice_mcl.arrays import F64
from maurice_viz.viewer.snapshot import headless_viewer

HERE = Path(__file__).parent
COMMAND = [sys.executable, "-c", "from maurice_viz.cli.main import main; main()"]
SHOWN = 150  # a step at which the robot is found
BEGIN, FOUND_M, KEPT = "## A robot with two downward sensors", 0.1, 30
FILES = ("floor.yaml", "probes.toml")


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """One run, update by update."""

    driven_m: F64  # (U,)
    poses: F64  # (U, 3) estimates
    truth: F64  # (U, 3)

    @property
    def off_m(self) -> F64:
        """Distance of the estimate from the truth (U,)."""
        return np.asarray(np.hypot(*(self.poses - self.truth)[:, :2].T))

    @property
    def found(self) -> int | None:
        """The first update from which the error stays below 10 cm for 30 updates; None: never."""
        near = self.off_m < FOUND_M
        return next((k for k in range(len(near) - KEPT) if near[k : k + KEPT].all()), None)


def example(folder: Path) -> tuple[Path, Path]:
    """Write the files of the page, run its Python and `library build`; return drive and library."""
    page = (HERE / "sensors.md").read_text(encoding="utf-8")
    section = page[page.index(BEGIN) :]
    blocks = re.findall(r"```(\w+)\n(.*?)```", section, re.DOTALL)[: len(FILES) + 1]
    for name, (_, text) in zip(FILES, blocks, strict=False):
        (folder / name).write_text(text, encoding="utf-8")
    (folder / "drive.py").write_text(blocks[-1][1], encoding="utf-8")
    subprocess.run([sys.executable, "drive.py"], cwd=folder, check=True)
    given = ("--floor", "floor.yaml", "--probes", "probes.toml", "-o", "floor-library", "--force")
    subprocess.run([*COMMAND, "library", "build", "floor.log", *given], cwd=folder, check=True)
    return folder / "floor.log", folder / "floor-library"


def run_once(library: mcl.Library, drive: Path, seed: int) -> Run:
    """Run the filter over the drive, started anywhere."""
    session = ml.open_session(drive)
    localizer = mcl.make_localizer(library, seed=seed)
    rows, ways = [], [0.0]
    for moment, record in mcl.run(localizer, session, start=None):
        ways.append(ways[-1] + float(np.hypot(*moment.frame.motions[:, :2].T).sum()))
        assert moment.truth is not None
        rows.append([record.estimate.pose, moment.truth])
    poses: F64 = np.array(rows, np.float64)
    return Run(np.array(ways[1:]), poses[:, 0], poses[:, 1])


def drawn(library: mcl.Library, runs: list[Run]) -> Figure:
    """Draw the first run on the print, and the errors of all over the way."""
    figure = Figure(figsize=(11, 4.4), layout="constrained")
    on_print, over_way = figure.subplots(1, 2)
    floor, first = library.sensors["reflectance"].floor, runs[0]  # type: ignore[attr-defined]
    x_min, y_min, x_max, y_max = floor.bounds
    image = 0.35 + 0.3 * floor.values  # so that a white line is seen on it
    on_print.imshow(image, cmap="gray", vmin=0, vmax=1, origin="lower", extent=(x_min, x_max, y_min, y_max))
    on_print.plot(*first.truth[:, :2].T, color="white", linewidth=2.5, label="truth")
    since = first.found or 0
    on_print.plot(*first.poses[since:, :2].T, color="tab:orange", linewidth=1.2, label="estimate, once found")
    on_print.plot(*first.truth[0, :2], "o", color="white", markersize=5)
    on_print.set(xlabel="x (m)", ylabel="y (m)", title="The print, and the drive over it")
    on_print.legend(facecolor="0.5", loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=2)
    for number, run in enumerate(runs):
        over_way.plot(run.driven_m, 100 * run.off_m, linewidth=1, alpha=0.8, label=f"seed {number}")
    over_way.axhline(100 * FOUND_M, color="gray", linestyle=":", linewidth=1)
    over_way.set(xlabel="driven (m)", ylabel="position error (cm)", yscale="log", ylim=(0.1, None))
    over_way.yaxis.set_major_locator(FixedLocator([0.1, 1, 10, 100]))
    over_way.yaxis.set_major_formatter("{x:g}")
    over_way.set_title("Error, started anywhere; dotted: 10 cm")
    over_way.legend(fontsize=8)
    over_way.grid(alpha=0.3)
    return figure


def told(runs: list[Run]) -> str:
    """Return how many runs found the robot, after what way, and how far off they were then."""
    found = [(run, run.found) for run in runs]
    ways = [float(run.driven_m[at]) for run, at in found if at is not None]
    after = [float(np.median(run.off_m[at:])) for run, at in found if at is not None]
    if not ways:
        return f"found in 0 of {len(runs)} runs"
    median = f"after {np.median(ways):.2f} m ({min(ways):.2f} to {max(ways):.2f})"
    off = f"{100 * np.median(after):.1f} cm off in the median"
    return f"found in {len(ways)} of {len(runs)} runs {median}, then {off}"


def screenshot(folder: Path, to: Path) -> None:
    """Replay the drive with the real viewer and keep its picture at one step."""
    given = ("--library", "floor-library", "--save", "floor.rrd", "--force")
    subprocess.run([*COMMAND, "replay", "floor.log", *given], cwd=folder, check=True)
    with headless_viewer(folder / "floor.rrd") as viewer:
        png = viewer.picture("step", SHOWN)
    Image.open(io.BytesIO(png)).convert("RGB").save(to, quality=82, optimize=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5, help="runs of the filter")
    parser.add_argument("--work", type=Path, default=Path("out/reflectance"), help="folder of the example")
    parser.add_argument("-o", "--output", type=Path, default=HERE / "pictures")
    parser.add_argument("--no-viewer", action="store_true", help="leave the viewer's picture out")
    given = parser.parse_args()
    given.work.mkdir(parents=True, exist_ok=True)
    drive, folder = example(given.work)
    library = ml.open_library(folder)
    runs = [run_once(library, drive, seed) for seed in range(given.seeds)]
    drawn(library, runs).savefig(given.output / "reflectance.png", dpi=130)
    print(told(runs))
    if not given.no_viewer:
        screenshot(given.work, given.output / "reflectance-viewer.jpg")


if __name__ == "__main__":
    main()
