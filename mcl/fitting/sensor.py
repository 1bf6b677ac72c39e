"""Constants of the sensor: the camera's noise floor, and scales and weights of channels, fitted by log score.

The noise floor is that of pictures taken with the lens covered (thesis 3.3, figures 13 and 14). The log score
of a picture is the log of the probability that it alone gives the reference nearest to the truth, under a
uniform prior. Pictures come from drives, or from the library's leave-one-out table.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..library.left_out import LeftOutTable, log_scores
from ..sensor.ahead import KnownDescriptors, measured
from ..sensor.descriptors.histograms import BINS, LOW, WIDTH, camera_histogram
from ..sensor.model import SensorModel
from ..sensor.references import ReferenceLookup
from ..values import F32, F64, I32, U8, Library, Moment, Progress, wrap

COLORS = ("red", "green", "blue")
LIT_LEVEL = 64.0  # a mean above this is no covered lens


@dataclass(frozen=True, slots=True)
class Peak:
    """The highest bin of one color; counts are 256 times the share of pixels."""

    color: str
    count: float  # mean over the frames
    sd: float  # between frames, of that bin's count
    first_value: int  # the pixel values that the bin holds, from this ...
    last_value: int  # ... to this
    largest_bin_sd: float  # between frames, of the bin that varies most


@dataclass(frozen=True, slots=True, eq=False)
class NoiseFloor:
    """What a camera measures in the dark."""

    frames: int
    mean: F64  # (84,) camera histogram, mean over the frames
    sd: F64  # (84,) its standard deviation between frames; nan for one frame
    level: F64  # (3,) mean pixel value of red, green and blue
    example: U8  # (H, W, 3) the first frame

    def peaks(self) -> tuple[Peak, ...]:
        """Return the highest bin of each color; of equal ones the darkest."""
        rows = zip(COLORS, self.mean.reshape(3, BINS), self.sd.reshape(3, BINS), strict=True)
        return tuple(_peak(*row) for row in rows)

    @property
    def lit(self) -> bool:
        """Return whether it is too bright for a covered lens."""
        return bool(self.level.mean() > LIT_LEVEL)


def noise_floor(pictures: Iterable[U8]) -> NoiseFloor:
    """Average the histograms of pictures (H, W, 3), one by one (Welford 1962). ValueError for none."""
    count, example = 0, None
    mean, squares, level = np.zeros(3 * BINS), np.zeros(3 * BINS), np.zeros(3)
    for picture in pictures:
        example = picture if example is None else example
        count += 1
        histogram = camera_histogram(picture).astype(np.float64)
        before = histogram - mean
        mean = mean + before / count
        squares = squares + before * (histogram - mean)
        level = level + (picture.reshape(-1, 3).mean(axis=0) - level) / count
    if example is None:
        raise ValueError("found no picture, expected some taken with the lens covered")
    sd = np.sqrt(squares / (count - 1)) if count > 1 else np.full(3 * BINS, np.nan)
    return NoiseFloor(count, mean, sd, level, example)


def stretched(picture: U8) -> U8:
    """Stretch a picture's contrast (H, W, 3) so that its darkest value is 0 and its brightest 255."""
    low, high = int(picture.min()), int(picture.max())
    scaled = (picture.astype(np.float64) - low) * (255 / max(high - low, 1))
    return np.round(scaled).astype(np.uint8)


def _peak(color: str, mean: F64, sd: F64) -> Peak:
    best = int(mean.argmax())
    first = LOW + WIDTH * best
    last = first + WIDTH - (0 if best == BINS - 1 else 1)
    return Peak(color, float(mean[best]), float(sd[best]), first, last, float(sd.max()))


# Tuning: scales and weights of channels, fitted on drives with known truth.

LEAST_WEIGHT = 0.02  # a channel with less of the sum is dropped
SEARCH_LOG_RATIO = 5.0  # natural log of how far scales and weights may move from where the search starts


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """A block of pictures, small enough for the memory of what is computed from it."""

    distances: F32  # (C, T, L) of T pictures from L references, in C channels
    truth: I32  # (T,) entry nearest to the truth


@dataclass(frozen=True, slots=True)
class Tuned:
    """The result of tuning."""

    channels: tuple[str, ...]
    scales: tuple[float, ...]  # distance of one nat, each channel alone
    weights: tuple[float, ...]  # of the calibrated distances, together; 0: the channel adds nothing
    alone: tuple[float, ...]  # log score of each channel on its own
    together: float  # log score of the blend
    blind: float  # log score of knowing nothing: -log(L)


