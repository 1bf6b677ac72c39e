"""The sentences, the table and the names say what the explanation holds."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from helpers import viz_fakes as fakes
from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import of_feature
from maurice_mcl.filter.localizer import run
from maurice_mcl.reasons.explanation import (
    ChannelExplanation,
    StepExplanation,
    explain_step,
    where_lost,
)
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.values.arrays import F32, F64
from maurice_mcl.values.library import Library
from maurice_viz.style import scale_for
from maurice_viz.text.explanation import KNOWN, ordinal, planes_of, say_behind, say_step
from maurice_viz.text.explanation_table import brief_table, to_json


def explained(
    library: Library, *, asked: F64 | int | None = None, truth: bool = True, weigh: bool = True
) -> StepExplanation:
    session = fakes.make_session(library, 1)
    localizer = build_localizer(library, session, of_feature("blended", 100))
    ((moment, record),) = run(localizer, session, None)
    return explain_step(record, localizer.sensor, moment.truth if truth else None, asked, weigh=weigh)


@pytest.fixture(scope="module")
def library() -> Library:
    return fakes.make_library()


def channel(name: str, nats: F32, sample: F32, reference: F32) -> ChannelExplanation:
    return ChannelExplanation(
        name, "l1", 1.0, 1.0, 0.5, 2, float(nats.sum()), sample, reference, contributions=nats
    )


def test_it_names_where_most_is_lost():
    nothing = np.zeros(84, np.float32)
    nats, reference = nothing.copy(), nothing.copy()
    nats[56 + 10 : 56 + 13] = 1.0
    reference[56 + 10 : 56 + 13] = 8.0
    mine, best = channel("color", nats, nothing, reference), channel("color", nothing, nothing, nothing)
    where = where_lost(mine, best, 3)
    name = planes_of("color", 84).name(where.plane, where.first, where.last)
    assert name == "blue 96 to 119"  # 16 + 8 * 10 to 16 + 8 * 12 + 7
    assert where.nats == pytest.approx(3.0)
    assert (where.picture, where.reference) == (0, 8)
    sample, reference, nats = (np.zeros(84, np.float32) for _ in range(3))
    sample[5:8], reference[8:12] = 20.0, 15.0
    nats[5:12] = (1, 1, 1, 2, 2, 2, 2)
    mine, best = channel("color", nats, sample, reference), channel("color", 0 * nats, sample, sample)
    where = where_lost(mine, best, 3)
    assert (where.picture, where.reference) == (0, 15)
    same = np.ones(84, np.float32)
    assert where_lost(channel("color", same, same, same), channel("color", same, same, same), 3) is None


def test_a_run_that_loses_more_than_its_channel_is_no_part_of_it(library):
    """The rest was won elsewhere; what verification takes is told first where it is the most."""
    nothing = np.zeros(84, np.float32)
    nats, sample, reference = nothing.copy(), nothing.copy(), nothing.copy()
    nats[56 + 10 : 56 + 13], reference[56 + 10 : 56 + 13] = 1.0, 8.0
    nats[:14], sample[:14] = -0.1, 20.0  # 3.0 lost there, 1.4 won here
    step = explained(library)
    best = replace(step.winner, channels=(channel("color", nothing, nothing, nothing),), verified=0.0)
    lost = (channel("color", nats, sample, reference),)
    behind = replace(best, entry=best.entry + 1, channels=lost, behind=1.6)
    truth, _, winner = step.shown
    scale = scale_for("in", library.arena)
    shown = replace(truth, entry=behind), replace(winner, entry=best)
    says = " ".join(say_step(replace(step, shown=shown), scale))
    assert "Color costs it 1.6 nats, 3.0 lost at blue 96 to 119, where the picture has less" in says
    assert "of them" not in says
    assert ", and 1.4 won elsewhere." in says
    verified = replace(behind, verified=4.2, behind=5.8)
    shown = replace(truth, entry=verified), replace(winner, entry=best)
    says = " ".join(say_step(replace(step, shown=shown), scale))
    assert "Keypoints cost it 4.2 nats. Color costs it 1.6 nats" in says
    assert says.count("4.2") == 1
    favored = (channel("color", np.where(nats < 0, nats, 0).astype(np.float32), sample, reference),)
    shown = replace(truth, entry=replace(verified, channels=favored, behind=2.8)), replace(winner, entry=best)
    says = " ".join(say_step(replace(step, shown=shown), scale))
    assert "Keypoints cost it 4.2 nats; color favors it by 1.4." in says


@pytest.mark.parametrize("name", sorted(KNOWN))
def test_every_element_of_a_known_channel_has_a_name(name):
    size, planes = KNOWN[name]
    assert size == len(CHANNELS[name].describe(np.zeros((30, 40, 3), np.uint8)))
    length = size // planes.count
    assert length * planes.count == size
    names = {planes.name(k, 0, length - 1) for k in range(planes.count)}
    assert len(names) == planes.count


def test_a_channel_of_somebody_else_has_numbered_elements():
    assert planes_of("theirs", 17).name(0, 2, 4) == "elements 3 to 5"
    assert planes_of("color", 17).name(0, 2, 2) == "elements 3"


def test_the_sentences_name_winner_truth_and_estimate(library):
    step = explained(library)
    text = " ".join(say_step(step, scale_for("in", library.arena)))
    assert f"entry {step.winner.entry}" in text
    assert f"Of {library.size} references" in text
    for who, words in (("truth", "nearest to the truth"), ("estimate", "nearest to the estimate")):
        found = step.of(who)
        assert words in text
        assert found.entry is None or str(found.entry.rank) in text
    assert "Particles are weighted by the references around them" in text


def test_what_pose_sensors_give_is_told_beside_the_references(library):
    step = explained(library)
    shown = [replace(one, weighed=-3.0, sensed={"position": -1.25}) for one in step.shown]
    says = say_step(replace(step, shown=tuple(shown)), scale_for("in", library.arena))[-1]
    assert ", and at their own poses by position: one on the" in says
    assert "gets -3.0 nats (position -1.2, references -1.8)" in says
    assert "alone" not in says


def test_what_is_unknown_or_outside_is_not_told(library, tmp_path):
    step = explained(library, truth=False, weigh=False)
    scale = scale_for("in", library.arena)
    assert "truth" not in " ".join(say_step(step, scale)) + brief_table(step, scale)
    step = explained(library, asked=np.array([-9.0, -9.0, 0.0]))
    assert "The pose asked for lies outside free space" in " ".join(say_step(step, scale))
    assert "asked for: outside free space" in brief_table(step, scale)
    assert to_json("a", step)["runs"][0]["explained"][0]["reference"] is None
    library = fakes.make_library(columns=1, rows=1, headings=1)
    says = say_step(explained(library), scale_for("in", library.arena))
    assert says[0].startswith("The only reference at")


def test_table_and_json_have_every_reference(library):
    step = explained(library, asked=3)
    lines = brief_table(step, scale_for("in", library.arena)).splitlines()
    assert {line.count("|") for line in lines} == {6}
    assert "asked for: 3" in lines[0]
    assert f"| **color** · rank | {step.shown[0].entry.channels[0].loses:.2f} · " in lines[-2]  # type: ignore[union-attr]
    (found,) = json.loads(json.dumps(to_json("Lauf ä", step), allow_nan=False))["runs"]
    assert (found["label"], found["step"]) == ("Lauf ä", step.step)
    reference = found["explained"][0]["reference"]
    assert reference["entry"] == 3
    behind = [c["behind_winner"] for c in reference["channels"].values()]
    assert sum(behind) == pytest.approx(reference["behind_winner"], abs=1e-4)


@pytest.mark.parametrize(
    ("number", "word"), [(1, "1st"), (2, "2nd"), (3, "3rd"), (11, "11th"), (112, "112th"), (621, "621st")]
)
def test_ordinals(number, word):
    assert ordinal(number) == word


@pytest.mark.parametrize(
    ("nats", "words"),
    [
        (math.log(2), "2.0 times"),
        (math.log(123456), "120,000 times"),
        (20.0, "over a million"),
        (5e3, "million"),
    ],
)
def test_a_gap_in_nats_is_said_as_a_factor(nats, words):
    assert words in say_behind(nats)
