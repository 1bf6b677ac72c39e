"""`maurice-replay SESSION`: one run, into the viewer or a file."""

from __future__ import annotations

import os
from pathlib import Path

from maurice_loaders.live.source import is_live

from ...layouts import DETAILS
from ..console import listening
from ..options import (
    AsRecordedOption,
    CaptureOption,
    ConfigOption,
    DetailOption,
    FeatureOption,
    FollowOption,
    ForceOption,
    JsonOption,
    KeepGoingOption,
    KeepUpOption,
    LayoutOption,
    LibraryOption,
    ParticlesOption,
    PatienceOption,
    PresetOption,
    RrdOption,
    SaveRunOption,
    SeedOption,
    SessionArgument,
    SetOption,
    StartOption,
    output_of,
    settings_of,
)
from ..reading import ReadingOption, reading_of
from ..scores import printed

QUIET = "warn,re_log_encoding=error"  # a live recording has no footer on purpose, of which Rerun warns


def replay(
    session: SessionArgument,
    library: LibraryOption = None,
    preset: PresetOption = None,
    feature: FeatureOption = None,
    particles: ParticlesOption = None,
    seed: SeedOption = 0,
    start: StartOption = None,
    config: ConfigOption = None,
    settings: SetOption = None,
    rrd: RrdOption = None,
    save_run: SaveRunOption = None,
    layout: LayoutOption = None,
    detail: DetailOption = DETAILS[0],
    force: ForceOption = False,
    json_output: JsonOption = False,
    follow: FollowOption = False,
    capture: CaptureOption = None,
    keep_up: KeepUpOption = None,
    patience: PatienceOption = None,
    reading: ReadingOption = None,
    keep_going: KeepGoingOption = False,
    as_recorded: AsRecordedOption = False,
) -> None:
    """Replay a session of any format, a saved run or a live source, in the viewer or to a file."""
    if follow or is_live(session):
        os.environ.setdefault("RUST_LOG", QUIET)  # before the next lines import rerun, which reads it
    from ...app.open import RunSpec
    from ...app.replay import LiveOptions, replay_any

    given = settings_of(settings)
    motion = given.pop("motion", None)
    spec = RunSpec(
        preset, feature, particles, seed, start, config, given, None if motion is None else Path(motion)
    )
    output = output_of(
        session.absolute().stem, rrd, save_run=save_run, layout=layout, detail=detail, force=force
    )
    with listening() as listener:
        replay_any(
            session,
            library,
            spec,
            output,
            reading=reading_of(reading, keep_going=keep_going),
            live=LiveOptions(follow, capture, keep_up, patience),
            as_recorded=as_recorded,
            alone=not json_output,
            listener=listener,
            report=printed(json_output),
        )
