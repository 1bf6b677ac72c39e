"""Runs of a plan: each as if alone, on any engine, after any kill; errors are rows."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import polars as pl
import pytest

from helpers.small_session import write_small_session, write_small_survey
from maurice_datasets.trials import rows as rows_module
from maurice_datasets.trials.engine import run_plan
from maurice_datasets.trials.plan import Plan, read_plan
from maurice_datasets.trials.rows import KEY, MEASURED, MOST, OLDER, RowStore, read_plan_of, read_rows
from maurice_datasets.trials.runs import Job, Row, TrialRun, run_job
from maurice_datasets.trials.table import grouped, load_trials, paired
from maurice_loaders.errors import InputError

PLAN = """
seeds = {seeds}
[[sessions]]
path = "session.log"
[settings]
particles = 50
[grid]
feature = ["color", "edges"]
"resampling.scheme" = ["systematic", "multinomial"]
"""


@pytest.fixture
def plan_file(small_session: Path) -> Path:
    """A plan over a recorded session."""
    file = small_session.with_name("mine.toml")
    file.write_text(PLAN.format(seeds=3))
    return file


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> tuple[Plan, Path]:
    """Run the plan once for all that only look at it; return it, and where its rows are."""
    folder = tmp_path_factory.mktemp("ran")
    write_small_survey(folder)
    write_small_session(folder).with_name("mine.toml").write_text(PLAN.format(seeds=3))
    plan = read_plan(folder / "mine.toml")
    made = run_plan(plan, folder / "out")
    assert (made.runs, made.made, made.failed) == (12, 12, 0)
    return plan, folder / "out"


@pytest.fixture
def out(ran: tuple[Plan, Path], tmp_path: Path) -> Path:
    """A copy of the rows, to be changed."""
    return Path(shutil.copytree(ran[1], tmp_path / "ran"))


def same(rows: pl.DataFrame) -> pl.DataFrame:
    return rows.drop(*MEASURED)


def run_alone(plan: Plan, row: Row) -> Row:
    """Return the row of one run, computed by itself."""
    part = next(part for part in plan.parts if part.name == row["part"])
    spec = next(spec for spec in part.sessions if spec.label == row["session"])
    variant = part.variants[row["variant"]]
    varied = tuple(part.variants.varied)
    asked = TrialRun(*(row[name] for name in KEY[:3]), variant.label, variant.settings, varied, row["seed"])
    return run_job(Job(spec.drive, 0 if spec.path else row["seed"], (asked,)))[0]


def test_a_run_of_a_plan_is_the_run_alone(ran: tuple[Plan, Path]) -> None:
    plan, folder = ran
    rows = read_rows(folder)
    assert len(rows) == 12
    for row in rows.filter(pl.col("seed") == 1).iter_rows(named=True):
        alone = run_alone(plan, row)
        kept = pl.DataFrame([alone | {name: row[name] for name in MEASURED}], schema=rows.schema)
        assert kept.equals(pl.DataFrame([row], schema=rows.schema), null_equal=True)


def test_workers_and_order_do_not_matter(ran: tuple[Plan, Path], tmp_path: Path) -> None:
    plan, folder = ran
    run_plan(plan, tmp_path / "two", workers=2)
    assert same(read_rows(folder)).equals(same(read_rows(tmp_path / "two")))


def test_few_runs_over_one_recording_are_shared_by_all_workers(
    plan_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sizes: list[int] = []

    def noted(jobs: Iterator[Job], *words: Any) -> Any:
        sizes.extend(len(job.asked) for job in jobs)
        return nullcontext(iter(()))

    monkeypatch.setattr("maurice_datasets.trials.engine._results", noted)
    run_plan(read_plan(plan_file), tmp_path / "out", workers=4)
    assert sizes == [3, 3, 3, 3]  # the three seeds of a filter stay together


def test_nothing_is_computed_twice(ran: tuple[Plan, Path], out: Path) -> None:
    plan, _ = ran
    assert run_plan(plan, out, resume=True).made == 0
    with pytest.raises(InputError, match="--resume"):
        run_plan(plan, out)
    with pytest.raises(InputError, match="differs in more than more seeds"):
        run_plan(plan.with_seeds(2), out, resume=True)


def test_more_seeds_go_on_where_fewer_ended(ran: tuple[Plan, Path], tmp_path: Path) -> None:
    plan, whole = ran
    run_plan(plan.with_seeds(2), tmp_path / "out")
    assert run_plan(plan, tmp_path / "out", resume=True).made == 4
    assert read_rows(tmp_path / "out", ["error_mean_m"]).equals(read_rows(whole, ["error_mean_m"]))


def test_a_failing_run_is_a_row_and_is_tried_again(plan_file: Path, tmp_path: Path) -> None:
    text = plan_file.read_text()
    plan_file.write_text(text.replace("[grid]", 'motion = {model = "maurice", turn_gain = "wide"}\n[grid]'))
    plan = read_plan(plan_file).with_seeds(1)
    made = run_plan(plan, tmp_path / "out")
    rows = read_rows(tmp_path / "out")
    assert made.failed == 4
    assert made.error == rows["error"][0]
    assert rows["error"].null_count() == 0
    assert rows["error_mean_m"].null_count() == 4
    assert "turn_gain" in rows["error"][0]
    assert run_plan(plan, tmp_path / "out", resume=True).made == 4


def test_a_missing_session_is_a_row_for_each_of_its_runs(plan_file: Path, tmp_path: Path) -> None:
    plan_file.write_text(plan_file.read_text().replace("session.log", "nothing.log"))
    assert run_plan(read_plan(plan_file), tmp_path / "out").failed == 12


RUN = """
import sys
from maurice_datasets.trials.engine import run_plan
from maurice_datasets.trials.plan import read_plan
run_plan(read_plan(sys.argv[1]), sys.argv[2], resume=True)
"""


@pytest.mark.slow
def test_killed_at_any_moment_it_goes_on(plan_file: Path, tmp_path: Path) -> None:
    plan_file.write_text(plan_file.read_text().replace("seeds = 3", "seeds = 120"))
    plan, out = read_plan(plan_file), tmp_path / "out"
    seen = 0
    for wait_s in (1.0, 1.4, 1.8, 2.2, 2.6):
        process = subprocess.Popen([sys.executable, "-c", RUN, str(plan_file), str(out)])
        time.sleep(wait_s)
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        if (out / "plan.json").exists():
            rows = len(read_rows(out))
            assert rows >= seen
            seen = rows
    run_plan(plan, out, resume=True)
    run_plan(plan, tmp_path / "undisturbed")
    assert same(read_rows(out)).equals(same(read_rows(tmp_path / "undisturbed")))
    assert not [file for file in (out / "rows").iterdir() if file.name.endswith(".part")]


def test_a_stop_says_how_many_runs_are_on_disk(plan_file: Path, tmp_path: Path) -> None:
    def stop(done: int, total: int) -> None:
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match=r"4 of 4 runs are in .*--resume"):
        run_plan(read_plan(plan_file).with_seeds(1), tmp_path / "out", progress=stop)
    assert len(read_rows(tmp_path / "out")) == 4


def test_a_job_writes_only_the_last_rows_anew(plan_file: Path, tmp_path: Path) -> None:
    store = RowStore.begin(tmp_path / "out", read_plan(plan_file), resume=False)
    for first in range(0, 3 * MOST, MOST // 2):
        names = {"part": "mine", "session": "session", "variant": 0}
        store.add([{**names, "seed": seed} for seed in range(first, first + MOST // 2)])
    assert [len(pl.read_parquet(file)) for file in store.files()] == [MOST] * 3
    assert len(store.done) == len(read_rows(tmp_path / "out")) == 3 * MOST


DAMAGED = {
    "cut": lambda file: file.write_bytes(file.read_bytes()[:3000]),
    "not ours": lambda file: pl.DataFrame({"a": [1]}).write_parquet(file),
    "other types": lambda file: pl.read_parquet(file).cast({"seed": pl.String}).write_parquet(file),
}


@pytest.mark.parametrize("damage", DAMAGED)
def test_damaged_rows_are_said_in_one_line(damage: str, ran: tuple[Plan, Path], out: Path) -> None:
    plan, file = ran[0], out / "rows" / "000000.parquet"
    (out / "rows" / "0old.parquet").write_bytes(b"")  # not one of ours
    DAMAGED[damage](file)
    for read in (load_trials, lambda folder: run_plan(plan, folder, resume=True)):
        with pytest.raises(InputError, match=r"000000.parquet: cannot be read: .*; delete it") as problem:
            read(out)
        assert "\n" not in str(problem.value)


def test_rows_with_the_names_of_an_older_version_are_read_as_todays(out: Path) -> None:
    kept = read_rows(out)
    assert kept["error_mean_m"].dtype == pl.Float64
    (file,) = (out / "rows").iterdir()
    rows = pl.read_parquet(file)
    rows.select(pl.col(name).alias(OLDER.get(name, name)) for name in rows.columns).write_parquet(file)
    assert "off_m" in pl.read_parquet_schema(file)
    assert read_rows(out).equals(kept)


def test_rows_that_are_deleted_are_computed_again(ran: tuple[Plan, Path], out: Path) -> None:
    (out / "rows" / "000000.parquet").unlink()
    assert run_plan(ran[0], out, resume=True).made == 12


@pytest.mark.parametrize("text", ["{", "[]", "{}", '{"hash": "a", "plan": []}'])
def test_a_damaged_plan_of_a_folder_is_said_in_one_line(text: str, plan_file: Path, tmp_path: Path) -> None:
    plan = read_plan(plan_file)
    RowStore.begin(tmp_path / "out", plan, resume=False)
    (tmp_path / "out" / "plan.json").write_text(text)
    for read in (read_plan_of, lambda folder: run_plan(plan, folder, resume=True)):
        with pytest.raises(InputError, match=r"plan.json: cannot be read, expected the plan"):
            read(tmp_path / "out")


def test_a_folder_that_was_killed_as_it_began_is_gone_on_with(
    plan_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It holds nothing, or a part of the plan, before it holds anything else."""

    class KilledError(Exception):
        pass

    def killed(file: Path, data: bytes, **how: object) -> None:
        file.with_name(f".{file.name}.{2**22 - 1}.part").write_bytes(data[:9])  # of no living process
        raise KilledError

    plan = read_plan(plan_file)
    monkeypatch.setattr(rows_module, "write_whole", killed)
    with pytest.raises(KilledError):
        RowStore.begin(tmp_path / "out", plan, resume=False)
    monkeypatch.undo()
    assert RowStore.begin(tmp_path / "out", plan, resume=True).done == set()
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == ["plan.json", "rows"]


