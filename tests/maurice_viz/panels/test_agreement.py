"""Every panel, text, trace and score of a kidnapped drive is what its step records say, phase by phase."""

from __future__ import annotations

import re
from collections import defaultdict
from dataclasses import dataclass

import numpy as np
import pytest

import maurice_viz as mv
from helpers import viz_fakes as fakes
from helpers import viz_recordings as recordings
from maurice_mcl.config.build import make_localizer
from maurice_mcl.filter.estimate import share_within, weighted_mean
from maurice_mcl.filter.localizer import run
from maurice_mcl.filter.recovery import DRAWS_WHERE_LIKELY
from maurice_mcl.reasons.explanation import offset
from maurice_mcl.scoring.events import KINDS, OF_RUN, EventDetector
from maurice_mcl.values.map import Arena
from maurice_mcl.values.records import PICTURE
from maurice_mcl.values.session import Moment
from maurice_viz import entities
from maurice_viz.drawing.canvas import arena_extent
from maurice_viz.entities import PHASES_PER_STEP, Phase, RunPaths
from maurice_viz.panels.belief import copies_of, ellipse_of, positions
from maurice_viz.panels.events import LINE_COLORS, own_path, word_of
from maurice_viz.panels.inside import AFTER, BEFORE, DOT
from maurice_viz.panels.population import outline
from maurice_viz.playback import ResultCollector
from maurice_viz.style import (
    DEAD,
    FRESH,
    STATES,
    mode_color,
    packed,
    scale_for,
    weight_colors,
    weight_shades,
)
from maurice_viz.text import phases
from maurice_viz.text.phases import phase_words, reseeded

ARENA = Arena((0.0, 0.0, 2.0, 2.0), np.zeros((0, 4)))

RUN, STEPS, CARRIED = RunPaths("robust"), 16, 8
COMPONENTS = {
    RUN.particles: "Points2D:positions",
    RUN.estimate: "Points2D:positions",
    RUN.headings: "LineStrips2D:strips",
    RUN.text: "TextDocument:text",
}


@dataclass(frozen=True, eq=False)
class Carried(fakes.FakeSession):
    """The robot is carried to the opposite corner before one of its pictures."""

    def moments(self):
        for moment in fakes.FakeSession.moments(self):
            if moment.frame.step < CARRIED:
                yield Moment(moment.frame, moment.truth, ())
                continue
            x_min, y_min, x_max, y_max = self.library.arena.bounds
            truth = moment.truth + np.array([0.35 * (x_max - x_min), 0.4 * (y_max - y_min), 0.0])
            truth[:2] = np.clip(truth[:2], (x_min + 0.1, y_min + 0.1), (x_max - 0.1, y_max - 0.1))
            frame = fakes.changed(moment.frame, image=fakes.picture_at(truth))
            yield Moment(frame, truth, ("kidnapped",) if moment.frame.step == CARRIED else ())


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """The records of a drive, and what of them was drawn: by entity, component and phase number."""
    library = fakes.make_library()
    made = fakes.make_session(library, STEPS)
    session = Carried(made.info, library, STEPS)
    settings = {"recovery.strategy": "augmented", "recovery.augmented.slow": 0.05}
    localizer = make_localizer(library, feature="blended", particles=150, settings=settings)
    first = next(iter(session.moments()))
    played = list(run(localizer.of_session(session), session, first.truth))
    path = tmp_path_factory.mktemp("agreement") / "out.rrd"
    scale = scale_for("in", library.arena)
    recordings.draw_run(path, session, RUN.label, localizer, played)
    return played, path, scale


def shown(path, entity, component):
    """What a person sees of a component at every phase number: the latest value."""
    logged = {
        row.phase: row.values[component]
        for row in recordings.having(recordings.rows(path, entity), component)
    }
    seen, last = {}, None
    for number in range(PHASES_PER_STEP, PHASES_PER_STEP * (STEPS + 1)):
        last = logged.get(number, last)
        seen[number] = last
    return seen


def test_the_drive_has_what_the_walk_is_for(drive):
    played, _, _ = drive
    events = {event for _, record in played for event in record.events}
    assert "reseeded" in events
    errors = [np.hypot(*(record.estimate.pose[:2] - moment.truth[:2])) for moment, record in played]
    assert errors[CARRIED - 2] < 0.2 < 0.5 < errors[CARRIED - 1]
    assert errors[-1] < 0.3


