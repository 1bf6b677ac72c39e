"""A planted run as files: a session log, a library, and the configuration of the filter."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from maurice_loaders.errors import InputError
from maurice_loaders.libraries.files import save_library
from maurice_loaders.session_log.writer import SessionWriter
from maurice_loaders.writing import new_folder

from .planting import Planted

MOTION = "motion"  # of the settings: what the session's header says of the robot
SETTLED_S = 0.1  # between a picture and the next movement; the log has no more than that to say


def write_planted(planted: Planted, to: str | Path, *, force: bool = False) -> Path:
    """Write session, library and filter of a planted run into a new folder; return the session's path.

    `maurice-replay SESSION --library LIBRARY --config FILTER --seed SEED` runs it; pictures are written as
    JPEG, so that the numbers differ in the last places. InputError if the folder holds something.

        >>> from maurice_datasets.planted.planting import planted
        >>> from maurice_datasets.planted.saved import write_planted
        >>> write_planted(planted("kidnapped", 0), "kidnapped-0")  # doctest: +SKIP
        PosixPath('kidnapped-0/session.log')
    """
    planting, folder = planted.planting, Path(to)
    held, library = planting.session, replace(planting.library, pictures=(None,) * planting.library.size)
    with new_folder(folder, force=force) as filling:
        save_library(library, filling / "library")
        (filling / "filter.toml").write_text(_toml(planted), encoding="utf-8")
        motion = planting.settings.get(MOTION, held.info.motion)
        info = replace(held.info, arena=library.arena, survey=Path("library"), motion=motion)
        with SessionWriter(filling / "session.log", info) as log:
            for moment in held.moments():
                for motion in moment.frame.motions:
                    log.odometry(moment.frame.time_s - SETTLED_S, motion)
                log.image(moment.frame.time_s, moment.frame.image, camera="front")
                if moment.truth is not None:
                    log.truth(moment.frame.time_s, moment.truth)
    return folder / "session.log"


def _toml(planted: Planted) -> str:
    """Return the settings as a configuration file; the seed stands beside them in a comment."""
    lines = [f"# planted: {planted.kind} ({planted.planting.way}); run with --seed {planted.localizer.seed}"]
    for key, value in planted.planting.settings.items():
        if key == MOTION:
            continue
        if isinstance(value, dict):
            table = ", ".join(f"{name} = {entry!r}" for name, entry in value.items())
            lines.append(f"{key} = {{ {table} }}")
        elif isinstance(value, (int, float, str)):
            lines.append(f"{key} = {json.dumps(value)}")
        else:
            raise InputError(None, f"{key}: found {value!r}, expected a number, a word or a table")
    return "\n".join(lines) + "\n"
