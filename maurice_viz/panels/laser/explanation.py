"""Why an estimate fits the scan, or does not: the scan at the estimate and at the truth, beam by beam."""

from __future__ import annotations

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.sensor.laser.sensor import LASER
from maurice_mcl.values import Comparison, PoseProposal

from ...drawing.arrow import points_of, row_of, text_of
from ...drawing.scan import draw_ranges, draw_scan_on_map
from ...entities import Phase, RunPaths
from ...scene import RunView, Scene
from ...style import RANK, TRUTH, Order
from ...text.laser.scan import scan_table, scan_words
from ..camera import named_view
from ..panel import MARKDOWN, Panel, StepUpdate, joined_labels, set_phase
from ..population import mode_room
from ..references import likelihood_views
from .scan import here_view, log_png, prepare_scan, reading_of

NOT_DRAWN = "Not drawn at this step."
MODES = 5  # of a proposal that are marked


class ScanExplanationPanel(Panel):
    """Draws each full update of a run that has a laser alone."""

    def prepare(self, rec: rr.RecordingStream) -> None:
        if not self._run.sees_alone:
            return
        for part in ("words", "table"):
            rec.log(self._paths.explain(part), rr.TextDocument.from_fields(media_type=MARKDOWN), static=True)
        for name, color in (("estimate", self._run.color), ("truth", TRUTH)):
            prepare_scan(rec, self._paths.explain("ranges", name), f"ranges at the {name}", color)
        prepare_scan(rec, self._paths.explain("scan", "truth"), "at the truth", TRUTH)
        points = rr.components.Radius.ui_points(5.0)
        modes = rr.Points2D.from_fields(
            colors=[RANK], radii=points, show_labels=True, draw_order=Order.EXPLAINED
        )
        rec.log(self._paths.explain("proposed"), modes, static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        laser = self._scene.laser_of(self._run) if self._run.sees_alone and update.whole else None
        if laser is None:
            return
        reading = reading_of(update.moment, update.record, laser)
        comparison = update.record.sighting.comparison
        set_phase(rec, update.moment, Phase.ESTIMATE)
        if reading is None:
            self.clear(rec)
            return
        poses = {"estimate": update.record.estimate.pose}
        if update.moment.truth is not None:
            poses["truth"] = update.moment.truth
        judged = {name: laser.judged(reading, pose) for name, pose in poses.items()}
        for name, judgment in judged.items():
            color = self._run.color if name == "estimate" else TRUTH
            log_png(
                rec, self._paths.explain("ranges", name), draw_ranges(judgment, reading, color, self._scale)
            )
        if "truth" in judged:
            picture = draw_scan_on_map(
                reading, judged["truth"], poses["truth"], laser.occupancy, TRUTH, self._scale
            )
            log_png(rec, self._paths.explain("scan", "truth"), picture)
        proposal = proposed(comparison)
        self._mark(rec, proposal)
        words = scan_words(judged["estimate"], proposal, self._scale)
        nats = {name: laser.nats_at(reading, pose) for name, pose in poses.items()}
        self._say(rec, words, scan_table(judged, nats, laser.parameters.model, self._scale))

    def clear(self, rec: rr.RecordingStream) -> None:
        if self._run.sees_alone:
            self._mark(rec, None)
            self._say(rec, NOT_DRAWN, "")

    def _say(self, rec: rr.RecordingStream, words: str, table: str) -> None:
        for part, text in (("words", words), ("table", table)):
            rec.log(self._paths.explain(part), row_of(rr.TextDocument, text=text_of(text)))

    def _mark(self, rec: rr.RecordingStream, proposal: PoseProposal | None) -> None:
        """Log the modes that the scan proposed, with their weights."""
        order = [] if proposal is None else np.argsort(-proposal.weights)[:MODES].tolist()
        places = (
            np.zeros((0, 2), np.float32)
            if proposal is None
            else self._scale.screen(proposal.poses[order, :2])
        )
        labels = [] if proposal is None else [f"proposed {proposal.weights[k]:.0%}" for k in order]
        labels = joined_labels(places, mode_room(self._scene), labels)
        modes = rr.Points2D.from_fields(labels=labels)
        rec.log(self._paths.explain("proposed"), row_of(rr.Points2D, positions=points_of(places)), modes)


def proposed(comparison: Comparison) -> PoseProposal | None:
    """Return what the laser proposed, if the filter asked for it: asking now would search the map."""
    readings = [each for each in comparison.sensed if each.name == LASER and "proposal" in each.__dict__]
    return readings[0].proposal if readings else None


def scan_map_view(run: RunView, scene: Scene) -> rrb.Spatial2DView:
    """Show how likely the scan makes each part of the map, under the cloud, and what it proposed."""
    return likelihood_views(run.paths, (), scene, [run.paths.explain("proposed")])[0]


def columns_of_scan(run: RunView, scene: Scene) -> rrb.Horizontal:
    """Show the scan on the map over its ranges: at the estimate, and at the truth where that is known."""
    paths = run.paths
    columns = [rrb.Vertical(here_view(run), _ranges_view(paths, "estimate"))]
    if scene.has_truth:
        at_truth = named_view("At the truth", paths.explain("scan", "truth"))
        columns.append(rrb.Vertical(at_truth, _ranges_view(paths, "truth")))
    return rrb.Horizontal(*columns)


def _ranges_view(paths: RunPaths, name: str) -> rrb.Spatial2DView:
    return named_view(f"Ranges at the {name}", paths.explain("ranges", name))