def workers_of(parent: int) -> list[int]:
    told = subprocess.run(["ps", "-eo", "pid=,ppid="], capture_output=True, text=True, check=True).stdout
    pairs = [tuple(map(int, line.split())) for line in told.splitlines()]
    return [pid for pid, of in pairs if of == parent]


def is_running(pid: int) -> bool:
    told = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True, check=False)
    return told.stdout.strip()[:1] not in ("", "Z")


@pytest.mark.slow
def test_workers_of_a_killed_process_end_by_themselves(plan_file: Path, tmp_path: Path) -> None:
    plan_file.write_text(plan_file.read_text().replace("seeds = 3", "seeds = 2000"))
    run = RUN.replace("resume=True", "workers=2")
    process = subprocess.Popen([sys.executable, "-c", run, str(plan_file), str(tmp_path / "out")])
    workers: list[int] = []
    while len(workers) < 3 and process.poll() is None:  # two, and the keeper of what they share
        time.sleep(0.05)
        workers = workers_of(process.pid)
    process.kill()
    process.wait()
    ends = time.monotonic() + 30
    while any(map(is_running, workers)) and time.monotonic() < ends:
        time.sleep(0.1)
    assert not any(map(is_running, workers))


@pytest.mark.slow
def test_a_real_cluster_makes_the_same_rows(plan_file: Path, tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    plan = read_plan(plan_file)
    run_plan(plan, tmp_path / "here")
    run_plan(plan, tmp_path / "there", engine="dask", workers=2)
    assert same(read_rows(tmp_path / "here")).equals(same(read_rows(tmp_path / "there")))


def started(*words: str) -> subprocess.Popen[bytes]:
    command = Path(sys.executable).with_name("dask")
    return subprocess.Popen([str(command), *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


@pytest.mark.slow
def test_a_worker_that_is_killed_half_way_loses_nothing(plan_file: Path, tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    plan_file.write_text(plan_file.read_text().replace("seeds = 3", "seeds = 60"))
    plan, file = read_plan(plan_file), tmp_path / "scheduler.json"
    here = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file))
    servers = [started("scheduler", *here)]
    join = ("worker", "--scheduler-file", str(file), "--nthreads", "1", "--no-dashboard", "--no-nanny")
    servers += [started(*join), started(*join)]
    try:
        for _ in range(300):
            if file.exists() and "127.0.0.1" in file.read_text():
                break
            time.sleep(0.1)
        address = json.loads(file.read_text())["address"]

        def kill(done: int, total: int) -> None:
            if done > 0 and servers[1].poll() is None:
                servers[1].kill()
                servers[1].wait()

        run_plan(plan, tmp_path / "there", engine="dask", scheduler=address, progress=kill)
        assert servers[1].poll() is not None
    finally:
        for server in servers:
            server.kill()
            server.wait()
    run_plan(plan, tmp_path / "here")
    assert same(read_rows(tmp_path / "here")).equals(same(read_rows(tmp_path / "there")))


def test_a_scheduler_that_does_not_answer_is_said_in_one_line(
    plan_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("maurice_datasets.trials.engine.SCHEDULER_PATIENCE_S", 0.5)
    with pytest.raises(InputError, match="does not answer"):
        run_plan(read_plan(plan_file), tmp_path / "out", engine="dask", scheduler="tcp://127.0.0.1:9")


def test_tables(ran: tuple[Plan, Path]) -> None:
    rows = load_trials(ran[1])
    groups = grouped(rows, ["feature", "resampling.scheme"])
    names = [tuple(one.by.values()) for one in groups][:2]
    assert names == [("color", "systematic"), ("color", "multinomial")]
    some = rows.filter((pl.col("feature") == "color") & (pl.col("resampling.scheme") == "systematic"))
    assert groups[0].figure.value == pytest.approx(some["error_mean_m"].mean())
    assert groups[0].runs == 3
    apart = paired(rows, ["feature"])
    color, edges = (
        rows.filter(pl.col("feature") == name)["error_mean_m"].mean() for name in ("color", "edges")
    )
    assert isinstance(color, float)
    assert isinstance(edges, float)
    assert len(apart) == 1
    assert apart[0].figure.value == pytest.approx(edges - color)
    assert apart[0].figure.count == 6
    with pytest.raises(InputError, match="found no column 'colour'"):
        grouped(rows, ["colour"])
