"""`maurice-replay compare SESSION --feature color --feature blended`: runs on one drive, side by side."""

from __future__ import annotations

import typer

from .options import (
    ConfigOption,
    FeaturesOption,
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
    PresetsOption,
    ResamplerOption,
    RunOption,
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
    features: FeaturesOption = None,
    presets: PresetsOption = None,
    config: ConfigOption = None,
    library: LibraryOption = None,
    particles: ParticlesOption = None,
    seed: SeedOption = 0,
    start: StartOption = None,
    resampler: ResamplerOption = None,
    sharpness: SharpnessOption = None,
    motion: MotionOption = None,
    save: SaveOption = None,
    run: RunOption = None,
    layout: LayoutOption = None,
    headless: HeadlessOption = False,
    no_recording: NoRecordingOption = False,
    force: ForceOption = False,
    keep_going: KeepGoingOption = False,
    json_output: JsonOption = False,
) -> None:
    """Replay a session once for each --feature or --preset, side by side in one recording."""
    from .opening import Wanted
    from .running import replay_runs

    pairs = wanted_runs(features or [], presets or [])
    if not 2 <= len(pairs) <= MOST_RUNS:
        raise typer.BadParameter(f"2 to {MOST_RUNS} runs can be compared, found {len(pairs)}")
    options = RunOptions(seed, start, particles, resampler, sharpness, motion, config)
    output = OutputOptions(session.stem, save, headless, no_recording, force, json_output, run, layout)
    wanted = [Wanted(preset, feature) for preset, feature in pairs]
    replay_runs(session, library, wanted, options, output, keep_going=keep_going)


def wanted_runs(features: list[str], presets: list[str]) -> list[tuple[str | None, str | None]]:
    """Pair presets with features: several of the one with none or one of the other.

    A usage error where both are given several times.
    """
    if len(presets) > 1 and len(features) > 1:
        raise typer.BadParameter("give several --feature or several --preset, not both")
    if len(presets) > 1:
        return [(preset, features[0] if features else None) for preset in presets]
    return [(presets[0] if presets else None, feature) for feature in features or COLOR_AND_BLENDED]
