"""`maurice-replay compare`: two to four runs side by side, of one drive or of several, new or saved."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from maurice_loaders.reading import ReadingOptions

from ..common_options import CommonOptions, runs_a_filter
from ..options import ConfigsOption, FeaturesOption, PresetsOption, ResamplersOption, RunOptions, SeedsOption
from ..reading import reads_recordings

COLOR_AND_BLENDED = ("color", "blended")
MOST_RUNS = 4
SEVERAL = "comparison"  # stem of the recording where no single session gives it a name

PathsArgument = Annotated[
    list[Path],
    typer.Argument(
        help="A session log; or two to four of them, or of saved runs; or a comparison's folder.",
        show_default=False,
        metavar="SESSION|RUN...",
    ),
]


@reads_recordings
@runs_a_filter
def compare(
    paths: PathsArgument,
    features: FeaturesOption = None,
    presets: PresetsOption = None,
    config: ConfigsOption = None,
    seed: SeedsOption = None,
    resampler: ResamplersOption = None,
    *,
    common: CommonOptions,
    opening: ReadingOptions,
) -> None:
    """Replay two to four runs side by side in one recording, and say how they differ.

    Of one session: give exactly one of --feature, --preset, --resampler, --seed and --config several times.
    """
    from maurice_loaders.runs.store import is_saved

    from ...app.compare import compare_saved, compare_sessions
    from ...app.run import replay_runs

    given: dict[str, Sequence[Any]] = {
        "feature": features or (),
        "preset": presets or (),
        "resampler": resampler or (),
        "seed": seed or (),
        "config": config or (),
    }
    library, run, keep_going = common.library, common.run, common.keep_going
    options = common.of_runs()
    output = common.of_output(paths[0].absolute().stem if len(paths) == 1 else SEVERAL)
    saved, reading = [is_saved(path) for path in paths], opening != ReadingOptions()
    if any(saved):
        _check_saved(saved, options != RunOptions() or any(given.values()) or library or run or reading)
        _check_count(len(paths), fewest=1)
        compare_saved(paths, output)
        return
    from ...app.compare import one_filter, wanted_runs

    if len(paths) > 1:
        _check_count(len(paths))
        if run is not None:
            raise typer.BadParameter("--run saves runs of one session; replay each with --run, then compare")
        compare_sessions(
            paths, library, one_filter(given), options, output, keep_going=keep_going, opening=opening
        )
        return
    wanted = wanted_runs(given)
    _check_count(len(wanted))
    replay_runs(paths[0], library, wanted, options, output, keep_going=keep_going, opening=opening)


def _check_saved(saved: list[bool], options: object) -> None:
    if not all(saved):
        raise typer.BadParameter(
            "session logs and saved runs do not mix; save the other runs first with --run"
        )
    if options:
        raise typer.BadParameter(
            "saved runs are compared as they were: only options of the output apply to them"
        )


def _check_count(found: int, fewest: int = 2) -> None:
    if not fewest <= found <= MOST_RUNS:
        raise typer.BadParameter(f"2 to {MOST_RUNS} runs can be compared, found {found}")
