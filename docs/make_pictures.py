"""Make the pictures of the documentation with the real viewer: .venv/bin/python docs/make_pictures.py.

Needs a software Vulkan driver (apt-get install mesa-vulkan-drivers libvulkan1).
"""

from __future__ import annotations

import contextlib
import io
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from maurice_datasets.demos import demo_paths, kidnapping_paths
from maurice_viz.viewer.snapshot import headless_viewer

HERE = Path(__file__).resolve().parent / "pictures"
COMMAND = [sys.executable, "-c", "from maurice_viz.cli.main import main; main()"]
FOUND = 43  # step of the demo at which one of the two filters is localized again
ASTRAY, BACK = 38, 56  # steps of `demo features` that docs/tutorial.md describes
RULED_OUT = 25  # a step at which the robot is where a table was at the survey, of docs/landmarks.md
AGREED = 60  # a step of the demo at which some landmarks agree, of docs/landmarks.md
RESAMPLE = 3  # its slot on the timeline `phase`
# of docs/layouts.md: which layout, where on which timeline
LAYOUTS = (
    ("overview", "step", ASTRAY),
    ("inside-a-step", "phase", 6 * ASTRAY + RESAMPLE),
    ("explain", "step", ASTRAY),
    ("traces", "step", ASTRAY),
)


def maurice(*args: str, folder: Path | None = None) -> None:
    subprocess.run([*COMMAND, *args], check=True, capture_output=True, cwd=folder)


def keep(name: str, png: bytes) -> None:
    """Write a picture small: as PNG with 256 colors, or as JPEG, whichever its name says."""
    image = Image.open(io.BytesIO(png)).convert("RGB")
    if name.endswith(".png"):
        few_colors(image).save(HERE / name, optimize=True)
    else:
        image.save(HERE / name, quality=82, optimize=True)
    print(HERE / name)


def few_colors(image: Image.Image) -> Image.Image:
    """Choose 256 colors so that rare ones keep theirs, as those of a key do."""
    pixels = np.asarray(image).reshape(-1, 3)
    _, which, counts = np.unique(pixels >> 4, axis=0, return_inverse=True, return_counts=True)
    means = np.stack([np.bincount(which, pixels[:, k]) / counts for k in range(3)], axis=1)
    weighed = np.repeat(means.round().astype(np.uint8), np.ceil(counts**0.3).astype(int), axis=0)
    palette = Image.fromarray(weighed[None]).quantize(256, method=Image.Quantize.MEDIANCUT)
    return image.quantize(palette=palette, dither=Image.Dither.NONE)


def drive_alone(demo: Path, folder: Path) -> Path:
    """Record the demo's drive as one that no library goes with."""
    log = shutil.copytree(demo, folder / "drive") / "session.log"
    header, rest = log.read_text(encoding="utf-8").split("\n", 1)
    kept = {key: value for key, value in json.loads(header).items() if key != "survey"}
    log.write_text(f"{json.dumps(kept)}\n{rest}", encoding="utf-8")
    maurice(str(log.relative_to(folder)), "-o", "alone.rrd", folder=folder)
    return folder / "alone.rrd"


def as_recorded(run: str, folder: Path) -> Path:
    """Record a run as another localizer's: from the particles in its MCAP export."""
    bag, recording = folder / "run.mcap", folder / "recorded.rrd"
    maurice("export", run, "-o", str(bag))
    maurice(str(bag), "--as-recorded", "-o", str(recording))
    return recording


def diagnosis(folder: Path) -> Path:
    """Draw the first screen of the demo's kidnapped drive, at the step that its diagnosis names."""
    kept, pictures = folder / "kidnapped", folder / "diagnosis"
    log = str(kidnapping_paths().session)
    maurice("replay", log, "--feature", "best", "--save-run", str(kept), "-o", "none")
    maurice("diagnose", str(kept), "-o", str(pictures))
    return pictures / "best-step-41-kidnapped.png"


def ambiguity(folder: Path) -> Path:
    """Draw where a library from one drive is ambiguous."""
    drive, library, drawn = folder / "survey-drive", folder / "library", folder / "ambiguity.png"
    maurice("simulate", "tracking", "--updates", "400", "--seed", "5", "-o", str(drive))
    maurice("library", "build", str(drive / "session.log"), "-o", str(library), "--every", "0.4m,45deg")
    maurice("library", "check", str(library), "-o", str(drawn))
    return drawn


def ruled_out(folder: Path) -> Path:
    """Record a drive on which the robot is where the map has a table, which was carried away."""
    drive, recording = folder / "moved", folder / "moved.rrd"
    told = ("--moved", "3", "--updates", "100", "--seed", "13", "--arena-seed", "1")
    maurice("simulate", "tracking", *told, "-o", str(drive))
    solid = ("--preset", "precise", "--set", "map.obstacles=solid", "--particles", "1000")
    maurice("replay", str(drive / "session.log"), *solid, "-o", str(recording))
    return recording


def sensors(session: str, folder: Path) -> None:
    """Draw what landmarks show, and a map that rules the truth out."""
    landmarks = folder / "landmarks.rrd"
    maurice("replay", session, "--preset", "precise", "--layout", "sensors", "-o", str(landmarks))
    with headless_viewer(landmarks) as viewer:
        keep("layout-sensors.jpg", viewer.picture("step", AGREED))
    with headless_viewer(ruled_out(folder)) as viewer:
        keep("ruled-out.jpg", viewer.picture("step", RULED_OUT))


def main() -> None:
    HERE.mkdir(exist_ok=True)
    session = str(demo_paths(0).session)
    # in that folder, so that commands in the pictures name files as a reader has them
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        told, both, one, kept, explained = ("demo.rrd", "features.rrd", "session.rrd", "kept", "explain.png")
        maurice("demo", "-o", told)
        maurice("demo", "features", "-o", both)
        alone = drive_alone(Path(session).parent, Path())
        with headless_viewer(alone) as viewer:
            keep("drive.png", viewer.picture("step", ASTRAY))
        maurice("replay", session, "--feature", "blended", "--save-run", kept, "-o", one)
        maurice("explain", kept, "--step", str(ASTRAY), "-o", explained)
        keep("explain.png", Path(explained).read_bytes())
        keep("diagnose.jpg", diagnosis(Path()).read_bytes())
        keep("ambiguity.png", ambiguity(Path()).read_bytes())
        sensors(session, Path())
        with headless_viewer(as_recorded(kept, Path())) as viewer:
            keep("as-recorded.png", viewer.picture("step", ASTRAY))
        with headless_viewer(Path(told)) as viewer:
            keep("story.png", viewer.picture("step", FOUND))
        with headless_viewer(Path(both)) as viewer:
            viewer.show_layout("compare")
            keep("compare.png", viewer.picture("step", ASTRAY))
        with headless_viewer(Path(one)) as viewer:
            viewer.show_layout("overview")
            keep("phase-resample.png", viewer.picture("phase", 6 * BACK + RESAMPLE))
            for layout, timeline, place in LAYOUTS:
                viewer.show_layout(layout)
                keep(f"layout-{layout}.jpg", viewer.picture(timeline, place))


if __name__ == "__main__":
    main()
