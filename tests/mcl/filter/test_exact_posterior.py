"""The whole filter against an exact answer: 8 x 6 places, 8 headings, a wall, 12 updates.

Particles live on the states of a lattice, where the forward algorithm gives the posterior and the evidence
exactly. Everything but the lattice's motion is the real code: `Localizer.step` with the real grid and wall,
color channel, sensor model, weighing, resamplers and policies.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.special import ndtr

import maurice_mcl.filter.weighting as weighting
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.filter.proposal import MixtureParameters, MixtureProposal, ProposedParticles, regions
from maurice_mcl.filter.recovery import RecoveryStep, none
from maurice_mcl.filter.resampling import RESAMPLERS, Resampling, always, below_effective
from maurice_mcl.filter.weighting import weigh
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.sensor.model import SensorModel, SensorParameters
from maurice_mcl.sensor.references import nearest_reference
from maurice_mcl.values.library import ChannelIndex, Library
from maurice_mcl.values.map import Arena
from maurice_mcl.values.randomness import stream
from maurice_mcl.values.records import Belief, FilterState, uniform_log_weights
from maurice_mcl.values.session import Frame

COLUMNS, ROWS, HEADINGS, UPDATES = 8, 6, 8, 12
STATES = COLUMNS * ROWS * HEADINGS
PITCH_M, WALL_X, WALL_ROWS = 0.5, 4, 4  # the wall stands before column 4, beside rows 0 to 3
RUNS, SIZES = 200, (500, 2000, 8000)
RATIO = 9.0
AHEAD, TURN = (1.0, 0.0, 0.0), (0.0, 0.0, np.pi / 4)
DRIVE = [AHEAD, TURN, AHEAD, AHEAD, TURN, TURN, AHEAD, AHEAD, TURN, AHEAD, TURN, AHEAD]
STEPS = np.array([[-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0], [1, 1], [0, 1], [-1, 1]])  # heading -180 first


def _state(column, row, heading):
    return (row * COLUMNS + column) * HEADINGS + heading % HEADINGS


def _ahead(column, row, heading):
    """One place ahead, or where it stands if a wall or the border is in the way."""
    to_column, to_row = np.array([column, row]) + STEPS[heading % HEADINGS]
    outside = not (0 <= to_column < COLUMNS and 0 <= to_row < ROWS)
    through = (column < WALL_X) != (to_column < WALL_X) and min(row, to_row) < WALL_ROWS
    return _state(column, row, heading) if outside or through else _state(to_column, to_row, heading)


def _transitions():
    """Give, for each action, next states (STATES, 4) and the probabilities (4,) of these."""
    cells = [(c, r, h) for r in range(ROWS) for c in range(COLUMNS) for h in range(HEADINGS)]
    ahead = [
        [_ahead(c, r, h), _state(c, r, h), _ahead(c, r, h + 1), _ahead(c, r, h - 1)] for c, r, h in cells
    ]
    turned = [[_state(c, r, h + k) for k in (1, 0, 2, -1)] for c, r, h in cells]
    return {AHEAD: (np.array(ahead), [0.5, 0.2, 0.15, 0.15]), TURN: (np.array(turned), [0.6, 0.2, 0.1, 0.1])}


TRANSITIONS = _transitions()


def _poses():
    x, y = np.meshgrid(np.arange(COLUMNS) + 0.5, np.arange(ROWS) + 0.5)
    headings = np.arange(HEADINGS) * np.pi / 4 - np.pi
    xy = np.column_stack([x.ravel(), y.ravel()]) * PITCH_M
    return np.column_stack([np.repeat(xy, HEADINGS, axis=0), np.tile(headings, len(xy))])


@dataclass(frozen=True)
class LatticeMotion:
    """Moves particles from state to state; `injected` of them to a state drawn evenly (a planted fault)."""

    poses: np.ndarray
    injected: float = 0.0

    def move(self, poses, origin, motion, noise):
        xy = np.round((poses[:, :2] + origin) / PITCH_M - 0.5).astype(int)
        heading = np.round((poses[:, 2] + np.pi) / (np.pi / 4)).astype(int)
        to, probabilities = TRANSITIONS[tuple(motion)]
        drawn = ndtr(noise.astype(np.float64))
        choice = np.minimum(np.searchsorted(np.cumsum(probabilities), drawn[:, 0]), 3)
        moved = to[_state(xy[:, 0], xy[:, 1], heading), choice]
        anywhere = np.minimum((drawn[:, 2] * STATES).astype(int), STATES - 1)
        return _relative(self.poses[np.where(drawn[:, 1] < self.injected, anywhere, moved)], origin)


def _relative(poses, origin):
    return (poses - np.append(origin, 0)).astype(np.float32)


def _shares(poses):
    """How bright the picture is that one sees from each pose (N, 3): smooth, and never unique."""
    x, y, heading = np.asarray(poses).T
    return 0.5 + 0.25 * np.cos(1.6 * x + heading) + 0.22 * np.sin(2.1 * y - 2 * heading)


def _drive_pictures(rng, poses):
    """Draw what is seen on one true drive through the lattice, with noise."""
    state, seen = int(rng.integers(STATES)), []
    for motion in DRIVE:
        to, probabilities = TRANSITIONS[motion]
        state = int(to[state, rng.choice(4, p=probabilities)])
        seen.append(np.clip(_shares(poses[state : state + 1])[0] + rng.normal(0, 0.05), 0.0, 1.0))
    return [_picture(share) for share in seen]


def _picture(share, dark=100, bright=200):
    """A picture of two grays, one over a share of its pixels."""
    pixels = np.where(np.arange(48 * 40) < share * 48 * 40, dark, bright).astype(np.uint8)
    return np.repeat(pixels.reshape(48, 40, 1), 3, axis=2)


def _likelihoods(library, images, sharpness):
    """Give quality ** sharpness (UPDATES, STATES) by the thesis's formula, independently of the sensor."""
    index, rows = library.index["color"], []
    m = index.relevance.astype(float)
    for image in images:
        apart = np.abs(index.references.astype(float) - CHANNELS["color"].describe(image))
        over = np.maximum(apart - index.noise_floor, 0)
        distances = np.divide(over, m, out=np.zeros_like(over), where=m > 0).sum(axis=1)
        rows.append((1 - distances / distances.max())[:STATES] ** sharpness)
    return np.array(rows)


