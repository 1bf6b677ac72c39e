"""Plans as TOML: which runs they hold, and what is refused in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from maurice_datasets.sessions import simulation_plan
from maurice_datasets.trials.plan import configuration_of, read_plan, shipped_plans
from maurice_datasets.trials.runs import jobs_of
from maurice_loaders.errors import InputError

SMALL = """
seeds = 3
[[sessions]]
task = "tracking"
updates = 5
[settings]
preset = "thesis"
[grid]
particles = [10, 20]
feature = ["color", "edges"]
[[variants]]
label = "by hand"
"recovery.strategy" = "threshold"
"""


def plan_of(tmp_path: Path, text: str) -> Path:
    file = tmp_path / "mine.toml"
    file.write_text(text)
    return file


def test_the_grid_is_every_combination_and_variants_follow(tmp_path: Path) -> None:
    part = read_plan(plan_of(tmp_path, SMALL)).parts[0]
    labels = [part.variants[number].label for number in range(len(part.variants))]
    assert labels == ["10, color", "10, edges", "20, color", "20, edges", "by hand"]
    assert part.variants[2].settings == {"preset": "thesis", "particles": 20, "feature": "color"}
    assert part.variants[4].settings == {"preset": "thesis", "recovery.strategy": "threshold"}
    assert part.runs == 15


def test_every_run_is_in_one_job_and_done_ones_in_none(tmp_path: Path) -> None:
    plan = read_plan(plan_of(tmp_path, SMALL))
    keys = [one.key for job in jobs_of(plan, set()) for one in job.asked]
    assert len(keys) == len(set(keys)) == plan.runs
    left = [one.key for job in jobs_of(plan, set(keys[:7])) for one in job.asked]
    assert sorted(left + keys[:7]) == sorted(keys)


def test_jobs_over_a_recording_begin_small_and_grow_also_after_a_stop(tmp_path: Path) -> None:
    (tmp_path / "session.log").touch()
    plan = read_plan(plan_of(tmp_path, 'seeds = 200\n[[sessions]]\npath = "session.log"\n'))
    jobs = list(jobs_of(plan, set()))
    assert [len(job.asked) for job in jobs] == [8, 16, 32, 64, 64, 16]
    done = {asked.key for job in jobs[1:4] for asked in job.asked}
    assert [len(job.asked) for job in jobs_of(plan, done)] == [8, 16, 32, 32]


def test_parts_with_the_same_drives_share_their_jobs() -> None:
    plan = read_plan("thesis").only(["blended", "smoothing"]).with_seeds(2)
    jobs = list(jobs_of(plan, set()))
    assert len(jobs) == 4  # two of them are in brighter light
    assert {one.part for one in jobs[0].asked} == {"blended", "smoothing"}


def test_a_hundred_thousand_runs_are_not_listed() -> None:
    plan = read_plan("position-tracking", seeds=1000)
    grid = {"particles": list(range(100, 200))}
    part = plan.parts[0]
    from dataclasses import replace

    plan = replace(plan, parts=(replace(part, variants=replace(part.variants, grid=grid)),))
    assert plan.runs == 100_000
    assert len(next(jobs_of(plan, set())).asked) == 100


@pytest.mark.parametrize("name", shipped_plans())
def test_shipped_plans_can_be_read(name: str) -> None:
    plan = read_plan(name)
    for part in plan.parts:
        for number in range(len(part.variants)):
            configuration_of(part.variants[number].settings)
    assert plan.runs > 0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("seeds = 0\n[[sessions]]\ntask = 'tracking'", "seeds: found 0"),
        ("[[sessions]]\ntask = 'flying'", "task: found 'flying'"),
        ("[[sessions]]\nupdates = 5", "found neither task nor path"),
        ("[[sessions]]\ntask = 'global'\nspeed = 3", "found the key 'speed'"),
        ("[[sessions]]\ntask = 'global'\n[grid]\nparticles = [0]", "particles: found 0"),
        ("[[sessions]]\ntask = 'global'\n[grid]\nparticels = [10]", "did you mean particles?"),
        ("[[sessions]]\ntask = 'global'\n[grid]\nparticles = []", "found an empty list"),
        ("[[sessions]]\ntask = 'global'\n[settings]\nfeature = 'colour'", "feature: found 'colour'"),
        (
            "[[sessions]]\ntask = 'global'\ncamera = 'mine'",
            "camera: found 'mine'",
        ),
        ("seeds = 2000\n[[sessions]]\ntask = 'global'", "at most 1000"),
        ("title = 'nothing'", "found no [[sessions]]"),
        ("[[sessions]\n", "TOML"),
        ("include = ['mine.toml']", "found mine.toml within itself"),
        ("include = 3", "include: found 3, expected a list"),
        ("include = [3]", "include: found 3, expected the name of a plan"),
        ("include = ['..']", "found a folder"),
        ("include = ['blended', 'blended']", "found the part 'blended' twice"),
        ("title = [1]\n[[sessions]]\ntask = 'global'", "title: found [1], expected a text"),
        ("seeds = 1.5\n[[sessions]]\ntask = 'global'", "seeds: found 1.5, expected a whole number"),
        ("sessions = 3", "sessions: found 3, expected a list"),
        ("sessions = [3]", "session 1: found 3, expected a table"),
        ("grid = 3\n[[sessions]]\ntask = 'global'", "grid: found 3, expected a table"),
        ("variants = [3]\n[[sessions]]\ntask = 'global'", "variant 1: found 3, expected a table"),
        ("[[sessions]]\ntask = 'global'\nupdates = 'x'", "updates: found 'x', expected a whole number"),
        ("[[sessions]]\ntask = 'global'\narenas = 0", "arenas: found 0"),
        ("[[sessions]]\ntask = 'global'\nlights = 'nonsense'", "found light change 'nonsense'"),
        ("[[sessions]]\ntask = 'kidnapped'\nupdates = 4\nkidnap_at = 9", "after movement 9 of 4"),
        ("[[sessions]]\npath = 3", "path: found 3, expected a text"),
        ("[[sessions]]\npath = []", "session 1: found an empty list"),
        ("[[sessions]]\npath = 'a.log'\ntask = 'global'", "found both task and path"),
        ("[[sessions]]\npath = 'a.log'\n[[sessions]]\npath = 'b/a.log'", "found the label 'a' twice"),
        ("[[sessions]]\ntask = 'global'\n[grid]\nparticles = [100, 'many']", "found 'many'"),
        (
            "[[sessions]]\ntask = 'global'\n[[variants]]\nparticles = 5\n[[variants]]\nparticles = 5",
            "variants: found the label '5' twice",
        ),
    ],
)
def test_what_is_no_plan_is_said_in_one_line(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError) as problem:
        read_plan(plan_of(tmp_path, text))
    assert said in str(problem.value)
    assert "\n" not in str(problem.value)


def test_plans_that_include_each_other_in_pairs_are_refused_at_once(tmp_path: Path) -> None:
    """Thirty such pairs would be read a thousand million times."""
    for number in range(1, 15):
        below = f"include = ['a{number + 1}.toml', 'b{number + 1}.toml']\n"
        for name in "ab":
            leaf = "[[sessions]]\ntask = 'global'\n"
            (tmp_path / f"{name}{number}.toml").write_text(below if number < 14 else leaf)
    with pytest.raises(InputError, match=r"found the part .[ab]14. twice"):
        read_plan(tmp_path / "a1.toml")


def test_a_long_chain_of_plans_is_refused(tmp_path: Path) -> None:
    for number in range(2000):
        (tmp_path / f"p{number}.toml").write_text(f"include = ['p{number + 1}.toml']\n")
    with pytest.raises(InputError, match="within each other"):
        read_plan(tmp_path / "p0.toml")


def test_a_plan_that_is_not_there_names_those_that_come_along() -> None:
    with pytest.raises(InputError, match="position-tracking"):
        read_plan("nothing")


@pytest.mark.parametrize("name", shipped_plans())
def test_every_session_of_a_shipped_plan_can_be_simulated(name: str) -> None:
    for part in read_plan(name).parts:
        for spec in part.sessions:
            settings = {"lights": spec.lights, "slip_at": spec.slip_at, "kidnap_at": spec.kidnap_at}
            assert simulation_plan(spec.task, tier=spec.tier, updates=spec.updates, **settings)


def test_a_quick_plan_has_every_named_value_that_its_figures_are_titled_by() -> None:
    whole, quick = read_plan("thesis"), read_plan("thesis").quick()
    for part, short in zip(whole.parts, quick.parts, strict=True):
        for key, values in part.variants.grid.items():
            kept = short.variants.grid[key]
            assert kept == (values if isinstance(values[0], str) else [values[0], values[-1]])


DOCS = Path(__file__).parents[3] / "docs"


def test_every_shipped_plan_is_named() -> None:
    text = (DOCS / "trials.md").read_text()
    assert [name for name in shipped_plans() if f"`{name}`" not in text] == []
