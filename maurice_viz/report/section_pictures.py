"""The section of pictures: what the camera saw and where the particles were, at the steps chosen."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from ..look import ESTIMATE, TRUTH
from .choosing import RULE, Scene
from .contents import Report
from .markup import Markup, data_url, joined, tag
from .shots import Shot


def pictures(report: Report) -> Markup:
    """Give an article for each step that has a picture, and the key before them."""
    truth = _disk(TRUTH, "truth") if report.runs[0].manifest.has_truth else ""
    weights = tag("span", "particles by weight: 1/8", tag("span", class_="ramp"), "8 times the average")
    key = joined([tag("p", RULE), tag("p", "On the maps: ", truth, _disk(ESTIMATE, "estimate"), weights)])
    return joined([key, *(_scene(report, scene) for scene in report.scenes)])


def _disk(color: tuple[int, int, int], text: str) -> Markup:
    disk = tag("span", class_="disk", style=f"background:rgb{color}")
    return tag("span", disk, text, class_="key")


def _scene(report: Report, scene: Scene) -> Markup:
    shot, track = report.shots.get(scene.step), report.collected.tracks[0]
    row = int(np.flatnonzero(track.column("step") == scene.step)[0])
    time_s = float(track.column("time_s")[row])
    heading = tag("h3", f"{scene.number}. Step {scene.step}, {time_s:.1f} s")
    reasons = tag("ul", (tag("li", text) for text in scene.reasons))
    figures = _figures(report, scene, shot, row) if shot is not None else ()
    return tag("article", heading, reasons, tag("div", figures, class_="shots"), class_="scene",
               id=f"picture-{scene.number}")  # fmt: skip


def _figures(report: Report, scene: Scene, shot: Shot, row: int) -> Iterable[Markup]:
    if shot.camera is None:
        camera = tag("div", "the picture is not at hand", class_="none")
    else:
        alt = f"What the camera saw at step {scene.step}"
        camera = tag("img", src=data_url(shot.camera, "image/jpeg"), alt=alt)
    yield tag("figure", camera, tag("figcaption", "camera"), class_="camera")
    yield tag("div", _maps(report, scene, shot, row), class_="maps")


def _maps(report: Report, scene: Scene, shot: Shot, row: int) -> Iterator[Markup]:
    for track in report.collected.tracks:
        error = track.column("position_error_m")[row]
        pose = report.scale.say_pose(track.path("estimate")[row])
        off = f", error {report.scale.say(float(error))}" if np.isfinite(error) else ""
        said = f"{track.label}: estimate {pose}{off}, confidence {track.column('confidence')[row]:.0%}"
        alt = f"Map of step {scene.step} with the particles. {said}"
        image = tag("img", src=data_url(shot.maps[track.label], "image/jpeg"), alt=alt)
        yield tag("figure", image, tag("figcaption", said))
