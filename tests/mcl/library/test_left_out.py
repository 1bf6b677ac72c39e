"""Places that cannot be told apart are found out, and the scales widened; a dense library is left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maurice_mcl.config.build import adapted, make_localizer
from maurice_mcl.config.parameters import Layer, configure
from maurice_mcl.filter.localizer import run
from maurice_mcl.library.left_out import LeftOutTable, clustered, score_places
from maurice_mcl.sensor.model import SensorModel, SensorParameters
from maurice_mcl.sensor.references import nearest_reference
from maurice_mcl.values.library import ChannelIndex, Library
from maurice_mcl.values.map import Arena
from maurice_mcl.values.session import Frame, Moment, SessionInfo

HEADINGS = 24
SPOTS = np.array([[1.0, 1.0], [3.0, 1.2], [2.0, 2.6]])
COLOR = SensorParameters({"color": 1.0})
STRANGE = 6.0  # how much a spot's own light and clutter change a bin, against what its heading does


def pictured(poses, rng, strange=STRANGE):
    """Return color descriptors (L, 84) that say the heading a little, and the spot in no order at all."""
    names = np.unique(poses[:, :2].round(3), axis=0, return_inverse=True)[1].ravel()
    own = rng.normal(0, strange, (names.max() + 1, 84))
    turned = 0.5 * np.cos(poses[:, 2:] - np.linspace(0, 2 * np.pi, 84))
    return np.abs(10 + own[names] + turned + rng.normal(0, 0.3, (len(poses), 84))).astype(np.float32)


def library_of(places, looks, headings=HEADINGS):
    turns = np.arange(headings) * 2 * np.pi / headings
    poses = np.column_stack([np.repeat(places, headings, axis=0), np.tile(turns, len(places))])
    rows = looks(poses)
    index = ChannelIndex(rows, np.zeros(84, np.float32), rows.max(axis=0))
    arena = Arena((0.0, 0.0, 4.0, 4.0), np.zeros((0, 4)))
    return Library("made", poses, (None,) * len(poses), {"color": index}, arena)


def sparse(seed=0):
    return library_of(SPOTS, lambda poses: pictured(poses, np.random.default_rng(seed)))


def dense(across=8, spacing_m=0.4572):
    steps = (np.arange(across) + 0.5) * spacing_m
    places = np.column_stack([axis.ravel() for axis in np.meshgrid(steps, steps)])
    turns = np.linspace(0, 2 * np.pi, 84)

    def looks(poses):
        x, y, heading = (poses[:, k : k + 1] for k in range(3))
        return np.asarray(10 + 3 * np.cos(x + turns) + 3 * np.cos(y - turns) + 2 * np.cos(heading - turns))

    return library_of(places, lambda poses: looks(poses).astype(np.float32), 8)


def scored(library, parameters=COLOR):
    nearest = nearest_reference(library.poses, library.arena)
    return score_places(LeftOutTable.of(SensorModel(library, nearest, parameters)))


def test_few_places_that_differ_at_random_are_worse_than_nothing():
    found = scored(sparse())
    assert (found.places, found.worse_than_nothing) == (3, True)
    assert found.blind == pytest.approx(-np.log(2 * HEADINGS))
    assert found.widening > 3
    wider = scored(sparse(), replace(COLOR, widening=found.widening))
    assert wider.score > found.score


def test_a_dense_library_is_left_alone_to_the_bit():
    library = dense()
    found = scored(library)
    assert (found.places, found.worse_than_nothing, found.widening) == (64, False, 1)
    configuration = configure([Layer("settings", {"sensor.weights": {"color": 1.0}})])
    nearest = nearest_reference(library.poses, library.arena)
    assert adapted(configuration, library, nearest)[0] is configuration


def test_positions_that_nearly_agree_are_one_place_and_one_place_says_nothing():
    library = sparse()
    jittered = library.poses + np.random.default_rng(1).normal(0, 0.01, library.poses.shape) * [1, 1, 0]
    assert len(clustered(replace(library, poses=jittered))[0]) == 3
    here = np.flatnonzero(clustered(library)[1] == 0)
    rows = library.index["color"].references[here]
    index = {"color": replace(library.index["color"], references=rows)}
    alone = replace(library, poses=library.poses[here], pictures=(None,) * len(here), index=index)
    found = scored(alone)
    assert (found.places, found.pictures, found.worse_than_nothing, found.widening) == (1, 0, False, 1)


@pytest.mark.parametrize(
    "settings",
    [
        {"sensor.widening": 1},
        {"sensor.scales": {"color": 0.5}},
        {"sensor.sharpness": 0},
        {"sensor.blend": "sum", "sensor.likelihood": "power"},
    ],
)
def test_what_somebody_chose_is_left_alone(settings):
    made = make_localizer(sparse(), feature="color", settings=settings)
    assert made.sensor.parameters.widening == 1


class Drive:
    """A drive near the first spot, in a light in which everything looks a little more like the third one."""

    info = SessionInfo("between")

    def __init__(self, library, monkeypatch):
        shift = np.linspace(0, 0.8, 30)
        self.truth = np.column_stack([1 + shift, 1 + shift / 5, 0 * shift])
        rows = library.index["color"].references
        here, there = rows[0], rows[2 * HEADINGS]
        noise = np.random.default_rng(5).normal(0, 1, (30, 84))
        looks = np.abs(0.4 * here + 0.6 * there + noise).astype(np.float32)
        monkeypatch.setattr(SensorModel, "measure", lambda model, image: {"color": looks[image[0, 0, 0]]})

    def moments(self):
        for step, pose in enumerate(self.truth):
            went = (pose - self.truth[max(step - 1, 0)])[None]
            yield Moment(Frame(step + 1, float(step), went, np.full((1, 1, 3), step, np.uint8), ""), pose)


def wrong_and_confident(library, drive, **settings):
    """Return the share of updates that are over 0.5 m off, and surer than that; started anywhere."""
    made = make_localizer(library, feature="color", particles=1000, settings=settings)
    found = []
    for moment, record in run(made, drive):
        off = np.hypot(*(record.estimate.pose - moment.truth)[:2])
        apart = np.hypot(*(record.weighted.world_poses - record.estimate.pose)[:, :2].T)
        found.append(off > max(0.5, 2 * np.sqrt(record.weighted.weights @ apart**2)))
    return np.mean(found)


def test_the_default_is_not_overconfident_there(monkeypatch):
    library = sparse()
    drive = Drive(library, monkeypatch)
    assert wrong_and_confident(library, drive, **{"sensor.widening": 1}) > 0.5
    assert wrong_and_confident(library, drive) == 0


def coarse(stretch, library=None):
    """A library whose color distances are all longer than in those that the scales were fitted on."""
    library = library or dense(5, 0.8)
    index = library.index["color"]
    return replace(library, index={"color": replace(index, references=index.references * stretch)})


def test_a_library_of_many_places_far_apart_gets_a_scale_of_its_own_where_it_asks_for_one():
    library = coarse(100)
    nearest = nearest_reference(library.poses, library.arena)
    configuration = configure([Layer("settings", {"sensor.weights": {"color": 1.0}})])
    fitted, found = adapted(configuration, library, nearest)
    factor = found.stretched["color"] * found.widening
    assert found.stretched["color"] > 1.5
    sensor = fitted.parameters.sensor
    assert sensor.scale_of("color") == pytest.approx(COLOR.scale_of("color") * factor)
    assert found.score >= scored(library).score
    for other in (coarse(100, dense()), coarse(100, dense(4, 0.9))):  # places are near, and few
        nearest = nearest_reference(other.poses, other.arena)
        assert adapted(configuration, other, nearest)[1].stretched == {}
    origins = {one.key: one.origin for one in fitted.settings}
    assert origins["sensor.scales"] == "library made"
    own = configure([Layer("settings", {"sensor.weights": {"color": 1.0}, "sensor.widening": 1})])
    assert adapted(own, library, nearest)[0] is own
