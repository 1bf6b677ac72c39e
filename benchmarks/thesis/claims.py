"""What the thesis says: each statement of the text that is held here, in our words, with its test.

A test is a figure and its bounds, set down before the runs; `verdicts.py` says how a verdict comes about.
"""

from __future__ import annotations

from . import picture_claims as pictures
from . import run_claims as runs
from .run_claims import THESIS, TRACKS, difference
from .success import GLOBAL, KIDNAPPED, TRACKING, success_test
from .verdicts import BUILT_IN, Bound, Claim

RATE = 8  # drives at least for a share of runs
SUCCEED = Bound("runs with 2,000 particles", "%", 50, digits=0)
ALSO = Bound("in one foot", "%", digits=0), Bound("localized by our scores", "%", digits=0)
SUCCESS = "over 90 % about one point, sd below 10 % of the arena, in five minutes"
STRATEGIES = ("always", "threshold", "sensor", "augmented", "mixture")
BY_CONSTRUCTION = "the simulated robot is made with it"


def _built_in(name: str, stated: str, why: str = BY_CONSTRUCTION, section: str = "3.2") -> Claim:
    return Claim(name, section, stated, why=why, verdict=BUILT_IN)


def _less_error(of: str) -> tuple[Bound]:
    return (Bound(f"error {of}", "in", high=0),)