@dataclass(frozen=True, slots=True)
class Scores:
    """Mean log scores per picture, in nats; higher is better."""

    pictures: int
    alone: tuple[float, ...]  # each tuned channel on its own, at its tuned scale
    together: float  # the tuned blend
    before: float  # the blend before tuning
    blind: float  # knowing nothing

    @property
    def gained(self) -> float:
        """The gain by tuning."""
        return self.together - self.before


def judge(tuned: Tuned, samples: Sequence[Sample], before: F64) -> Scores:
    """Score a result on samples; `before` (C,) is the cost per distance of each row in the blend to beat."""
    count = len(tuned.channels)
    alone = [score(rows_of(samples, [k]), np.array([1 / scale])) for k, scale in enumerate(tuned.scales)]
    per_distance = np.zeros(len(before))
    per_distance[:count] = np.array(tuned.weights) / np.array(tuned.scales)
    return Scores(
        pictures=sum(len(s.truth) for s in samples),
        alone=tuple(alone),
        together=score(samples, per_distance),
        before=score(samples, before),
        blind=blind_score(samples),
    )


def blind_score(samples: Sequence[Sample]) -> float:
    """Return the mean log score of knowing nothing: -log(L)."""
    logs = [np.log(s.distances.shape[2]) for s in samples]
    return -float(np.average(logs, weights=[len(s.truth) for s in samples]))


def pooled(several: Sequence[Scores]) -> Scores:
    """Return the mean over all pictures of several scores."""
    share = np.array([s.pictures for s in several], np.float64)
    share /= share.sum()
    alone = share @ np.array([s.alone for s in several])
    return Scores(
        pictures=sum(s.pictures for s in several),
        alone=tuple(alone.tolist()),
        together=float(share @ [s.together for s in several]),
        before=float(share @ [s.before for s in several]),
        blind=float(share @ [s.blind for s in several]),
    )


def true_entry(references: ReferenceLookup, library: Library, pose: F64) -> int:
    """Return the entry that is nearest to a true pose (3,); -1 outside free space."""
    local = (pose - np.append(library.origin, 0))[None]
    local[:, 2] = wrap(local[:, 2])
    return int(references.entries(np.asarray(local, np.float32), library.origin)[0])


def score(samples: Sequence[Sample], per_distance: F64) -> float:
    """Return the mean log score of the cost per_distance (C,) @ distances."""
    costs = (np.tensordot(per_distance, s.distances, 1) for s in samples)
    return float(np.concatenate([log_scores(c, s.truth) for c, s in zip(costs, samples, strict=True)]).mean())


def fit_scale(samples: Sequence[Sample]) -> tuple[float, float]:
    """Return the best scale of the one channel of these samples, and its log score."""
    from scipy.optimize import minimize_scalar

    typical = float(np.median([np.median(s.distances) for s in samples])) or 1.0

    def loss(log_scale: float) -> float:
        return -score(samples, np.array([1 / np.exp(log_scale)]))

    middle = np.log(typical / 10)
    bounds = middle - SEARCH_LOG_RATIO, middle + SEARCH_LOG_RATIO
    best = minimize_scalar(loss, bounds=bounds, method="bounded")
    return float(np.exp(best.x)), -float(best.fun)


def fit_weights(samples: Sequence[Sample], scales: F64) -> F64:
    """Return the weights (C,) >= 0 of calibrated distances that have the best log score together."""

    from scipy.optimize import minimize

    def loss(log_weights: F64) -> tuple[float, F64]:
        weights = np.exp(log_weights)
        total, slope, count = 0.0, np.zeros(len(weights)), 0
        for sample in samples:
            value, gradient = _log_score(weights / scales, sample)
            total, slope, count = total + value, slope + gradient / scales, count + len(sample.truth)
        return -total / count, -slope * weights / count

    start = np.full(len(scales), -np.log(len(scales)))
    best = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=[(-SEARCH_LOG_RATIO, 1.5)] * len(scales))
    weights = np.exp(best.x)
    return np.asarray(np.where(weights < LEAST_WEIGHT * weights.sum(), 0.0, weights))


def _log_score(per_distance: F64, sample: Sample) -> tuple[float, F64]:
    """Return the sum of the log scores of one sample and its gradient (C,)."""
    cost = np.tensordot(per_distance, sample.distances, 1)
    logits = -cost + cost.min(axis=1, keepdims=True)
    probability = np.exp(logits)
    probability /= probability.sum(axis=1, keepdims=True)
    at = np.arange(len(sample.truth))
    total = float(np.log(np.maximum(probability[at, sample.truth], 1e-300)).sum())
    expected = np.einsum("ctl,tl->ct", sample.distances, probability)
    return total, np.asarray((expected - sample.distances[:, at, sample.truth]).sum(axis=1), np.float64)