@dataclass(frozen=True)
class Lattice:
    localizer: Localizer
    frames: list
    poses: np.ndarray
    posterior: np.ndarray  # (STATES,) after the last update
    log_evidence: float

    def functions(self, poses):
        """Give eight functions (8, N) of poses."""
        x, y, heading = np.asarray(poses, np.float64).T
        east = x > WALL_X * PITCH_M
        facing = np.cos(heading) > 0.9
        return np.stack([x, y, np.cos(heading), np.sin(heading), x * y, x**2, east * 1.0, east & facing])


def _forward(likelihoods):
    belief, log_evidence = np.full(STATES, 1 / STATES), 0.0
    for motion, likelihood in zip(DRIVE, likelihoods, strict=True):
        to, probabilities = TRANSITIONS[motion]
        moved = np.zeros(STATES)
        for k, probability in enumerate(probabilities):
            np.add.at(moved, to[:, k], belief * probability)
        weighted = moved * likelihood
        log_evidence += np.log(weighted.sum())
        belief = weighted / weighted.sum()
    return belief, log_evidence


@pytest.fixture(scope="module")
def lattice():
    rng = np.random.default_rng(2007)
    poses = _poses()
    pictures = [_picture(share) for share in _shares(poses)]
    pictures.append(_picture(1.0, dark=20))  # far from all others, so that no state is ever the worst
    images = _drive_pictures(rng, poses)
    references = np.stack([CHANNELS["color"].describe(picture) for picture in pictures])
    index = ChannelIndex(references, np.full(84, 1.0, np.float32), references.max(axis=0))
    size = (COLUMNS * PITCH_M, ROWS * PITCH_M)
    wall = np.array([[WALL_X * PITCH_M, 0.0, WALL_X * PITCH_M, WALL_ROWS * PITCH_M]])
    arena = Arena((0.0, 0.0, *size), wall)
    every = np.vstack([poses, [-50.0, -50.0, 0.0]])
    library = Library("lattice", every, (None,) * len(every), {"color": index}, arena)
    linear = _likelihoods(library, images, 1.0)
    sharpness = float(np.log(RATIO) / np.log(linear.max(axis=1) / linear.min(axis=1)).max())
    posterior, log_evidence = _forward(_likelihoods(library, images, sharpness))
    reference = nearest_reference(every, arena)
    by = {"color": "thesis"}
    parameters = SensorParameters({"color": 1.0}, sharpness, likelihood="power", blend="sum", distances=by)
    sensor = SensorModel(library, reference, parameters)
    where = regions(reference, library.size)
    # weights are carried over in some steps and not in others
    resampling = Resampling(RESAMPLERS["systematic"], below_effective(0.75))
    recovery = RecoveryStep(none, reference, where)
    localizer = Localizer(library, reference, where, LatticeMotion(poses), sensor, resampling, recovery)
    seen = enumerate(zip(DRIVE, images, strict=True), start=1)
    frames = [Frame(k, float(k), np.array([motion]), image, "") for k, (motion, image) in seen]
    return Lattice(localizer, frames, poses, posterior, log_evidence)


