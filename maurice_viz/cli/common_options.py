"""Options that `replay` and `compare` share: about every run, and about what comes of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..layouts.names import DETAILS
from .gathering import Command, in_place_of
from .options import (
    ForceOption,
    HeadlessOption,
    JsonOption,
    KeepGoingOption,
    LayoutOption,
    LibraryOption,
    MotionOption,
    NoRecordingOption,
    OutputOptions,
    ParticlesOption,
    RunOption,
    RunOptions,
    SaveOption,
    SharpnessOption,
    StartOption,
)

COMMON = {
    "library": (LibraryOption, None),
    "particles": (ParticlesOption, None),
    "start": (StartOption, None),
    "sharpness": (SharpnessOption, None),
    "motion": (MotionOption, None),
    "save": (SaveOption, None),
    "run": (RunOption, None),
    "layout": (LayoutOption, None),
    "headless": (HeadlessOption, False),
    "no_recording": (NoRecordingOption, False),
    "force": (ForceOption, False),
    "keep_going": (KeepGoingOption, False),
    "json_output": (JsonOption, False),
}


@dataclass(frozen=True, slots=True)
class CommonOptions:
    """The shared options, as typed."""

    library: Path | None
    particles: int | None
    start: str | None
    sharpness: float | None
    motion: Path | None
    save: Path | None
    run: Path | None
    layout: str | None
    headless: bool
    no_recording: bool
    force: bool
    keep_going: bool
    json_output: bool

    def of_runs(self, seed: int = 0, resampler: str | None = None, config: Path | None = None) -> RunOptions:
        """Give what was asked of every run, with what a command asks in its own way."""
        return RunOptions(seed, self.start, self.particles, resampler, self.sharpness, self.motion, config)

    def of_output(self, stem: str, detail: str = DETAILS[0]) -> OutputOptions:
        """Give where the result goes; `stem` names the recording where no --save does."""
        return OutputOptions(
            stem,
            self.save,
            self.headless,
            self.no_recording,
            self.force,
            self.json_output,
            self.run,
            self.layout,
            detail,
        )


def runs_a_filter(command: Command) -> Command:
    """Give a command all shared options, in place of its parameter `common`."""
    return in_place_of("common", COMMON, CommonOptions, command)
