"""`maurice-replay SESSION`: one run, into the viewer or a file."""

from __future__ import annotations

import typer

from maurice_loaders.reading import ReadingOptions

from ...layouts.names import DETAILS
from ..common_options import CommonOptions, runs_a_filter
from ..live_options import LiveOptions, listens
from ..options import (
    AsRecordedOption,
    ConfigOption,
    DetailOption,
    FeatureOption,
    PresetOption,
    ResamplerOption,
    RunOptions,
    SeedOption,
    SessionArgument,
)
from ..reading import reads_recordings


@reads_recordings
@listens
@runs_a_filter
def replay(
    session: SessionArgument,
    *,
    feature: FeatureOption = None,
    preset: PresetOption = None,
    config: ConfigOption = None,
    seed: SeedOption = 0,
    resampler: ResamplerOption = None,
    common: CommonOptions,
    detail: DetailOption = DETAILS[0],
    as_recorded: AsRecordedOption = False,
    live: LiveOptions,
    opening: ReadingOptions,
) -> None:
    """Replay a session of any format, a saved run or a live source, in the viewer or, without, to a file."""
    from maurice_loaders.runs.store import is_saved

    from ...app.open import RunSpec
    from ...app.run import replay_runs
    from ...app.saved import replay_saved

    library, run = common.library, common.run
    options = common.of_runs(seed, resampler, config)
    output = common.of_output(session.absolute().stem, detail)
    if as_recorded:
        from ...app.recorded import replay_as_recorded

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
        from ...app.live import follow_source

        follow_source(session, library, RunSpec(preset, feature), options, output, live, opening)
        return
    if is_saved(session):
        reading = opening != ReadingOptions()
        if options != RunOptions() or preset or feature or library or run or reading:
            raise typer.BadParameter(
                "a saved run is replayed as it was: only options of the output apply to it"
            )
        replay_saved(session, output)
        return
    figures = options != RunOptions() or preset or feature or run
    figures = figures or common.no_recording or common.json_output or common.layout
    replay_runs(
        session,
        library,
        [RunSpec(preset, feature)],
        options,
        output,
        keep_going=common.keep_going,
        opening=opening,
        shown_alone=not figures,
    )