def test_cloud_estimate_and_headings_are_those_of_each_phase(drive):
    played, path, scale = drive
    cloud, estimate, heads = (
        shown(path, entity, COMPONENTS[entity]) for entity in (RUN.particles, RUN.estimate, RUN.headings)
    )
    for moment, record in played:
        base = PHASES_PER_STEP * moment.frame.step
        lightest_first = np.argsort(weight_shades(record.weighted.log_weights), kind="stable")
        places = positions(record.predicted, scale)[lightest_first]
        for phase in Phase:
            number = base + phase
            assert np.asarray(cloud[number]) == pytest.approx(places, abs=1e-3)
            weighed = phase >= Phase.WEIGHT
            expected = [scale.screen(record.estimate.pose[None, :2])[0].tolist()] if weighed else []
            assert np.asarray(estimate[number]) == pytest.approx(np.asarray(expected), abs=1e-3)
            of = outline(record.weighted if weighed else record.predicted)
            assert np.asarray(heads[number][0]) == pytest.approx(of, abs=1e-5)


def test_texts_are_those_of_each_phase(drive):
    played, path, scale = drive
    texts = shown(path, RUN.text, COMPONENTS[RUN.text])
    headlines = shown(path, RUN.inside("words"), COMPONENTS[RUN.text])
    for moment, record in played:
        for phase in Phase:
            number = PHASES_PER_STEP * moment.frame.step + phase
            assert texts[number] == [phases.summary(moment, record, scale)]
            words = phase_words(moment, record, phase, scale, DRAWS_WHERE_LIKELY)
            if phase is Phase.MEASURE:  # also says how far away the best match was taken
                words = words.removesuffix(" No dot moves.")
            assert headlines[number][0].startswith(f"#### {words}")
            assert words.startswith(f"Step {moment.frame.step}, {phase + 1} {phase.name.lower()}: ")


def test_before_and_after_are_the_clouds_of_each_phase(drive):
    """After a phase is before the next one; the answer is there in the last one alone."""
    played, path, scale = drive
    sides = {}
    for side in (BEFORE, AFTER):
        parts = ("positions", "radii", "colors")
        sides[side] = [shown(path, RUN.inside(side), f"Points2D:{part}") for part in parts]
    answer = shown(path, RUN.inside("answer"), "Points2D:positions")
    truths = shown(path, RUN.inside(BEFORE, "truth"), "Points2D:positions")
    reseeded, last = 0, None
    for moment, record in played:
        numbers = [PHASES_PER_STEP * moment.frame.step + phase for phase in Phase]
        before, after = (
            [[np.asarray(part[number]) for part in sides[side]] for number in numbers] for side in sides
        )
        for phase in Phase:
            assert np.asarray(answer[numbers[phase]]).size == (2 if phase is Phase.ESTIMATE else 0)
            if phase is not Phase.PREDICT:
                for part, same in zip(before[phase], after[phase - 1], strict=True):
                    assert np.array_equal(part, same), (moment.frame.step, phase)
        alike = np.argsort(record.weighted.weights, kind="stable")
        for number, belief in ((Phase.PREDICT, record.predicted), (Phase.WEIGHT, record.weighted)):
            places, radii, _ = after[number]
            assert places == pytest.approx(positions(belief, scale)[alike], abs=1e-3)
            areas = np.square(radii / DOT)
            times = belief.weights[alike] * belief.size
            assert areas == pytest.approx(times, rel=0.2, abs=0.35)
        if record.parents is not None:
            dead = after[Phase.RESAMPLE][2] == packed(DEAD)
            assert np.array_equal(dead, copies_of(record.parents, 150)[alike] == 0)
        fresh = after[Phase.RESEED][2] == packed(FRESH)
        assert fresh.sum() == (0 if record.injected is None else record.injected.sum())
        reseeded += fresh.any()
        if last is not None:
            assert truths[numbers[0]][0] == pytest.approx(scale.screen(last[None, :2])[0], abs=1e-3)
        last = moment.truth
    assert reseeded


