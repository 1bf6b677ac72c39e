"""`maurice-replay compare`: two to four runs side by side, of one session or of several, new or saved."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ...layouts import DETAILS
from ..console import listening
from ..options import (
    ConfigsOption,
    DetailOption,
    FeaturesOption,
    ForceOption,
    JsonOption,
    KeepGoingOption,
    LayoutOption,
    LibraryOption,
    ParticleCountsOption,
    PresetsOption,
    RrdOption,
    SaveRunOption,
    SeedsOption,
    SetOption,
    StartsOption,
    output_of,
    settings_of,
)
from ..reading import ReadingOption, reading_of
from ..scores import printed

PathsArgument = Annotated[
    list[Path],
    typer.Argument(
        help="A session; or two to four of them, or of saved runs; or a comparison's folder.",
        show_default=False,
        metavar="SESSION|RUN...",
    ),
]


def compare(
    paths: PathsArgument,
    library: LibraryOption = None,
    preset: PresetsOption = None,
    feature: FeaturesOption = None,
    particles: ParticleCountsOption = None,
    seed: SeedsOption = None,
    start: StartsOption = None,
    config: ConfigsOption = None,
    settings: SetOption = None,
    rrd: RrdOption = None,
    save_run: SaveRunOption = None,
    layout: LayoutOption = None,
    detail: DetailOption = DETAILS[0],
    force: ForceOption = False,
    json_output: JsonOption = False,
    reading: ReadingOption = None,
    keep_going: KeepGoingOption = False,
) -> None:
    """Replay two to four runs side by side in one recording, and show how they differ.

    Of one session, give exactly one option of the filter several times, or one key of --set with several
    values; without any, color and blended are compared.
    """
    from ...app.compare import SEVERAL, compare_any

    given: dict[str, Any] = {
        "feature": feature or (),
        "preset": preset or (),
        "particles": particles or (),
        "seed": seed or (),
        "start": start or (),
        "config": config or (),
        **_settings(settings or []),
    }
    stem = paths[0].absolute().stem if len(paths) == 1 else SEVERAL
    with listening() as listener:
        compare_any(
            paths,
            library,
            given,
            output_of(stem, rrd, save_run=save_run, layout=layout, detail=detail, force=force),
            reading=reading_of(reading, keep_going=keep_going),
            listener=listener,
            report=printed(json_output),
        )


def _settings(pairs: list[str]) -> dict[str, Any]:
    """Return settings a run: a key that is given several times makes a run of each of its values."""
    values: dict[str, list[Any]] = {}
    for pair in pairs:
        for key, value in settings_of([pair]).items():
            values.setdefault(key, []).append(value)
    motion = [Path(file) for file in values.pop("motion", [])]
    once = {key: value[0] for key, value in values.items() if len(value) == 1}
    several = {key: value for key, value in values.items() if len(value) > 1}
    if len(several) > 1:
        raise typer.BadParameter(f"--set gives {' and '.join(several)} several times; vary one key")
    varied = [once | {key: value} for key, some in several.items() for value in some]
    return {"settings": varied or ([once] if once else []), "motion": motion}
