"""`maurice-replay SESSION`: one run, into the viewer or a file."""

from __future__ import annotations

from maurice_mcl.sensor import DEFAULT_SHARPNESS

from .options import (
    DEFAULT_PARTICLES,
    DEFAULT_RESAMPLER,
    FeatureOption,
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


def replay(
    session: SessionArgument,
    library: LibraryOption = None,
    feature: FeatureOption = "blended",
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
    """Replay a session log in the Rerun viewer, or into a recording where there is no display."""
    from .running import replay_features

    options = RunOptions(particles, seed, start, resampler, sharpness, motion)
    output = OutputOptions(session.stem, save, headless, no_recording, force, json_output)
    replay_features(session, library, [feature], options, output, keep_going=keep_going)
