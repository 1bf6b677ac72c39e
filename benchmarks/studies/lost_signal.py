"""The lost signal against the truth, on unseen arenas and tiers: its misses and false alarms, and others'.

A real loss is one by the definition of docs/evaluation.md: at four pictures in a row farther off than the
radius *lost*, or than 45 degrees. It is noticed if there is an alarm at one of its first five pictures. An
alarm is false where no picture within five before or after it is lost. Every alarm's threshold is the one at
which 5 percent of the runs on the fitted arenas have a false alarm; the table is of arenas that nothing was
fitted on.

Run: make studies STUDIES=lost_signal (drives are made once and kept; it goes on where it stopped). With --fit
it prints the weights for mcl/scoring/lost_signal.py and second_opinion.py, fitted anew; with
--figure OUT.png it draws the curves.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from maurice_datasets.trials.statistics import Clusters, Interval, mean, share
from maurice_loaders.files.writing import cache_root
from maurice_mcl.reasons.second_opinion import OPINION, OpinionReader, Shares
from maurice_mcl.scoring.lost_signal import WEIGHTS, BeliefNumbers, LostSignal
from maurice_mcl.scoring.table import LOST_FOR
from maurice_mcl.values.arrays import F64, Bool

from .lost_drives import FILTERS, FITTED, SEEDS, UNSEEN, Course, Numbers, all_numbers

WITHIN = 5  # pictures in which a loss should be noticed, and by which an alarm may be early or late
FALSE_ALARMS = 0.05  # share of the runs that may have one
NAMES = ("evidence", "library_mean", "library_best", "mass", "spread", "survivors")
SHARES = ("near", "elsewhere")
CALIBRATED = ("best", "robust")  # filters whose likelihoods are alike, and need one threshold


@dataclass(frozen=True, slots=True, eq=False)
class JudgedRun:
    """One run of a filter on one drive."""

    course: Course
    filter: str
    numbers: Numbers  # (U,) each

    @property
    def onsets(self) -> list[int]:
        """The first update, from 0, of every real loss."""
        found, running = [], 0
        for update, lost in enumerate(self.numbers["lost"].tolist()):
            running = running + 1 if lost else 0
            found += [update - LOST_FOR + 1] if running == LOST_FOR else []
        return found

    @property
    def healthy(self) -> Bool:
        """Where (U,) an alarm is false."""
        reach = np.ones(2 * WITHIN + 1)
        return np.asarray(np.convolve(self.numbers["lost"].astype(float), reach, "same") == 0)


def judged(courses: Sequence[Course], folder: Path) -> list[JudgedRun]:
    return [
        JudgedRun(course, label, {name: values[seed] for name, values in numbers.items()})
        for course, found in all_numbers(courses, folder)
        for label, numbers in found.items()
        for seed in range(len(SEEDS))
    ]


# Alarms: each turns a run into a number (U,) per update, higher where it is more probably lost.

Alarm = Callable[[JudgedRun], F64]


def features_of(run: JudgedRun) -> F64:
    """Return what the lost signal is made of, (U, F), as it computes it update by update."""
    signal, columns = LostSignal(), np.column_stack([run.numbers[name] for name in NAMES])
    rows = [signal.features(BeliefNumbers(*row)) for row in columns.tolist()]
    return np.array([[row[name] for name in WEIGHTS] for row in rows])


def ours(run: JudgedRun) -> F64:
    """One less the probability that the estimate is right."""
    odds = features_of(run) @ np.array(list(WEIGHTS.values()))
    return np.asarray(1 / (1 + np.exp(odds)))


def opinion_features_of(run: JudgedRun) -> F64:
    """Return what the second opinion is made of, (U, F), as it computes it update by update."""
    reader, rows = (
        OpinionReader(),
        np.column_stack([run.numbers[name] for name in (*NAMES, *SHARES)]).tolist(),
    )
    found = [reader.features(BeliefNumbers(*row[: len(NAMES)]), Shares(*row[len(NAMES) :])) for row in rows]
    return np.array([[row[name] for name in OPINION] for row in found])


def second_opinion(run: JudgedRun) -> F64:
    """One less the probability that the estimate is not lost, with a second filter."""
    odds = opinion_features_of(run) @ np.array(list(OPINION.values()))
    return np.asarray(1 / (1 + np.exp(odds)))


def covariance(run: JudgedRun) -> F64:
    """The standard deviation of the whole cloud, in radii *right*."""
    return np.asarray(run.numbers["spread"])


def averages(slow: float, fast: float) -> Alarm:
    """AMCL's 1 - w_fast / w_slow, of the calibrated mean likelihood."""

    def alarm(run: JudgedRun) -> F64:
        likelihood, means = np.exp(run.numbers["evidence"]), [0.0]
        long = short = float(likelihood[0])
        for update, one in enumerate(likelihood[1:].tolist(), 1):
            long += max(slow, 1 / (update + 1)) * (one - long)
            short += fast * (one - short)
            means.append(1 - short / long if long > 0 else 1.0)
        return np.array(means)

    return alarm