@pytest.mark.parametrize("strategy", ["threshold", "sensor", "augmented", "expansion"])
def test_texts_of_recovery_have_the_numbers_of_the_record(strategy):
    library = fakes.make_library()
    session = Carried(fakes.make_session(library, STEPS).info, library, STEPS)
    settings = {
        "recovery.strategy": strategy,
        "recovery.sensor.evidence": -3.0,
        "recovery.expansion.evidence": -3.0,
        "recovery.augmented.slow": 0.05,
    }
    localizer = make_localizer(library, feature="blended", particles=150, settings=settings)
    first = next(iter(session.moments()))
    acted = 0
    for moment, record in run(localizer.of_session(session), session, first.truth):
        text = phases.summary(moment, record, scale_for("in", library.arena))
        test = record.recovery_test
        fresh = 0 if record.injected is None else int(record.injected.sum())
        assert (f"**{fresh} fresh** particles" in text) == (fresh > 0)
        if fresh and test is not None:
            numbers = [float(number) for number in re.findall(r"-?\d+\.\d+", text.split("esampled. ")[1])]
            assert numbers == pytest.approx([test.found, test.threshold], abs=0.05)
            assert numbers[0] < numbers[1]
            assert ("this picture" in text.lower()) == (test.compared == PICTURE)
        said = reseeded(record)
        assert (f"{fresh} of {record.belief.size} dots are new" in said) == (fresh > 0)
        acted += fresh > 0 or "moved at random" in said
    assert acted


def test_traces_scores_and_verdict_agree(drive):
    played, path, scale = drive
    collector = ResultCollector([RUN.label], ARENA)
    rows = defaultdict(list)
    for moment, record in played:
        collector.add(moment, {RUN.label: record})
        off = offset(record.estimate.pose, moment.truth)
        rows["position_error"].append(scale.length(off.apart_m))
        rows["heading_error"].append(np.degrees(off.turned_rad))
        rows["spread"].append(scale.length(np.hypot(*weighted_mean(record.weighted).sd_m)))
        rows["confidence"].append(
            share_within(record.weighted, record.estimate.pose, record.estimate.radii.confidence_m)
        )
        rows["effective_sample"].append(1 / (record.weighted.weights**2).sum() / record.weighted.size)
    for quantity, expected in rows.items():
        drawn = [
            row.values["Scalars:scalars"][0]
            for row in recordings.having(recordings.rows(path, RUN.trace(quantity)), "Scalars:scalars")
        ]
        assert drawn == pytest.approx(expected, rel=1e-5, abs=1e-6), quantity
    (result,) = collector.results()
    verdict = result.verdict
    assert scale.length(verdict.error_most_m) == pytest.approx(max(rows["position_error"][3:]))
    assert scale.length(verdict.error_end_m) == pytest.approx(rows["position_error"][-1])
    assert verdict.error_mean_m == pytest.approx(result.score.error_mean_m)
    (episode,) = verdict.episodes
    assert (episode.kind, episode.first, verdict.decisive) == ("kidnapped", CARRIED, CARRIED)
    assert episode.localized is not None
    fresh = {moment.frame.step: record.injected for moment, record in played if record.injected is not None}
    assert episode.fresh == sum(
        fresh[step].sum() for step in range(CARRIED, episode.localized) if step in fresh
    )


def test_the_way_of_a_kidnapping_is_that_of_the_truth(drive):
    played, path, scale = drive
    origins = shown(path, entities.CARRIED, "Arrows2D:origins")
    arrows = shown(path, entities.CARRIED, "Arrows2D:vectors")
    labels = shown(path, entities.CARRIED, "Arrows2D:labels")
    truths = {moment.frame.step: moment.truth for moment, _ in played}
    way = np.stack([truths[CARRIED - 1][:2], truths[CARRIED][:2]])
    length = scale.say(float(np.hypot(*(way[1] - way[0]))))
    for step in truths:
        number = PHASES_PER_STEP * step + Phase.ESTIMATE
        if CARRIED <= step < CARRIED + 10:
            begin, end = scale.screen(way)
            assert np.array(origins[number][0]) == pytest.approx(begin, abs=1e-3)
            share = np.array(arrows[number][0]) / (end - begin)  # it ends right before the disk
            assert share[0] == pytest.approx(share[1])
            assert 0.5 <= share[0] < 1
            assert labels[number] == [f"carried {length}"]
        else:
            assert not arrows.get(number)


