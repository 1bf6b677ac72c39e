"""The library doctor: how well a library distinguishes its places, where it has gaps, and what to add."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from maurice_datasets.trials.recognition import PlaceRecognition
from maurice_loaders.errors import InputError
from maurice_loaders.files.writing import expect_absent, write_whole
from maurice_loaders.libraries.completed import completed
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.session import RecordedSession
from maurice_mcl.config.build import adapted, own_scaled
from maurice_mcl.config.parameters import Layer, configure
from maurice_mcl.library.advice import Confusion, LibraryAdvice, ProposedReference, advise
from maurice_mcl.library.drive_score import DriveScore
from maurice_mcl.library.left_out import ENOUGH_PLACES, LeftOutTable, PlaceScore, score_places
from maurice_mcl.library.quality import Coverage, SelfSimilarity, coverage_of, self_similarity_of
from maurice_mcl.sensor.descriptors.registry import FEATURES
from maurice_mcl.sensor.model import SensorModel, SensorParameters
from maurice_mcl.sensor.references import nearest_reference
from maurice_mcl.values import F64, POSE_SENSORS, Library, plain, plain_value

from ..errors import SILENT, Listener, OptionError, progress_of
from ..running.drive_check import look_up_drive, score_feature
from ..running.filters import Filter
from ..running.open import library_at, open_session
from ..style import scale_for
from ..text.library import say_places

COLUMNS = ("x_m", "y_m", "heading_deg", "why")  # of the table of references to add


@dataclass(frozen=True, slots=True, eq=False)
class LibraryCheck:
    """How well a library distinguishes its places, and where it has gaps."""

    library: Library
    similarity: SelfSimilarity
    coverage: Coverage
    telling: PlaceScore  # whether its places can be told apart, with the fitted scales
    advice: LibraryAdvice  # what will be confused, and which references to add
    wanted_m: float  # between places: as they are, or nearer where they are too sparse
    weights: Mapping[str, float]  # of the channels that are compared
    drive: DriveScore | None = None  # what a drive's pictures say about it; None: no drive was given
    found: PlaceRecognition | None = None  # which references those pictures find

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON, in meters and radians."""
        similarity, covered = self.similarity, self.coverage
        places = similarity.at_places(similarity.ambiguity)
        return {
            "name": self.library.name,
            "entries": self.library.size,
            "places": len(similarity.places),
            "spacing_m": similarity.spacing_m,
            "reach_m": similarity.reach_m,
            "wanted_spacing_m": self.wanted_m,
            "covered_share": covered.covered,
            "directions_share": covered.directions,
            "gaps": plain_value(covered.gaps),
            "retrieved_right_share": similarity.retrieved_right,
            "look_alikes": [
                {
                    "entry": entry,
                    "like": int(similarity.alias[entry]),
                    "nats": float(-similarity.margin[entry]),
                }
                for entry in similarity.aliased.tolist()
            ],
            "confusions": [self._confusion(confusion) for confusion in self.advice.confusions],
            "missing_headings": plain_value(self.advice.missing),
            "add": [self._added(reference) for reference in self.advice.added],
            "ambiguity_median": float(np.median(places)),
            "ambiguity": [
                {"x_m": float(x), "y_m": float(y), "places": float(value)}
                for (x, y), value in zip(similarity.places, places, strict=True)
            ],
            "places_told_apart": self.telling.to_json(),
            "drive": None if self.drive is None else self.drive.to_json(),
            "retrieval": None if self.found is None else self.found.to_json(),
        }

    def _confusion(self, confusion: Confusion) -> dict[str, Any]:
        poses = {"pose": self._pose(confusion.entry), "like_pose": self._pose(confusion.like)}
        return plain(confusion) | poses

    def _pose(self, entry: int) -> dict[str, float]:
        return _pose(self.library.poses[entry])

    @staticmethod
    def _added(reference: ProposedReference) -> dict[str, Any]:
        return _pose(reference.pose) | {"why": reference.why}

    def write_poses(self, to: str | Path, *, force: bool = False) -> Path:
        """Write the references to add as a table (.csv) that `survey --poses` takes, or a person drives.

        Raises InputError if the file exists (unless `force`).
        """
        lines = [",".join(COLUMNS)]
        for reference in self.advice.added:
            x_m, y_m, heading_rad = reference.pose.tolist()
            lines.append(f"{x_m:.4f},{y_m:.4f},{np.degrees(heading_rad):.2f},{reference.why}")
        path = Path(to)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, ("\n".join(lines) + "\n").encode(), force=force)
        return path

    def draw_curves(self, to: str | Path, *, force: bool = False) -> Path:
        """Draw precision over recall, and recall over references, of the drive (.svg, .pdf); return its path.

        Raises InputError for a check without a drive, and if the file exists (unless `force`).
        """
        from ..plots.retrieval import draw_retrieval

        path = Path(to)
        if self.found is None:
            raise InputError(path, "found no drive to look up; name one with --drive")
        draw_retrieval(self.found, self.library.name, path, force=force)
        return path

    def draw(self, to: str | Path, *, force: bool = False) -> Path:
        """Write the map of expected ambiguity (.png) and return its path.

        Raises OptionError for another ending and InputError if the file exists (unless `force`).
        """
        from ..drawing.canvas import png
        from ..plots.sheets import draw_ambiguity

        path = _checked_map(Path(to), force=force)
        scale = scale_for(self.library.display_units, self.library.arena)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, png(draw_ambiguity(self.library, self.similarity, scale, self.advice)), force=force)
        return path