ALARMS: dict[str, Alarm] = {
    "the second opinion": second_opinion,
    "the lost signal": ours,
    "covariance": covariance,
    "w_slow, w_fast (0.1, 0.5: ours)": averages(0.1, 0.5),
    "w_slow, w_fast (0.05, 0.3)": averages(0.05, 0.3),
    "w_slow, w_fast (0.001, 0.1: AMCL's)": averages(0.001, 0.1),
}


def threshold(runs: Sequence[JudgedRun], alarm: Alarm, allowed: float = FALSE_ALARMS) -> float:
    """Return the least threshold at which at most this share of the runs has a false alarm."""
    return at_share(highest_false(runs, alarm), allowed)


def highest_false(runs: Sequence[JudgedRun], alarm: Alarm) -> F64:
    """Return for every run the highest value (R,) where an alarm is false."""
    return np.array([float(alarm(run)[run.healthy].max(initial=-np.inf)) for run in runs])


def at_share(highest: F64, share: float) -> float:
    allowed = int(np.floor(share * len(highest)))
    return float(np.sort(highest)[::-1][allowed])


def noticed_at(runs: Sequence[JudgedRun], alarm: Alarm) -> tuple[F64, Clusters]:
    """Return the highest value (K,) in the first five pictures of every real loss, and which are alike."""
    losses = [(run, onset) for run in runs for onset in run.onsets]
    highest = [float(alarm(run)[onset : onset + WITHIN].max()) for run, onset in losses]
    return np.array(highest), alike([run for run, _ in losses])


def alike(runs: Sequence[JudgedRun]) -> Clusters:
    """Return which runs are of one drive, and which drives in one arena."""
    return Clusters.of([run.course.arena for run in runs], [run.course.name for run in runs])


# Fitting: logistic regression on all updates of the fitted arenas, every filter with the same total weight.

RIDGE = 1.0  # on standardized features: a few coefficients, and drives that are alike


def fitted(runs: Sequence[JudgedRun]) -> dict[str, float]:
    """Return the weights that describe best at which updates the estimate was right."""
    x = np.concatenate([features_of(run) for run in runs])
    return logistic(WEIGHTS, x, np.concatenate([run.numbers["correct"].astype(float) for run in runs]))


def fitted_opinion(runs: Sequence[JudgedRun]) -> dict[str, float]:
    """Return the weights that describe best at which updates the estimate was not lost."""
    x = np.concatenate([opinion_features_of(run) for run in runs])
    return logistic(OPINION, x, 1 - np.concatenate([run.numbers["lost"].astype(float) for run in runs]))


def logistic(names: Iterable[str], x: F64, y: F64) -> dict[str, float]:
    """Return the weights by name of features (K, F) that describe best which of K are true."""
    scale = np.where(x.std(axis=0) > 0, x.std(axis=0), 1.0)
    shift = np.where(x.std(axis=0) > 0, x.mean(axis=0), 0.0)
    found, z = np.zeros(x.shape[1]), (x - shift) / scale
    penalty = RIDGE * (x.std(axis=0) > 0)
    for _ in range(50):
        p = 1 / (1 + np.exp(-z @ found))
        square = (z * (p * (1 - p))[:, None]).T @ z + np.diag(penalty) + 1e-9 * np.eye(len(found))
        found = found + np.linalg.solve(square, z.T @ (y - p) - penalty * found)
    weights = found / scale
    weights[0] -= float((found * shift / scale)[1:].sum())
    return dict(zip(names, weights.round(3).tolist(), strict=True))


# The table.


def said(found: Interval) -> str:
    return f"{100 * found.value:.1f} [{100 * found.low:.1f}, {100 * found.high:.1f}]"


def row(name: str, alarm: Alarm, fits: Sequence[JudgedRun], tests: Sequence[JudgedRun]) -> str:
    """Return one line: false alarms, noticed losses, and both at 5 percent false alarms on these runs."""
    limit, highest = threshold(fits, alarm), highest_false(tests, alarm)
    at_losses, losses = noticed_at(tests, alarm)
    false, noticed = share(highest > limit, alike(tests)), share(at_losses > limit, losses)
    own = share(at_losses > at_share(highest, FALSE_ALARMS), losses)
    return f"| {name} | {said(false)} | {said(noticed)} | {said(own)} |"


