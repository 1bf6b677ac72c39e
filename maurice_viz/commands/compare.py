"""`maurice-replay compare SESSION --feature color --feature blended`: runs on one drive, side by side."""

from __future__ import annotations

import typer

from maurice_mcl.sensor import DEFAULT_SHARPNESS

from .options import (
    DEFAULT_PARTICLES,
    DEFAULT_RESAMPLER,
    FeaturesOption,
    ForceOption,
    HeadlessOption,
    JsonOption,
    KeepGoingOption,
    LibraryOption,
    MotionOption,
    NoRecordingOption,
    OutputOptions,
    ParticlesOption,
    ResamplerOption,
    RunOptions,
    SaveOption,
    SeedOption,
    SessionArgument,
    SharpnessOption,
    StartOption,
)

COLOR_AND_BLENDED = ["color", "blended"]
MOST_RUNS = 4


def compare(
    session: SessionArgument,
    features: FeaturesOption = COLOR_AND_BLENDED,
    library: LibraryOption = None,
    particles: ParticlesOption = DEFAULT_PARTICLES,
    seed: SeedOption = 0,
    start: StartOption = None,
    resampler: ResamplerOption = DEFAULT_RESAMPLER,
    sharpness: SharpnessOption = DEFAULT_SHARPNESS,
    motion: MotionOption = None,
    save: SaveOption = None,
    headless: HeadlessOption = False,
    no_recording: NoRecordingOption = False,
    force: ForceOption = False,
    keep_going: KeepGoingOption = False,
    json_output: JsonOption = False,
) -> None:
    """Replay a session once for each --feature, side by side in one recording on one timeline."""
    from .running import replay_features

    if not 2 <= len(features) <= MOST_RUNS:
        raise typer.BadParameter(f"--feature is wanted 2 to {MOST_RUNS} times, found {len(features)}")
    options = RunOptions(particles, seed, start, resampler, sharpness, motion)
    output = OutputOptions(session.stem, save, headless, no_recording, force, json_output)
    replay_features(session, library, features, options, output, keep_going=keep_going)