def rows_of(samples: Sequence[Sample], rows: Sequence[int]) -> list[Sample]:
    """Return the same pictures in some of the channels only, in that order."""
    # a slice shares memory, a list of rows copies it
    chosen = slice(rows[0], rows[0] + 1) if len(rows) == 1 else list(rows)
    return [Sample(s.distances[chosen], s.truth) for s in samples]


def tune(channels: Sequence[str], samples: Sequence[Sample], progress: Progress | None = None) -> Tuned:
    """Fit a scale for each channel alone, then weights for all together. ValueError without pictures."""
    advance = progress or (lambda done, total: None)
    if not sum(len(s.truth) for s in samples):
        raise ValueError("found no picture with a known pose in free space to tune on")
    each = []
    for k in range(len(channels)):
        advance(k, len(channels) + 1)
        each.append(fit_scale(rows_of(samples, [k])))
    scales = np.array([scale for scale, _ in each])
    advance(len(channels), len(channels) + 1)
    weights = fit_weights(samples, scales)
    return Tuned(
        channels=tuple(channels),
        scales=tuple(scales.tolist()),
        weights=tuple(weights.tolist()),
        alone=tuple(alone for _, alone in each),
        together=score(samples, weights / scales),
        blind=blind_score(samples),
    )


# Samples: distances of pictures of known place from all references, in blocks.

MOST_DISTANCES = 2**25  # numbers in total: 128 MiB
MOST_IN_BLOCK = 2**21  # numbers in one sample


def most_pictures(sensor: SensorModel) -> int:
    """Return the maximum number of pictures by a sensor's channels, which bounds memory."""
    return max(1, MOST_DISTANCES // (len(sensor.weights) * sensor.library.size))


def spread_out(count: int, most: int) -> frozenset[int]:
    """Return at most `most` of the numbers 0 to count - 1, evenly spaced."""
    return frozenset(np.linspace(0, count - 1, min(count, most)).round().astype(int).tolist())


def drive_samples(
    sensor: SensorModel,
    moments: Iterable[Moment],
    taken: frozenset[int],
    progress: Progress | None = None,
    known: KnownDescriptors | None = None,
) -> list[Sample]:
    """Measure the pictures of a drive with a number (from 0) in `taken` and a truth in free space."""

    def pictures() -> Iterator[tuple[F32, int]]:
        for number, moment in enumerate(moments):
            if number in taken:
                truth = moment.truth
                entry = -1 if truth is None else true_entry(sensor.references, sensor.library, truth)
                descriptors, _ = measured(moment.frame.image, sensor.weights, known)
                yield sensor.compare(descriptors).distances, entry
        if known is not None:
            known.flush()

    return _blocks(_counted(pictures(), len(taken), progress), sensor)


def library_samples(table: LeftOutTable, progress: Progress | None = None) -> list[Sample]:
    """Take references as pictures, each compared with the entries at all other places.

    The truth is then a reference's stand-in. As it is a full spacing off, and a drive's at most half a
    spacing, scales come out too wide.
    """
    tested = table.tested(most_pictures(table.sensor)).tolist()

    def pictures() -> Iterator[tuple[F32, int]]:
        for entry in tested:
            others = table.others(entry)
            truth = int(np.searchsorted(others, table.stand_ins[entry]))
            yield table.sensor.compare_reference(entry).distances[:, others], truth

    return _blocks(_counted(pictures(), len(tested), progress), table.sensor)


def _counted(
    pictures: Iterable[tuple[F32, int]], count: int, progress: Progress | None
) -> Iterator[tuple[F32, int]]:
    for number, (distances, truth) in enumerate(pictures, start=1):
        if progress:
            progress(number, count)
        if truth >= 0:
            yield distances, truth


def _blocks(pictures: Iterable[tuple[F32, int]], sensor: SensorModel) -> list[Sample]:
    """Join pictures that are compared with as many references, the same number of times in each block."""
    most = max(1, MOST_IN_BLOCK // (len(sensor.weights) * sensor.library.size))
    samples, open_blocks = list[Sample](), dict[int, list[tuple[F32, int]]]()
    for distances, truth in pictures:
        block = open_blocks.setdefault(distances.shape[1], [])
        block.append((distances, truth))
        if len(block) == most:
            samples.append(_sample(open_blocks.pop(distances.shape[1])))
    return samples + [_sample(block) for block in open_blocks.values()]


def _sample(block: Sequence[tuple[F32, int]]) -> Sample:
    rows, truth = zip(*block, strict=True)
    return Sample(np.stack(rows, axis=1), np.array(truth, np.int32))