def check_library(
    library: str | Path,
    *,
    feature: str = "blended",
    to: str | Path | None = None,
    poses: str | Path | None = None,
    curves: str | Path | None = None,
    drive: str | Path | None = None,
    reading: Reading | None = None,
    force: bool = False,
    listener: Listener = SILENT,
) -> LibraryCheck:
    """Compare a library's pictures with each other: aliases, ambiguity, coverage, and what to add.

    `drive` is a recording with truth whose pictures are compared with the library as well: pictures of one
    survey err alike, so that only a drive shows whether a robot's pictures fit where they were taken, and
    how often the right reference is found (`found`), which `curves` draws (.svg, .pdf). `reading` says how
    it is read.

    `feature` is a feature or a channel by name, or a network, `onnx:FILE.onnx`. `to` also draws the map of
    expected ambiguity and of references to add (.png), `poses` writes these as a table (.csv). Raises
    InputError for a library that cannot be opened or lacks a channel of the feature.

        >>> import maurice_viz as mv
        >>> check = mv.check_library("survey.log")
        >>> check.library.size, check.similarity.spacing_m
        (160, 0.5)
    """
    path = Path(library)
    if to is not None:
        _checked_map(Path(to), force=force)
    for target in (poses, curves):
        if target is not None:
            expect_absent(Path(target), force=force)
    opened = library_at(path, listener)
    recorded = None if drive is None else open_session(Path(drive), reading or Reading(), listener)
    configuration = Filter(feature=feature).configuration()
    info = None if recorded is None else recorded.info
    (opened,) = completed([configuration], opened, info, listener.progress, listener.warning)
    weights = configuration.parameters.sensor.weights
    _check_channels(path, opened, weights)
    nearest = nearest_reference(opened.poses, opened.arena)
    own = own_scaled(configuration, opened, nearest).parameters.sensor.scales
    table = LeftOutTable.of(SensorModel(opened, nearest, SensorParameters(dict(weights), scales=own)))
    similarity = self_similarity_of(table, progress_of(listener, "compare"))
    telling = score_places(table)
    wanted_m = _wanted_m(opened, similarity, telling)
    covered, advice = coverage_of(opened, wanted_m), advise(opened, replace(similarity, spacing_m=wanted_m))
    of_drive = None if recorded is None else score_feature(opened, weights, recorded)
    recognition = None if recorded is None else _recognition(opened, weights, recorded, listener)
    check = LibraryCheck(
        opened, similarity, covered, telling, advice, wanted_m, weights, of_drive, recognition
    )
    if to is not None:
        check.draw(to, force=force)
    if poses is not None:
        check.write_poses(poses, force=force)
    if curves is not None:
        check.draw_curves(curves, force=force)
    return check


def _check_channels(path: Path, library: Library, weights: Mapping[str, float]) -> None:
    """Refuse a library without a channel that has a weight."""
    missing = [name for name in weights if name not in {*library.index, *POSE_SENSORS}]
    if missing:
        content = f"the library {library.name!r} holds {', '.join(library.index) or 'no channel'}"
        raise InputError(path, f"{content}, and {missing[0]} is wanted; build the library again")


def _recognition(
    library: Library, weights: Mapping[str, float], drive: RecordedSession, listener: Listener
) -> PlaceRecognition:
    """Return how often the right reference is found in a drive's pictures, per channel and together."""
    retrieval = look_up_drive(library, weights, drive, progress_of(listener, "look up"))
    return PlaceRecognition.of(retrieval, list(weights))


def _wanted_m(library: Library, similarity: SelfSimilarity, telling: PlaceScore) -> float:
    """Return how far apart places should be, in meters; their spacing where that will do.

    It will not where a picture no longer looks like its reference at the next place, or where a few places
    cannot be told apart: then their number says how many the free space needs at least.
    """
    wanted_m = similarity.spacing_m
    if similarity.is_sparse:
        wanted_m = max(similarity.reach_m, wanted_m / 2)
    if telling.worse_than_nothing and telling.places < ENOUGH_PLACES:
        area_m2 = coverage_of(library, wanted_m).free_m2
        wanted_m = min(wanted_m, float(np.sqrt(area_m2 / ENOUGH_PLACES)) or wanted_m)
    return wanted_m


def _pose(pose: F64) -> dict[str, float]:
    x_m, y_m, heading_rad = pose.tolist()
    return {"x_m": x_m, "y_m": y_m, "heading_rad": heading_rad}


def _checked_map(path: Path, *, force: bool) -> Path:
    if path.suffix != ".png":
        raise OptionError(f"-o ends in .png, found {str(path)!r}")
    expect_absent(path, force=force)
    return path


def say_default(library: Library, *, fitted: bool = True) -> Iterator[str]:
    """Yield what the library's own pictures show about the default filter, with or without its own scales."""
    if library.size:
        reference = nearest_reference(library.poses, library.arena)
        _, telling = adapted(configure([]), library, reference)
        if telling is not None and not fitted:
            telling = replace(telling, stretched={})
        yield from say_places(library.name, FEATURES["blended"], telling)


def say_scales(library: Library) -> Iterator[str]:
    """Yield what the library's own pictures show about the features that are mostly used with it."""
    reference, stretched = nearest_reference(library.poses, library.arena), dict[str, float]()
    for weights in (FEATURES["blended"], FEATURES["best"]):
        _, telling = adapted(configure([Layer("feature", {"sensor.weights": weights})]), library, reference)
        if telling is not None:
            new = {name: factor for name, factor in telling.stretched.items() if name not in stretched}
            telling, stretched = replace(telling, stretched=new), stretched | new
        yield from say_places(library.name, weights, telling)