def test_ellipse_and_rings_are_those_of_each_phase(drive):
    played, path, scale = drive
    ellipses = shown(path, RUN.ellipses, "LineStrips2D:strips")
    extent = arena_extent(fakes.make_library().arena, scale)
    rings, colors, labels = (
        {number: drawn or [] for number, drawn in shown(path, RUN.mode_rings, f"LineStrips2D:{part}").items()}
        for part in ("strips", "colors", "labels")
    )
    detector = EventDetector(scale.say)
    for moment, record in played:
        detector.see(moment, record)
        modes = [mode for mode in detector.modes if mode.estimate.mass >= 0.1]
        modes = modes if len(modes) > 1 else []
        for phase in Phase:
            number, weighed = PHASES_PER_STEP * moment.frame.step + phase, phase >= Phase.WEIGHT
            assert len(ellipses[number]) == weighed
            assert len(rings[number]) == len(colors[number]) == (len(modes) if weighed else 0)
        (ellipse,) = ellipses[PHASES_PER_STEP * moment.frame.step + Phase.WEIGHT]
        whole = ellipse_of(record.weighted, scale)
        sd = np.array([scale.length(one) for one in record.mean_estimate.sd_m])
        assert np.ptp(whole, axis=0) == pytest.approx(4 * sd, rel=0.02, abs=0.1)
        assert np.array(ellipse) == pytest.approx(extent.cut(whole), abs=1e-3)
        number = PHASES_PER_STEP * moment.frame.step + Phase.WEIGHT
        for mode, ring, color in zip(modes, rings[number], colors[number], strict=True):
            middle = np.array(ring)[:-1].mean(axis=0)
            assert middle == pytest.approx(scale.screen(mode.estimate.pose[None])[0], abs=0.05)
            assert color == packed(mode_color(mode.identity))
        assert labels[number] == [f"{100 * mode.estimate.mass:.0f} %" for mode in modes]


def test_band_and_lines_of_events_are_those_of_the_records(drive):
    played, path, scale = drive
    spread = np.array([scale.length(np.hypot(*weighted_mean(record.weighted).sd_m)) for _, record in played])
    band = recordings.having(recordings.rows(path, RUN.trace("two_sigma")), "Measurements:values")
    middle, variance = (
        np.array([row.values[f"Measurements:{name}"][0] for row in band]) for name in ("values", "variances")
    )
    assert middle == pytest.approx(spread, rel=1e-5)
    assert middle + np.sqrt(variance) == pytest.approx(2 * spread, rel=1e-5)
    detector, expected = EventDetector(scale.say), defaultdict(list)
    for moment, record in played:
        for event in detector.see(moment, record):
            if event.kind in LINE_COLORS and not event.continues:
                expected[event.kind].append(event.step)
    assert {"kidnapped", "reseeded"} <= set(expected)
    most = max(scale.length(offset(record.estimate.pose, moment.truth).apart_m) for moment, record in played)
    radii = played[0][1].estimate.radii  # by which the run is judged
    drawn = recordings.rows(path, f"{RUN.trace('position_error')}/limits/lost")
    near = scale.length(radii.lost_m) <= 2 * most
    assert [(row.step, row.values["Scalars:scalars"]) for row in drawn] == [
        (step, [pytest.approx(scale.length(radii.lost_m))]) for step in (1, STEPS) if near
    ]
    for quantity in ("position_error", "heading_error", "spread", "confidence", "evidence", "ancestors"):
        for kind, steps in expected.items():
            lines = recordings.rows(path, f"{RUN.trace(quantity)}/events/{kind}")
            assert [row.step for row in lines] == [step for step in steps for _ in range(3)]
            low, high, between = (row.values["Scalars:scalars"][0] for row in lines[:3])
            assert low < high
            assert np.isnan(between)


def test_lanes_are_what_the_detector_says(drive):
    played, path, scale = drive
    detector = EventDetector(scale.say)
    style = recordings.static(path, own_path(RUN))
    colors = dict(zip(style["StateConfiguration:values"], style["StateConfiguration:colors"], strict=True))
    lanes = shown(path, own_path(RUN), "StateChange:state")
    for moment, record in played:
        events = {event.kind for event in detector.see(moment, record) if not event.is_routine}
        _, state, noticed = lanes[PHASES_PER_STEP * moment.frame.step + Phase.ESTIMATE]
        assert colors[state] == packed(STATES[detector.state])
        events = [kind for kind in KINDS if kind in events and OF_RUN in KINDS[kind].lanes]
        if events:
            assert noticed.startswith(word_of(events[0]))
    assert weight_colors(played[0][1].weighted.log_weights).shape[0] == played[0][1].weighted.size


def test_a_recording_decides_what_happened_only_when_the_run_is_over(small_session, monkeypatch):
    asked = []

    def counted(decide):
        def count(self):
            asked.append(self.updates)
            return decide(self)

        return count

    for name in ("results", "verdicts"):
        monkeypatch.setattr(ResultCollector, name, counted(getattr(ResultCollector, name)))
    scores = mv.replay(small_session, filter=mv.Filter(particles=50), to="run.rrd")
    assert set(asked) == {scores.runs[0].score.updates}
