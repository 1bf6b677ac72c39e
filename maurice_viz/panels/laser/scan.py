"""The scan by itself, where the camera's picture stands for others, and on the map around each estimate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.sensor.laser.reading import LaserReading
from maurice_mcl.sensor.laser.sensor import LASER, Laser
from maurice_mcl.values import F32, MOST_APART, Library, Moment, PoseSpread, StepRecord, spacing

from ...drawing.arrow import blob_of, row_of
from ...drawing.scan import WIDTH_PX, draw_scan, draw_scan_on_map, no_scan
from ...entities import Phase, RunPaths
from ...scene import RunView, Scene
from ...style import RGB, TRUTH, Order
from ..camera import draw_name, named_view
from ..panel import Panel, StepUpdate, set_phase

SEES = "the laser sees"
TURNS, OF_SIDE = 24, 12**-0.5  # headings; standard deviation of what is anywhere on a side of length 1
SEARCHED = 200  # of the best places
NO_SCAN, TOO_FEW = "no scan at this step", "too few beams hit something"


class ScanPanel(Panel):
    """Draws each scan from above, and on the map around the estimate."""

    def __init__(self, run: RunView, scene: Scene) -> None:
        super().__init__(run, scene)
        self._laser = scene.laser_of(run)
        self._draws_scan = run.number == 0 or run.own_drive

    def prepare(self, rec: rr.RecordingStream) -> None:
        if self._laser is None:
            return
        if self._draws_scan:
            prepare_scan(rec, seen_path(self._paths), SEES, TRUTH)
        prepare_scan(rec, here_path(self._paths), f"{self._run.short} thinks it is here", self._run.color)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        laser, scan, record = self._laser, update.moment.frame.scan, update.record
        if laser is None:
            return
        if self._draws_scan:
            set_phase(rec, update.moment, Phase.MEASURE)
            log_png(
                rec,
                seen_path(self._paths),
                no_scan(NO_SCAN) if scan is None else draw_scan(scan, self._scale),
            )
        set_phase(rec, update.moment, Phase.WEIGHT)  # the estimate follows from the weights
        reading = reading_of(update.moment, record, laser)
        if reading is None:
            picture = no_scan(NO_SCAN if scan is None else TOO_FEW)
        else:
            judgment, pose = laser.judged(reading, record.estimate.pose), record.estimate.pose
            picture = draw_scan_on_map(reading, judgment, pose, laser.occupancy, self._run.color, self._scale)
        log_png(rec, here_path(self._paths), picture)


def reading_of(moment: Moment, record: StepRecord, laser: Laser) -> LaserReading | None:
    """Return the beams of an update that are compared with the map; None without a scan that tells."""
    sensed = record.sighting.comparison.sensed
    reading = next((each.reading for each in sensed if each.name == LASER), None)
    return reading if isinstance(reading, LaserReading) else laser.read(moment.frame)


class PlacesOnMap:
    """The places of a library in many headings, to ask how likely a scan makes each."""

    def __init__(self, library: Library) -> None:
        places, self._place = np.unique(library.poses[:, :2] - library.origin, axis=0, return_inverse=True)
        turns = np.arange(TURNS) * (2 * np.pi / TURNS)
        poses = np.column_stack([np.repeat(places, TURNS, axis=0), np.tile(turns, len(places))])
        self._poses, self._origin = poses.astype(np.float32), library.origin
        side_m = spacing(places) if len(places) > 1 else 0.0
        self._spread = PoseSpread(min(OF_SIDE * side_m, MOST_APART.position_m), OF_SIDE * 2 * np.pi / TURNS)
        along, turned = np.linspace(-0.4, 0.4, 5) * side_m, np.linspace(-1 / 3, 1 / 3, 3) * 2 * np.pi / TURNS
        self._around = np.stack(np.meshgrid(along, along, turned), axis=-1).reshape(-1, 3).astype(np.float32)
        self._fine = PoseSpread(self._spread.position_m / 5, self._spread.heading_rad / 3)

    def nats(self, laser: Laser, reading: LaserReading) -> F32:
        """Return the nats (L,) of a scan around each entry's place in its best heading.

        Places are far apart for a laser: the best of them are searched more closely.
        """
        nats = laser.log_likelihood(reading, self._poses, self._origin, self._spread).reshape(-1, TURNS)
        best = nats.max(axis=1)
        closer = np.argsort(best)[-SEARCHED:]
        poses = self._poses.reshape(-1, TURNS, 3)[closer, nats[closer].argmax(axis=1)]
        around = (poses[:, None] + self._around).reshape(-1, 3)
        fine = laser.log_likelihood(reading, around, self._origin, self._fine)
        best[closer] = np.maximum(best[closer], fine.reshape(len(closer), -1).max(axis=1))
        return np.asarray(best[self._place.ravel()], np.float32)


def seen_path(paths: RunPaths) -> str:
    """Return where the scan by itself is drawn, once for runs of one drive."""
    return paths.at("scan", "seen")


def here_path(paths: RunPaths) -> str:
    """Return where the scan is drawn on the map around the estimate."""
    return paths.at("scan", "here")


def prepare_scan(rec: rr.RecordingStream, path: str, name: str, color: RGB) -> None:
    """Log the kind of a picture and its name above it, static."""
    rec.log(path, rr.EncodedImage.from_fields(media_type="image/png", draw_order=Order.GROUND), static=True)
    draw_name(rec, path, name, WIDTH_PX, color)


def log_png(rec: rr.RecordingStream, path: str, data: bytes) -> None:
    """Log an encoded drawing."""
    rec.log(path, row_of(rr.EncodedImage, blob=blob_of(data)))


def scan_views(runs: Sequence[RunView]) -> list[rrb.Spatial2DView]:
    """Show the scan by itself, of runs over different drives each one's."""
    whose = [run for run in runs if run.number == 0 or run.own_drive]
    return [named_view("The laser sees", seen_path(run.paths)) for run in whose]


def here_view(run: RunView) -> rrb.Spatial2DView:
    """Show the scan on the map around a run's estimate."""
    return named_view("Where it thinks it is", here_path(run.paths))
