"""`maurice-replay BAG --as-recorded`: another localizer's particles in our views, without filtering."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import typer

from maurice_loaders.bags.formats import BAGS
from maurice_loaders.bags.localizer import RecordedLocalizer
from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import chosen
from maurice_loaders.io.notes import ReadingNotes
from maurice_loaders.reading import ReadingOptions

from ..cli.console import note
from ..cli.errors import one_line_errors
from ..cli.options import OutputOptions
from ..layouts.names import RECORDED_LAYOUT_NAMES
from ..scene import RunView
from .as_recorded import AFTER_RESAMPLING, AsRecorded, map_of
from .output import Scene
from .run import Playback, play


def replay_as_recorded(path: Path, options: ReadingOptions, output: OutputOptions) -> None:
    """Show the clouds of a bag; what is wrong with it ends in one line and status 1."""
    if output.layout not in (None, *RECORDED_LAYOUT_NAMES):
        names = " and ".join(RECORDED_LAYOUT_NAMES)
        raise typer.BadParameter(f"--as-recorded has the layouts {names}, found {output.layout!r}")
    with one_line_errors():
        play(playback_of(open_as_recorded(path, options)), output)


def open_as_recorded(path: Path, options: ReadingOptions) -> AsRecorded:
    """Open a bag's localizer. InputError for what is no bag, and for one without particles."""
    name = chosen(path, options).name
    if name not in BAGS:
        raise InputError(
            path, f"found the format {name}, expected one of {', '.join(BAGS)} for --as-recorded"
        )
    own = replace(options, odometry_offset_s=0.0, truth_offset_s=0.0)  # a bag adds these itself
    if own.corrections:
        raise InputError(path, f"--as-recorded shows a bag as it is, expected no {own.corrections[0]}")
    localizer = RecordedLocalizer(path, BAGS[name], options)
    label = localizer.cloud.name.strip("/").replace("/", "-") or "recorded"
    return AsRecorded(localizer, localizer.overview(), label, ReadingNotes(options.keep_going))


def playback_of(recorded: AsRecorded) -> Playback:
    """Get the updates ready to be gone through."""
    seen = recorded.overview
    drawn = RunView(recorded.label, (), None, seen.most_particles)
    library = map_of(recorded.localizer, seen)
    scene = Scene(
        recorded.localizer.info, library, seen.has_truth, seen.updates, recorded.localizer.has_pictures
    )
    return Playback(recorded.updates(), seen.updates, [drawn], scene, lambda _: _remark(recorded))


def _remark(recorded: AsRecorded) -> None:
    """Say what the figures stand for, and what was skipped."""
    pose = recorded.localizer.pose
    where = f"the pose of {pose.name}" if pose else "the heaviest cluster of the cloud"
    note(f"{recorded.localizer.cloud.name} {AFTER_RESAMPLING}; the estimate is {where}")
    for text in recorded.localizer.info.notes:
        note(text)
    if recorded.unweighted:
        note(f"the weights of {recorded.unweighted} clouds add up to nothing and count as equal")
    for warning in recorded.notes.warnings:
        note(warning)
    if recorded.notes.count:
        note(f"skipped {recorded.notes.count} broken messages, the first: {recorded.notes.problems[0]}")
