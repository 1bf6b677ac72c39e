"""Files in, sessions out; runs to disk and back.

The chapters are

* `files`: files and their contents; `errors`: bad input
* `reading`: from a recording of any format to a session
* `formats`: one file a format, and the registry that detects it; `bags`: ROS bags and MCAP
* `session_log`: our own format, read and written; `live`: a source that is read while it grows
* `libraries`: built from surveys and drives; `runs`: saved runs
* `export`, `importing`, `calibration_trials`: files for and from other programs
* `doctor`: what is in a recording, and what is wrong with it
* `config_files`: configuration as TOML; `amcl`: AMCL's parameters

A new format is one file in `formats` and one line in its registry.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from maurice_mcl.errors import front_page

if TYPE_CHECKING:
    from .errors import InputError as InputError
    from .formats.registry import open_session as open_session
    from .libraries.keypoints import with_keypoints as with_keypoints
    from .libraries.landmarks import with_landmarks as with_landmarks
    from .libraries.store import build_library as build_library
    from .libraries.store import open_library as open_library
    from .reading.options import Reading as Reading
    from .reading.options import read_reading as read_reading
    from .reading.options import write_reading as write_reading
    from .runs.store import open_run as open_run
    from .session_log.writer import SessionWriter as SessionWriter

__all__, __getattr__, __dir__ = front_page(__name__)