def _resampling(localizer, **changes):
    """The same localizer, resampling otherwise."""
    return replace(localizer, resampling=replace(localizer.resampling, **changes))


def _run(lattice, localizer, n, seed):
    """Run once; give the evidence over the true one, the eight means, and how often it resampled."""
    origin = localizer.library.origin
    states = stream(9, seed).integers(0, STATES, n)
    state = FilterState(0, Belief(_relative(lattice.poses[states], origin), uniform_log_weights(n), origin))
    choices, log_evidence, resampled = replace(localizer, particles=n, seed=seed), 0.0, 0
    for frame in lattice.frames:
        state, record = choices.step(state, frame)
        log_evidence += record.log_evidence
        resampled += record.parents is not None
    # the state that each stands for: dual draws lie anywhere in its cell
    means = lattice.functions(lattice.poses[record.sighting.entries]) @ record.weighted.weights
    return np.exp(log_evidence - lattice.log_evidence), means, resampled


@dataclass(frozen=True)
class Outcome:
    ratio: np.ndarray  # (RUNS,) evidence over the true one
    off: np.ndarray  # (RUNS, 8) errors of the eight means, in posterior standard deviations
    resampled: float

    def evidence_off(self):
        """How many standard errors the mean ratio is from 1."""
        return abs(self.ratio.mean() - 1) / (self.ratio.std(ddof=1) / np.sqrt(len(self.ratio)))

    def bias_off(self):
        """How many standard errors the worst of the eight means is off."""
        error = self.off.std(axis=0, ddof=1) / np.sqrt(len(self.off))
        return (np.abs(self.off.mean(axis=0)) / error).max()

    def rmse(self):
        return np.sqrt((self.off**2).mean())


def _many(lattice, localizer, n, runs=RUNS):
    values = lattice.functions(lattice.poses)
    truth = values @ lattice.posterior
    sd = np.sqrt((values - truth[:, None]) ** 2 @ lattice.posterior)
    results = [_run(lattice, localizer, n, seed) for seed in range(runs)]
    ratio, means, resampled = zip(*results, strict=True)
    return Outcome(np.array(ratio), (np.array(means) - truth) / sd, float(np.mean(resampled)))


def test_the_lattice_is_a_fair_problem(lattice):
    posterior = lattice.posterior
    perplexity = np.exp(-(posterior * np.log(posterior)).sum())
    assert 30 < perplexity < STATES / 2
    assert posterior.min() > 0
    entries = lattice.localizer.reference.entries(_relative(lattice.poses, np.zeros(2)), np.zeros(2))
    assert entries.tolist() == list(range(STATES))
    free = [(to != np.arange(STATES)[:, None]).any(axis=1) for to, _ in TRANSITIONS.values()]
    assert free[1].all()


@pytest.fixture(scope="module")
def outcomes(lattice):
    return {n: _many(lattice, lattice.localizer, n) for n in SIZES}


