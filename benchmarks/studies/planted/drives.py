"""Simulated drives, and what can be done to one that was driven already: its pictures, odometry and gaps."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from maurice_datasets.sessions import SimulatedSession, session_info
from maurice_datasets.simulation import SimulationPlan, stage
from maurice_datasets.tasks import TASKS
from maurice_datasets.trials.drives import RenderedSession
from maurice_loaders.files.writing import cache_root, write_whole
from maurice_loaders.session_log.header import SESSION_LOG, header_from_json, header_to_json
from maurice_mcl.scoring.table import UNKNOWN_POSE
from maurice_mcl.values.arrays import F64, U8
from maurice_mcl.values.geometry import wrap
from maurice_mcl.values.session import Frame, Moment, SessionInfo

from .places import Ground

UPDATES = 40
VERSION = 2  # raise it whenever the same kind and number give another run
# the fields of what is kept: a drive from before one was added has none of it
KINDS = (Frame, Moment, SessionInfo, RenderedSession)
KEPT = tuple((kind.__name__, *kind.__dataclass_fields__) for kind in KINDS)
Picture = Callable[[U8], U8]


def drive(ground: Ground, seed: int, *, task: str = "tracking", **changes: Any) -> RenderedSession:
    """Drive a seed in a world, and forget what the log would say of it: a diagnosis must see it by itself.

    `changes` are fields of a `SimulationPlan`. Wheels slip only where they are asked to. Drives are kept in
    the user's cache: rendering one takes longer than anything else.
    """
    name = repr((VERSION, KEPT, ground.name, ground.arena_seed, seed, task, sorted(changes.items())))
    file = cache_root() / "planted" / "drives" / f"{hashlib.sha256(name.encode()).hexdigest()[:20]}.npz"
    if not file.is_file():
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(file, pack(_rendered(ground, seed, task, changes)), force=True)
    return unpack(file.read_bytes())


def _rendered(ground: Ground, seed: int, task: str, changes: Mapping[str, Any]) -> RenderedSession:
    plan = SimulationPlan(
        TASKS[task],
        world=ground.name,
        arena_seed=ground.arena_seed,
        seed=seed,
        updates=UPDATES,
        slip_chance=0.0,
        **changes,
    )
    set_up = stage(plan, ground.world)
    info = replace(session_info(set_up), survey=None, notes=())
    return RenderedSession(
        info, tuple(replace(entry, events=()) for entry in SimulatedSession(set_up, info).moments())
    )


def pack(session: RenderedSession) -> bytes:
    """Return a session as arrays and JSON, which give back the same drive to the last bit."""
    frames = [moment.frame for moment in session.all_moments]
    texts = {
        "header": header_to_json(session.info, "session", Path.cwd()),
        "events": [moment.events for moment in session.all_moments],
        "pictures": [frame.picture for frame in frames],
        "readings": [dict(frame.readings) for frame in frames],
    }
    packed = io.BytesIO()
    np.savez(
        packed,
        allow_pickle=False,
        texts=np.frombuffer(json.dumps(texts).encode(), np.uint8),
        images=np.stack([frame.image for frame in frames]),
        steps=np.array([frame.step for frame in frames]),
        times_s=np.array([frame.time_s for frame in frames]),
        counts=np.array([len(frame.motions) for frame in frames]),
        motions=np.concatenate([frame.motions for frame in frames]),
        truths=np.array([UNKNOWN_POSE if m.truth is None else m.truth for m in session.all_moments]),
    )
    return packed.getvalue()


def unpack(data: bytes) -> RenderedSession:
    """Return what `pack` returned. ValueError, KeyError or OSError for anything else."""
    with np.load(io.BytesIO(data), allow_pickle=False) as packed:
        arrays = dict(packed)
    texts = json.loads(arrays["texts"].tobytes())
    info, _ = header_from_json(texts["header"], Path.cwd() / SESSION_LOG)
    ends = np.cumsum(arrays["counts"])
    of_frames = (
        arrays["steps"].tolist(),
        arrays["times_s"].tolist(),
        np.split(arrays["motions"], ends[:-1]),
        arrays["images"],
        texts["pictures"],
        texts["readings"],
    )
    frames = [Frame(*values) for values in zip(*of_frames, strict=True)]
    truths = [None if np.isnan(pose).any() else pose for pose in arrays["truths"]]
    events = map(tuple, texts["events"])
    return RenderedSession(
        info, tuple(Moment(*fields) for fields in zip(frames, truths, events, strict=True))
    )


@lru_cache(3)
def plain_drive(ground: Ground, seed: int) -> RenderedSession:
    """Return the drive of a seed in which nothing happens; many causes can be planted in one."""
    return drive(ground, seed)


def with_moments(
    drive: RenderedSession, moments: Sequence[Moment], start: F64 | None = None
) -> RenderedSession:
    """Return a drive with other moments, and with another start where one is given."""
    info = drive.info if start is None else replace(drive.info, start=start)
    return RenderedSession(info, tuple(moments))


def anywhere(drive: RenderedSession) -> RenderedSession:
    """Return a drive that starts at a place that nobody knows."""
    return RenderedSession(replace(drive.info, start=None), drive.all_moments)


def started_at(drive: RenderedSession, start: F64) -> RenderedSession:
    """Return a drive whose header names another start."""
    turned = np.append(start[:2], wrap(start[2:])[0])
    return with_moments(drive, drive.all_moments, turned)


def pictures_changed(drive: RenderedSession, change: Picture, since: int = 1) -> RenderedSession:
    """Return a drive whose pictures are changed from an update on."""
    return with_moments(
        drive, [_seen(entry, change) if entry.frame.step >= since else entry for entry in drive.moments()]
    )


def _seen(moment: Moment, change: Picture) -> Moment:
    return replace(
        moment, frame=replace(moment.frame, image=np.ascontiguousarray(change(moment.frame.image)))
    )


def frozen(drive: RenderedSession, since: int, count: int) -> RenderedSession:
    """Return a drive whose camera gives the same picture again and again for some updates."""
    still = drive.all_moments[since - 2].frame.image

    def shown(moment: Moment) -> Moment:
        stuck = since <= moment.frame.step < since + count
        return _seen(moment, lambda image: still) if stuck else moment

    return with_moments(drive, [shown(moment) for moment in drive.moments()])


def odometry_changed(drive: RenderedSession, change: Callable[[F64], F64], steps: range) -> RenderedSession:
    """Return a drive whose odometry (M, 3) reports something else at some updates."""

    def told(moment: Moment) -> Moment:
        if moment.frame.step not in steps:
            return moment
        return replace(moment, frame=replace(moment.frame, motions=change(moment.frame.motions.copy())))

    return with_moments(drive, [told(moment) for moment in drive.moments()])


def gap(drive: RenderedSession, since: int, count: int) -> RenderedSession:
    """Return a drive whose log lacks everything of some updates, pictures and odometry alike."""
    kept = [entry for entry in drive.moments() if not since <= entry.frame.step < since + count]
    numbered = [replace(entry, frame=replace(entry.frame, step=k)) for k, entry in enumerate(kept, start=1)]
    return with_moments(drive, numbered)
