"""Replaying, comparing, explaining and drawing runs of a localizer, from Python as from the command line.

| function | what it does |
|---|---|
| `replay` | replays a session once: scores, and where asked a Rerun recording and a saved run |
| `compare` | replays two to four runs side by side and compares their scores |
| `drive` | drives the simulated robot by keys, while a filter follows and is drawn |
| `Live` | a filter that is fed frame by frame, and draws into your own Rerun stream |
| `show` | shows a run, a recording or a session in a notebook's widget |
| `results`, `traces` | a saved run's scores and its numbers step by step, as polars frames |
| `plot` | columns of runs over time, as a matplotlib figure |
| `diagnose` | why a filter was lost: one cause for each time |
| `explain` | explains one step of a saved run |
| `check` | whether a filter does on drives what is demanded of it, with many seeds |
| `trials` | filters on drives with many seeds: means and paired differences |
| `error_budget` | which part of a filter costs most accuracy |
| `what_if`, `remedies` | branches a saved run with something changed; ranks what would have helped |
| `snapshot`, `movie` | a picture or a movie of what the viewer shows |
| `report` | one self-contained page about a saved run |
| `events` | what happened in a saved run, step by step |
| `verify`, `export` | filter a saved run again to the last bit; files for other tools |
| `inspect`, `doctor`, `formats`, `convert` | what a recording holds, its faults, rewriting it |
| `build_map` | the map of a laser's scans with true poses |
| `build_library`, `check_library`, `tune` | a library of references: make, check, fit channels to it |
| `calibrate_belief` | how often the regions of saved runs' clouds hold the truth |
| `calibrate_drive` | the noise of the odometry, from drives with truth |
| `calibrate_motion`, `calibrate_noise` | constants of robot and camera from trials, and their figures |
| `Filter`, `Reading`, `Output`, `Demands` | what is asked for, as values |
| `trials_report` | a page about trials: what every variant reached, and where on the floor runs go wrong |

Each takes plain arguments, returns values and raises `maurice_loaders.InputError` for bad input. None prints
or exits; remarks, warnings and progress go to the `Listener` that the caller may pass. Each is imported when
it is first used.

The chapters, from the ground up:

* `errors`, `style`: what a function tells its caller, by errors and a listener; units and colors
* `entities`, `scene`: where things are logged, and what panels know of runs; `playback`: runs side by side
* `drawing`, `text`: images and sentences about runs; `plots`: figures for print
* `panels`, `layouts`: what is drawn of a run, and where it stands on a screen; `viewer`: the way there
* `running`: from what a user names to runs; its front page tells the walk from a command to a dot
* `app`: the functions above, a file for each command; `reports`, `notebook`; `cli`: the command line
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from maurice_mcl.errors import front_page

if TYPE_CHECKING:
    from maurice_datasets.trials.table import TrialsResult as TrialsResult
    from maurice_loaders.errors import InputError as InputError
    from maurice_loaders.formats.registry import open_session as open_session
    from maurice_loaders.libraries.store import open_library as open_library
    from maurice_loaders.reading.options import Reading as Reading
    from maurice_loaders.runs.store import open_run as open_run
    from maurice_mcl.filter.motion import RobotMotion as RobotMotion
    from maurice_mcl.filter.recovery import Recovery as Recovery
    from maurice_mcl.scoring.demands import Demands as Demands
    from maurice_mcl.values.pose_sensor import PoseSensor as PoseSensor
    from maurice_mcl.values.pose_sensor import PoseSpread as PoseSpread
    from maurice_mcl.values.pose_sensor import Shown as Shown
    from maurice_mcl.values.records import RecoveryState as RecoveryState

    from .app.budget import error_budget as error_budget
    from .app.calibrate import calibrate_belief as calibrate_belief
    from .app.calibrate import calibrate_drive as calibrate_drive
    from .app.calibrate import calibrate_motion as calibrate_motion
    from .app.calibrate import calibrate_noise as calibrate_noise
    from .app.check.check import check as check
    from .app.compare import compare as compare
    from .app.convert import build_map as build_map
    from .app.convert import convert as convert
    from .app.convert import export as export
    from .app.diagnose import diagnose as diagnose
    from .app.drive.drive import drive as drive
    from .app.explain import explain as explain
    from .app.inspect import doctor as doctor
    from .app.inspect import events as events
    from .app.inspect import formats as formats
    from .app.inspect import inspect as inspect
    from .app.library import build_library as build_library
    from .app.library import tune as tune
    from .app.library_check import check_library as check_library
    from .app.live import Live as Live
    from .app.remedies import remedies as remedies
    from .app.replay import replay as replay
    from .app.snapshot import movie as movie
    from .app.snapshot import snapshot as snapshot
    from .app.trials import trials as trials
    from .app.what_if import what_if as what_if
    from .errors import Listener as Listener
    from .notebook import plot as plot
    from .notebook import results as results
    from .notebook import show as show
    from .notebook import traces as traces
    from .reports.make import report as report
    from .reports.trials_report import trials_report as trials_report
    from .running.filters import Filter as Filter
    from .running.output import Output as Output
    from .running.run import RunScores as RunScores
    from .running.source import LiveOptions as LiveOptions
    from .running.verify import verify as verify

__all__, __getattr__, __dir__ = front_page(__name__)