@pytest.mark.slow
def test_the_filter_is_unbiased_and_its_errors_fall_with_the_root_of_particles(outcomes):
    for outcome in outcomes.values():
        assert 1 <= outcome.resampled <= UPDATES / 2
    assert outcomes[8000].bias_off() < 4
    errors = [outcomes[n].rmse() for n in SIZES]
    slope = np.polyfit(np.log(SIZES), np.log(errors), 1)[0]
    assert slope == pytest.approx(-0.5, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("n", SIZES)
def test_the_evidence_is_unbiased(outcomes, n):
    assert outcomes[n].evidence_off() < 4


# the default is tested at every run, the others with the slow tests: ten seconds each
EACH = [pytest.param(k, marks=() if k == "systematic" else pytest.mark.slow) for k in sorted(RESAMPLERS)]


@pytest.mark.parametrize("resampler", EACH)
def test_resampling_at_every_step_is_right_too(lattice, resampler):
    localizer = _resampling(lattice.localizer, scheme=RESAMPLERS[resampler], when=always)
    outcome = _many(lattice, localizer, 500)
    assert outcome.resampled == UPDATES
    assert outcome.evidence_off() < 4
    assert outcome.bias_off() < 4


@pytest.mark.slow
@pytest.mark.parametrize("resampler", sorted(set(RESAMPLERS) - {"systematic"}))
def test_skipping_by_effective_sample_size_is_right_with_every_resampler(lattice, resampler):
    outcome = _many(lattice, _resampling(lattice.localizer, scheme=RESAMPLERS[resampler]), 500)
    assert 1 <= outcome.resampled <= UPDATES / 2
    assert outcome.evidence_off() < 4
    assert outcome.bias_off() < 4


def _mixture(localizer):
    return MixtureProposal(MixtureParameters(share=0.2, teleport=0.0), localizer.reference, localizer.regions)


@pytest.mark.slow
@pytest.mark.parametrize("when", [always, below_effective(0.75)], ids=["always", "effective"])
def test_dual_draws_weighed_by_their_densities_are_exact(lattice, when):
    """Each state is one entry, so densities by entry are exact; where in its cell a draw lies is no matter.

    (The lattice's motion rounds to the state, and every cell of the raster that has an entry nearest lies
    within half a step of its state.)
    """
    mixed = replace(_resampling(lattice.localizer, when=when), proposal=_mixture(lattice.localizer))
    outcome = _many(lattice, mixed, 500)
    assert outcome.evidence_off() < 4
    assert _many(lattice, mixed, 4000, RUNS // 2).bias_off() < 4


def _is_caught(lattice, faulty):
    outcome = _many(lattice, faulty, 2000, runs=RUNS // 2)
    return outcome.evidence_off() > 4 and outcome.bias_off() > 4


@pytest.mark.slow
def test_faults_of_the_filter_are_caught(lattice):
    sensor = lattice.localizer.sensor
    sharper = replace(sensor.parameters, sharpness=1.1 * sensor.parameters.sharpness)
    faulty = replace(lattice.localizer, sensor=replace(sensor, parameters=sharper))
    assert _is_caught(lattice, faulty)
    faulty = replace(lattice.localizer, motion=LatticeMotion(lattice.poses, injected=0.05))
    assert _is_caught(lattice, faulty)


@pytest.mark.slow
def test_forgotten_carried_weights_are_caught(lattice, monkeypatch):
    def forgetful(proposal, log_likelihood):
        belief = proposal.belief
        even = replace(belief, log_weights=uniform_log_weights(belief.size))
        return weigh(replace(proposal, belief=even), log_likelihood)

    monkeypatch.setattr(weighting, "weigh", forgetful)
    assert _is_caught(lattice, lattice.localizer)


@pytest.mark.slow
def test_dual_draws_without_their_densities_are_caught(lattice, monkeypatch):
    def naive(proposal, log_likelihood):
        return weigh(ProposedParticles(proposal.belief), log_likelihood)

    monkeypatch.setattr(weighting, "weigh", naive)
    assert _is_caught(lattice, replace(lattice.localizer, proposal=_mixture(lattice.localizer)))
