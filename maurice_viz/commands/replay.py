"""`maurice-replay SESSION`: one run, into the viewer or a file."""

from __future__ import annotations

import typer

from maurice_loaders.formats import OpenOptions

from ..layouts.names import DETAILS
from .live_options import LiveOptions, listens
from .options import (
    AsRecordedOption,
    ConfigOption,
    DetailOption,
    FeatureOption,
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
    PresetOption,
    ResamplerOption,
    RunOption,
    RunOptions,
    SaveOption,
    SeedOption,
    SessionArgument,
    SharpnessOption,
    StartOption,
)
from .reading import reads_recordings


@reads_recordings
@listens
def replay(
    session: SessionArgument,
    library: LibraryOption = None,
    feature: FeatureOption = None,
    preset: PresetOption = None,
    config: ConfigOption = None,
    particles: ParticlesOption = None,
    seed: SeedOption = 0,
    start: StartOption = None,
    resampler: ResamplerOption = None,
    sharpness: SharpnessOption = None,
    motion: MotionOption = None,
    save: SaveOption = None,
    run: RunOption = None,
    layout: LayoutOption = None,
    detail: DetailOption = DETAILS[0],
    headless: HeadlessOption = False,
    no_recording: NoRecordingOption = False,
    force: ForceOption = False,
    keep_going: KeepGoingOption = False,
    json_output: JsonOption = False,
    as_recorded: AsRecordedOption = False,
    *,
    opening: OpenOptions,
    live: LiveOptions,
) -> None:
    """Replay a session of any format, a saved run or a live source, in the viewer or, without, to a file."""
    from maurice_loaders.run_store import is_saved

    from .opening import Wanted
    from .running import replay_runs
    from .saved import replay_saved

    options = RunOptions(seed, start, particles, resampler, sharpness, motion, config)
    output = OutputOptions(
        session.absolute().stem, save, headless, no_recording, force, json_output, run, layout, detail
    )
    if as_recorded:
        from .recorded import replay_as_recorded

        if options != RunOptions() or preset or feature or library or run:
            raise typer.BadParameter(
                "--as-recorded runs no filter: only options of reading and of the output apply"
            )
        if live.wanted_for(session):
            raise typer.BadParameter("--as-recorded reads a bag that is finished, not a live source")
        replay_as_recorded(session, opening, output)
        return
    if live.wanted_for(session):
        if opening.odometry_from_truth:
            raise typer.BadParameter("--odometry-from-truth needs a recording, not a live source")
        from .following import follow_source

        follow_source(session, library, Wanted(preset, feature), options, output, live, opening)
        return
    if is_saved(session):
        reading = opening != OpenOptions()
        if options != RunOptions() or preset or feature or library or run or reading:
            raise typer.BadParameter(
                "a saved run is replayed as it was: only options of the output apply to it"
            )
        replay_saved(session, output)
        return
    figures = options != RunOptions() or preset or feature or run or no_recording or json_output or layout
    replay_runs(
        session,
        library,
        [Wanted(preset, feature)],
        options,
        output,
        keep_going=keep_going,
        opening=opening,
        shown_alone=not figures,
    )
