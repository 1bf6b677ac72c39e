"""The thesis's figures 13 and 14: a covered-lens frame, stretched, and the histogram of its noise."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from maurice_mcl.calibrate_noise import COLORS, NoiseFloor, stretched
from maurice_mcl.channels.histogram import BINS, LOW, WIDTH

from .plots_figure import RGB, dress, save


def draw_noise(floor: NoiseFloor, file: Path, *, force: bool) -> None:
    """Write both figures side by side into one PNG. LogError when it exists and `force` is not given."""
    from matplotlib.figure import Figure

    made = Figure(figsize=(11.0, 4.6), layout="constrained")
    left, right = made.subplots(1, 2, width_ratios=(1, 1.35))
    left.imshow(stretched(floor.example), interpolation="nearest")
    low, high = int(floor.example.min()), int(floor.example.max())
    dress(left, f"Lens covered, values {low} to {high} stretched", "column (pixels)", "row (pixels)")
    left.grid(False)
    dress(right, f"Noise, mean of {_frames(floor.frames)}", "pixel value", "256 x share of pixels")
    means, sds = floor.mean.reshape(3, BINS), floor.sd.reshape(3, BINS)
    start = LOW + WIDTH * np.arange(BINS)
    for k, (name, color) in enumerate(zip(COLORS, RGB, strict=True)):
        at = start + WIDTH * (0.2 + 0.3 * k)
        bars = sds[k] if np.isfinite(sds[k]).all() else None
        right.bar(at, means[k], 0.3 * WIDTH, color=color, label=name, yerr=bars, ecolor="#33363D")
    right.set_xticks(np.arange(LOW, LOW + WIDTH * BINS + 1, 4 * WIDTH))
    right.set_ylim(bottom=0)
    made.legend(loc="outside lower right", ncols=3, frameon=False)
    save(made, file, force=force)


def _frames(count: int) -> str:
    return "1 frame" if count == 1 else f"{count} frames; lines: sd between frames"