def table(fits: Sequence[JudgedRun], tests: Sequence[JudgedRun]) -> str:
    """Return the tables as Markdown."""
    titles = "alarm", "false alarms, % of runs", "noticed, % of losses", "noticed at 5 % false alarms there"
    lines = [f"| {' | '.join(titles)} |", f"|{'---|' * len(titles)}"]
    lines += [row(name, alarm, fits, tests) for name, alarm in ALARMS.items()]
    for name in ("the second opinion", "the lost signal"):
        lines += ["", *parts(name, fits, tests)]
    lines += ["", "With a threshold of the filters with a calibrated likelihood alone:", *lines[:2]]
    some = [[run for run in runs if run.filter in CALIBRATED] for runs in (fits, tests)]
    lines += [row(name, ALARMS[name], *some) for name in ("the second opinion", "the lost signal")]
    lines += [f"alarm above {threshold(some[0], second_opinion):.3g}"]
    lines += ["", f"probably lost below {1 - threshold(fits, ours):.3g}", "", *reliability(tests)]
    lines += ["", *reliability(tests, second_opinion, "not lost")]
    return "\n".join(lines)


def parts(name: str, fits: Sequence[JudgedRun], tests: Sequence[JudgedRun]) -> list[str]:
    """Return a table of one alarm on some of the runs at a time."""
    alarm, titles = ALARMS[name], ("runs", "losses", "false alarms, % of runs", "noticed, % of losses")
    lines = [f"| {name} on | {' | '.join(titles)} |", f"|{'---|' * (len(titles) + 1)}"]
    limit = threshold(fits, alarm)
    found: dict[str, list[JudgedRun]] = {}
    for run in tests:
        for part in (run.filter, run.course.tier, run.course.task):
            found.setdefault(part, []).append(run)
    for part, some in found.items():
        at_losses, losses = noticed_at(some, alarm)
        false = share(highest_false(some, alarm) > limit, alike(some))
        noticed = share(at_losses > limit, losses)
        lines.append(f"| {part} | {len(some)} | {len(at_losses)} | {said(false)} | {said(noticed)} |")
    return [*lines, "", f"{name}: alarm above {limit:.3g}"]


def reliability(runs: Sequence[JudgedRun], alarm: Alarm = ours, what: str = "right") -> list[str]:
    """Return how often the estimate was "right" or "not lost" where an alarm gave it a probability."""
    knows = np.concatenate([1 - alarm(run) for run in runs])
    flags = [run.numbers["correct"] if what == "right" else 1 - run.numbers["lost"] for run in runs]
    right = np.concatenate(flags).astype(float)
    sizes = [len(run.numbers["lost"]) for run in runs]
    of = alike(runs)
    clusters = Clusters(*(np.repeat(labels, sizes) for labels in (of.places, of.drives, of.runs)))
    lines = [f"| probability, % | updates | {what}, % |", "|---|---|---|"]
    for low, high in ((0, 0.1), (0.1, 0.5), (0.5, 0.9), (0.9, 0.99), (0.99, 1.01)):
        inside = (knows >= low) & (knows < high)
        if inside.any():
            found = said(mean(right[inside], clusters[inside]))
            lines.append(f"| {100 * low:.0f} to {100 * min(high, 1):.0f} | {inside.sum()} | {found} |")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=cache_root() / "lost-signal")
    parser.add_argument("--fit", action="store_true", help="print the weights fitted anew")
    parser.add_argument("--figure", type=Path, help="draw the curves of misses over false alarms")
    asked = parser.parse_args()
    fits, tests = judged(FITTED, asked.folder), judged(UNSEEN, asked.folder)
    drives = len({run.course.name for run in tests})
    print(f"{drives} unseen drives, {len(FILTERS)} filters, {len(SEEDS)} seeds: {len(tests)} runs\n")
    if asked.fit:
        print(fitted(fits), "\n", fitted_opinion(fits), "\n")
    print(table(fits, tests))
    if asked.figure:
        draw(tests, asked.figure)


def draw(runs: Sequence[JudgedRun], file: Path) -> None:
    """Draw the share of losses noticed over the share of runs with a false alarm."""
    from matplotlib.figure import Figure

    figure = Figure((6.4, 4.6), layout="constrained")
    axes = figure.subplots()
    for (name, alarm), style in zip(
        ALARMS.items(), ("-", (0, (5, 1)), "--", "-.", ":", (0, (1, 3))), strict=True
    ):
        highest, (at_losses, _) = highest_false(runs, alarm), noticed_at(runs, alarm)
        shares = np.linspace(0, 1, 101)[:-1]
        noticed = [100 * float((at_losses > at_share(highest, share)).mean()) for share in shares]
        axes.plot(100 * shares, noticed, linestyle=style, label=name)
    axes.axvline(100 * FALSE_ALARMS, color="0.6", lw=0.8)
    axes.set(xlabel="runs with a false alarm (%)", ylabel="losses noticed within 5 pictures (%)")
    axes.set(xlim=(0, 50), ylim=(0, 101))
    figure.legend(loc="outside upper center", ncols=2, fontsize=8)
    figure.savefig(file, dpi=130)


if __name__ == "__main__":
    main()
