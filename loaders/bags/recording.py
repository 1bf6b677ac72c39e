"""A bag of any kind as a recording: pictures, odometry and truth from the topics that were chosen."""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterator
from itertools import islice
from pathlib import Path
from typing import cast

from maurice_mcl.session import SessionInfo

from ..errors import InputError
from ..io.notes import ReadingNotes
from ..reading import ReadingOptions
from ..recording import OdometryPose, Record, TruthPose
from .camera import camera_of
from .messages import TEXT, TRANSFORMS, links_of, recorded_as_measured, stamp_ns, use_recorded
from .readers import (
    MESSAGE_ERRORS,
    WINDOW_S,
    NoteReader,
    PictureReader,
    PoseReader,
    Reader,
    Timed,
    in_order,
    read_parts,
)
from .session_topics import MOTIONS, MotionReader, has_motions, header_of
from .source import BagSource, OpenBag
from .topics import TopicRequest, choose, nothing_to_read, readable

ROLES = ("image", "odometry", "truth")
PEEKED = 3  # messages of a topic that are looked at before reading
TRANSFORMS_PEEKED = 200  # and of transforms, to learn which frames there are


class BagRecording:
    """A bag as a `Recording`. It is opened anew at every reading. InputError where it is damaged."""

    def __init__(
        self, path: Path, open_bag: OpenBag, options: ReadingOptions, *, nothing_will_do: bool = False
    ) -> None:
        _refuse_tables(path, options)
        self.path = path
        self.open_bag = open_bag
        self._options = options
        with open_bag(path, keep_going=options.keep_going) as bag:
            self.chosen = choose(path, bag.topics, _wishes(options), _edges(bag))
            if not self.chosen.topics and not nothing_will_do:
                cut = f"{bag.cut}; " if bag.cut else ""
                raise InputError(path, f"{cut}{nothing_to_read(bag.topics)}")
            first = {topic: peek(bag, topic) for topic in self.chosen.topics}
            self.recorded_times = use_recorded(first)  # why the times of recording are used; "": they are not
            self.counts = {t.name: t.count for t in bag.topics}
            camera, looking = camera_of(bag, self.chosen.image)
            self._events = _events_topic(bag) if recorded_as_measured(first) else None
            self._motions = has_motions(bag) and options.odometry_topic is None
            header = header_of(path, bag)  # of a file that was written here
        self._guessed = "; ".join(text for text in (self.chosen.guess, looking) if text)
        notes, cameras = (self._guessed,) if self._guessed else (), (camera,) if camera else ()
        self.info = header or SessionInfo(name=path.stem, cameras=cameras, notes=notes)
        self._ours = header is not None  # then nothing is guessed, and a time of 0 is one

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Read the chosen topics in time order. Late and broken messages go to `notes`."""
        for text in () if self._ours else (self._guessed, self._clock_note()):
            if text:
                notes.warning(text)
        late: dict[str, int] = {}

        def leave_out(record: Timed) -> None:
            late[type(record).__name__] = late.get(type(record).__name__, 0) + 1

        streams = [in_order(self._read(roles, notes), leave_out) for roles in self._passes()]
        yield from cast(Iterator[Record], heapq.merge(*streams, key=lambda record: record.t_s))
        for kind, count in late.items():
            notes.warning(
                f"{count} records ({kind}) were left out: their times fall by more than {WINDOW_S:g} s"
            )

    def _clock_note(self) -> str:
        why = self.recorded_times
        return f"{why}: the times of recording are used for all topics" if why else ""

    def _passes(self) -> list[tuple[str, ...]]:
        """Tell which roles are read together; apart where offsets would spoil the order."""
        if self._options.odometry_offset_s or self._options.truth_offset_s:
            return [("image",), ("odometry",), ("truth",)]
        return [ROLES]

    def _read(self, roles: tuple[str, ...], notes: ReadingNotes) -> Iterator[Timed]:
        """Read the topics of some roles as they come."""
        keep_going, recorded = self._options.keep_going, bool(self.recorded_times)
        parts = self.parts(roles)
        return read_parts(self.path, self.open_bag, parts, notes, keep_going=keep_going, recorded=recorded)

    def parts(self, roles: Collection[str] = ROLES) -> list[Reader]:
        """Give what reads these roles."""
        chosen, options = self.chosen, self._options
        parts: list[Reader] = []
        if "image" in roles and chosen.image:
            parts.append(PictureReader(chosen.image))
        if "odometry" in roles and self._motions:
            parts.append(MotionReader(MOTIONS, options.odometry_offset_s))
        elif "odometry" in roles and chosen.odometry:
            parts.append(PoseReader(chosen.odometry, OdometryPose, options.odometry_offset_s))
        if "truth" in roles and chosen.truth:
            parts.append(PoseReader(chosen.truth, TruthPose, options.truth_offset_s))
        if "odometry" in roles and self._events:
            parts.append(NoteReader(self._events))
        return parts


def _refuse_tables(path: Path, options: ReadingOptions) -> None:
    """Refuse what is about tables of numbers."""
    typed = {"--time-unit": options.time_unit, "--table": options.table, "--columns": options.columns}
    for name, value in typed.items():
        if value:
            raise InputError(
                path,
                f"found {name}, expected none with a bag, whose messages say what they are; leave it out",
            )


def _wishes(options: ReadingOptions) -> TopicRequest:
    return TopicRequest(options.image_topic or options.camera, options.odometry_topic, options.truth_topic)


def _events_topic(bag: BagSource) -> str | None:
    """Give the topic of texts that is named so, as our own `export --mcap` writes it."""
    found = [t.name for t in readable(bag.topics, {TEXT})]
    return next((name for name in found if name.rpartition("/")[2] == "events"), None)


def peek(bag: BagSource, topic: str) -> list[tuple[int | None, int]]:
    """Give stamp and time of recording of a topic's first messages."""
    stamps = []
    for message in islice(bag.messages({topic}), min(PEEKED, counted(bag, topic))):
        try:
            stamps.append((stamp_ns(message.decode()), message.log_ns))
        except (InputError, *MESSAGE_ERRORS):  # told of when it is read
            continue
    return stamps


def counted(bag: BagSource, topic: str) -> int:
    """Count a topic's messages: whoever reads on after the last one reads the whole bag."""
    return sum(one.count for one in bag.topics if one.name == topic)


def _edges(bag: BagSource) -> Collection[tuple[str, str]]:
    """Give the parent and child frames of the first transforms."""
    edges: set[tuple[str, str]] = set()
    for topic in readable(bag.topics, TRANSFORMS):
        for message in islice(bag.messages({topic.name}), min(TRANSFORMS_PEEKED, topic.count)):
            try:
                edges |= {(link.parent, link.child) for link in links_of(message.decode())}
            except (InputError, *MESSAGE_ERRORS):
                continue
    return edges
