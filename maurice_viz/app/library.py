"""Building a library of references from a survey or a drive, and checking how good one is."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from maurice_loaders.errors import InputError
from maurice_loaders.io.files import expect_absent, write_whole
from maurice_loaders.libraries.choose import read_every
from maurice_loaders.libraries.store import build_library as measure
from maurice_loaders.libraries.store import open_library, save_library
from maurice_loaders.libraries.survey import EVERY, open_survey
from maurice_loaders.reading import ReadingOptions
from maurice_loaders.session_log.reader import SessionLog
from maurice_mcl.library import Library
from maurice_mcl.library_quality import Coverage, SelfSimilarity, coverage_of, self_similarity_of
from maurice_mcl.sensor.descriptors.registry import FEATURES
from maurice_mcl.sensor.model import SensorModel, SensorParameters
from maurice_mcl.sensor.references import nearest_reference

from ..errors import OptionError
from ..style import scale_for
from .listener import SILENT, Listener, progress_of


def build_library(
    survey: str | Path,
    to: str | Path,
    *,
    every: str | None = None,
    yaw_rad: float = 0.0,
    options: ReadingOptions | None = None,
    force: bool = False,
    listener: Listener = SILENT,
) -> tuple[Library, Coverage | None]:
    """Build a library from a survey log, or from a drive with truth, and save it to the folder `to`.

    `every` is the distance and the angle between entries of a drive, as "0.4m,45deg" (the default of a drive;
    a survey log is taken whole). `yaw_rad` is the yaw of the robot's camera from the survey's camera, in
    radians, counter-clockwise. Returns the library, and for a drive how much of the map it covers.

    Raises OptionError for an `every` that cannot be read, and InputError for a survey without poses or a
    folder that exists (unless `force`).

        >>> library, _ = mv.build_library("survey.log", "library")
        >>> library.size
        160
    """
    survey, options = Path(survey), options or ReadingOptions()
    try:
        spaced = None if every is None else read_every(every)
    except ValueError as problem:
        raise OptionError(str(problem)) from None
    with TemporaryDirectory() as kept:
        source = open_survey(survey, options, spaced, Path(kept), progress_of(listener, "choose pictures"))
        built = measure(
            survey,
            keep_going=options.keep_going,
            progress=progress_of(listener, "library"),
            warn=listener.warning,
            log=source,
            yaw_rad=yaw_rad,
        )
        save_library(built, Path(to), force=force)
        reach_m = (spaced or EVERY).distance_m
        return built, None if isinstance(source, SessionLog) else coverage_of(built, reach_m)


@dataclass(frozen=True, slots=True, eq=False)
class LibraryCheck:
    """How well a library's places can be told apart, and where it has gaps."""

    library: Library
    similarity: SelfSimilarity
    coverage: Coverage

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON, in meters and radians."""
        found, covered = self.similarity, self.coverage
        known, places = found.retrieved >= 0, found.at_places(found.ambiguity)
        return {
            "name": self.library.name,
            "entries": self.library.size,
            "places": len(found.places),
            "spacing_m": found.spacing_m,
            "covered_share": covered.covered,
            "directions_share": covered.directions,
            "gaps": [
                {"x_m": g.x_m, "y_m": g.y_m, "area_m2": g.area_m2, "to_entry_m": g.to_entry_m}
                for g in covered.gaps
            ],
            "retrieved_right_share": found.retrieved_right,
            "retrieval_error_median_m": float(np.median(found.error_m[known])) if known.any() else None,
            "retrieval_error_90_m": float(np.percentile(found.error_m[known], 90)) if known.any() else None,
            "look_alikes": [
                {"entry": entry, "like": int(found.alias[entry]), "nats": float(-found.margin[entry])}
                for entry in found.aliased.tolist()
            ],
            "ambiguity_median": float(np.median(places)),
            "ambiguity": [
                {"x_m": float(x), "y_m": float(y), "places": float(value)}
                for (x, y), value in zip(found.places, places, strict=True)
            ],
            "similarity_nats": [None if np.isnan(v) else float(v) for v in found.similarity],
        }

    def draw(self, to: str | Path, *, force: bool = False) -> Path:
        """Write the map of expected ambiguity (.png) and return its path.

        Raises OptionError for another ending and InputError where the file exists (unless `force`).
        """
        from ..drawing.raster import png
        from ..plots.sheets import draw_ambiguity

        path = _checked_map(Path(to), force=force)
        scale = scale_for(self.library.display_units, self.library.arena)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, png(draw_ambiguity(self.library, self.similarity, scale)), force=force)
        return path


def check_library(
    library: str | Path,
    *,
    feature: str = "blended",
    to: str | Path | None = None,
    force: bool = False,
    listener: Listener = SILENT,
) -> LibraryCheck:
    """Compare a library's pictures with each other: aliases, retrieval error, ambiguity, coverage.

    `feature` is a feature or a channel by name. `to` also draws the map of expected ambiguity (.png). Raises
    InputError for a library that cannot be opened or lacks a channel of the feature.

        >>> check = mv.check_library("survey.log")
        >>> check.similarity.retrieved_right > 0.5
        True
    """
    path = Path(library)
    if to is not None:
        _checked_map(Path(to), force=force)
    opened = open_library(path, progress=progress_of(listener, "library"), warn=listener.warning)
    weights = FEATURES.get(feature, {feature: 1.0})
    missing = [name for name in weights if name not in opened.index]
    if missing:
        found = f"the library {opened.name!r} holds {', '.join(opened.index) or 'no channel'}"
        raise InputError(path, f"{found}, and {missing[0]} is wanted; build the library again")
    nearest = nearest_reference(opened.poses, opened.arena)
    sensor = SensorModel(opened, nearest, SensorParameters(dict(weights)))
    similarity = self_similarity_of(opened, sensor, progress_of(listener, "compare"))
    check = LibraryCheck(opened, similarity, coverage_of(opened, similarity.spacing_m))
    if to is not None:
        check.draw(to, force=force)
    return check


def _checked_map(path: Path, *, force: bool) -> Path:
    if path.suffix != ".png":
        raise OptionError(f"--map ends in .png, found {str(path)!r}")
    expect_absent(path, force=force)
    return path