CLAIMS = (
    Claim(
        "Motion alone",
        "3.2",
        "errors add up fast",
        (Bound("deviation after 116 in less twice that after half of it", "in", 0),),
        pictures.compounding,
    ),
    Claim(
        "Heading noise",
        "3.2.3",
        "more of it does no harm",
        (
            Bound("error with 4.9 degrees more a straight less without", "in", high=0.5),
            Bound("more tracks lost", "points", high=5, digits=0),
        ),
        difference(TRACKS, "label", THESIS, "more heading noise", "error_mean_m", "lost"),
        least=RATE,
    ),
    Claim(
        "Dark bins",
        "3.3",
        "low values dominate what the library holds",
        (Bound("largest counts in the lower 14 bins less the upper, of 256", low=0, digits=0),),
        pictures.dark_bins,
    ),
    Claim(
        "Two rooms",
        "3.3",
        "light makes a step in match quality from room to room",
        (Bound("quality of the robot's room less the other's", low=0, digits=2),),
        pictures.two_rooms,
    ),
    Claim(
        "Match quality",
        "3.3",
        "best five 0.82 to 0.84, most entries 0.3 to 0.7",
        (
            Bound("best entry", low=0.8, high=0.88, digits=2),
            Bound("entries from 0.3 to 0.7", "%", 50, digits=0),
        ),
        pictures.best_quality,
    ),
    Claim(
        "Noise floor and relevance",
        "3.3",
        "without them more wrong matches",
        _less_error("with them less plain L1"),
        difference(TRACKS, "label", "plain L1", THESIS),
    ),
    Claim(
        "Noise floor's bins",
        "3.3",
        "the floor throws their color away, which favors images that differ there",
        (Bound("difference of the best match there with the floor less without, of 256", low=0),),
        pictures.floor_bins,
    ),
    Claim(
        "Tunnel vision",
        "3.4",
        "resampling loses right hypotheses, most of all of a kidnapped robot",
        (Bound("kidnapped runs without fresh particles right at the end", "%", high=50, digits=0),),
        runs.stays_lost,
        least=RATE,
    ),
    Claim(
        "Standing still",
        "3.4",
        "resampling without driving draws the cloud to the best entries",
        (
            Bound("error after 43 turns in place less before", "in", 0),
            Bound("deviation after less before", "in", high=0),
        ),
        pictures.turning,
    ),
    Claim("Success, tracking", "3.6", SUCCESS, (SUCCEED, *ALSO), success_test(TRACKING), least=RATE),
    Claim("Success, global", "3.6", SUCCESS, (SUCCEED, *ALSO), success_test(GLOBAL), least=RATE),
    Claim("Success, kidnapped", "3.6", SUCCESS, (SUCCEED, *ALSO), success_test(KIDNAPPED), least=RATE),
    Claim(
        "Typical error",
        "3.6",
        "0 to 16 in, occasionally above 30",
        (
            Bound("updates up to 16 in", "%", 50, digits=0),
            Bound("updates above 30 in", "%", high=10),
        ),
        runs.typical_error,
    ),
    Claim(
        "More measurements",
        "3.6",
        "they sharpen the estimate of a robot that turns in place",
        (Bound("deviation after 43 turns less before", "in", high=0),),
        pictures.sharpened,
    ),
    Claim(
        "Ambiguity",
        "3.6",
        "that of the sensor model is at the core of the imprecision",
        (Bound("error with the feature best less half of that with color", "in", high=0),),
        pictures.ambiguous,
    ),
    Claim(
        "Wider motion model",
        "3.6",
        "a remedy",
        (Bound("more tracks lost with 5 % of the noise four times as wide", "points", high=0, digits=0),),
        difference(TRACKS, "label", THESIS, "wider motion", "lost"),
        least=RATE,
    ),
    Claim(
        "Dynamic threshold",
        "3.6",
        "even draws where the match falls below it: a remedy",
        (Bound("more kidnapped runs right at the end", "points", 0, digits=0),),
        difference("even-draws", "label", "no even draws", "library, 2,000", "right_at_end"),
        least=RATE,
    ),
    Claim(
        "Critical count",
        "3.6.2",
        "about 2,000 particles",
        (
            Bound("more tracks lost with 500 than with 60,000", "points", 5, digits=0),
            Bound("with 5,000", "points", high=5, digits=0),
        ),
        runs.critical_count,
        least=RATE,
    ),
    Claim(
        "Error and count",
        "3.6.2",
        "the error does not depend on the count",
        (Bound("slope, where no count was lost, a decade of particles", "in", -0.3, 0.3, 2),),
        runs.error_by_count,
    ),
    Claim(
        "100 particles",
        "3.6.2",
        "573.13 in at best, before it was lost",
        (Bound("tracks that reach 1,000 in", "%", high=5, digits=0),),
        runs.hundred_particles,
        least=RATE,
    ),
    Claim(
        "Impoverishment",
        "3.6.2",
        "every failure followed an absence of particles near the truth",
        (Bound("lost tracks of which `diagnose` names it", "%", 50, digits=0),),
        runs.impoverished,
        least=RATE,
    ),
    Claim(
        "Only precondition",
        "3.6.2",
        "impoverishment alone lets a track fail, several modes do not",
        (
            Bound(
                "lost tracks with no particle within 12 in and 45 degrees as the loss begins",
                "%",
                50,
                digits=0,
            ),
        ),
        pictures.precondition,
        least=RATE,
    ),
    Claim(
        "Above 2,000",
        "3.6.2",
        "only uneven floor made runs fail",
        (Bound("lost tracks of which `diagnose` names odometry", "%", 50, digits=0),),
        runs.by_odometry,
        least=RATE,
    ),
    Claim(
        "Even draws",
        "3.6.2",
        "they need many particles",
        (Bound("more kidnapped runs right at the end with 20,000 than with 200", "points", 5, digits=0),),
        difference("even-draws", "label", "library, 200", "library, 20,000", "right_at_end"),
        least=RATE,
    ),
    Claim(
        "Return",
        "3.6.3",
        "a lost filter returns only by chance overlap",
        (
            Bound(
                "lost tracks that began with no particle near the truth, right at the end",
                "%",
                high=50,
                digits=0,
            ),
        ),
        pictures.by_chance,
        least=RATE,
    ),
    Claim(
        "Smoothing",
        "4.2.1",
        "a remedy (title only)",
        _less_error("in brighter light, smoothed less color"),
        difference("smoothing", "feature", "color", "smoothed", session="tracking, brighter"),
    ),
    Claim(
        "Edges",
        "4.2.2",
        "a feature (title only)",
        _less_error("with edges less with color"),
        difference("blended", "feature", "color", "edges"),
    ),
    Claim(
        "Blended features",
        "4.2.3",
        "more robust together (abstract)",
        _less_error("blended less color"),
        difference(TRACKS, "label", THESIS, "blended"),
    ),
    Claim(
        "Sensor-aided sampling",
        "4.3",
        "recovers a robot that is lost (title only)",
        tuple(
            Bound(
                ("more kidnapped runs right at the end with " if name == "always" else "") + name,
                "points",
                0,
                digits=0,
            )
            for name in STRATEGIES
        ),
        runs.recovery(STRATEGIES),
        least=RATE,
    ),
    Claim(
        "Brightness",
        "5",
        "shifts histograms: an open limitation (title only)",
        (Bound("error at +30 % less without", "in", 0),),
        runs.brightness,
    ),
    Claim(
        "Time of an update",
        "5",
        "grows with the particles (figure 72, title only)",
        (Bound("time with 60,000 over that with 2,000", low=2),),
        runs.update_cost,
    ),
    _built_in("Rotation constant", "C = 1.3695, measured over actual"),
    _built_in("Turns", "residual N(0.2681, 4.916) degrees, left as right"),
    _built_in("Encoders", "error N(-0.6978, 0.6356)"),
    _built_in("Floors", "the floor changes the heading of a straight, hardly its length"),
    _built_in("Error and distance", "9 in per 1,000 in", "the arena was tuned by it", "3.6.2"),
    Claim("Real time", "3.5", "motion waits for the update", why="a matter of the robot's hardware"),
    Claim("Confidence", "3.6.2", "0.97 in a run with 5,000 particles", why="its definition is not known"),
)
