"""The engine of many runs: on the cores of one machine by joblib, or on many machines by Dask.

`run_plan` makes the rows of a plan, whose drives each worker opens for itself; `tables_of` makes runs over
drives that this process holds, for checks, budgets and remedies. What is made does not depend on workers.
"""

from __future__ import annotations

import importlib
import os
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, TypeVar

import cv2
import joblib  # type: ignore[import-untyped]  # has no types

from maurice_loaders.errors import InputError
from maurice_mcl.scoring.batch import SeededRuns
from maurice_mcl.scoring.table import RunTable
from maurice_mcl.values import Progress

from .plan import Plan
from .rows import RowStore
from .runs import RUNS_A_JOB, Job, Row, jobs_of, run_job

LOCAL, DASK = "local", "dask"
CLUSTER = "pip install 'maurice-replay[cluster]'"
SCHEDULER_PATIENCE_S = 10.0
AHEAD = 2  # jobs waiting per worker
WORTH_PROCESSES = 10_000_000  # particles moved, some seconds: with fewer, starting processes takes longer
Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Made:
    """What was made."""

    folder: Path
    runs: int  # of the plan
    made: int  # in this call
    failed: int  # of them
    error: str | None = None  # of the first that failed


def run_plan(
    plan: Plan,
    folder: str | Path,
    *,
    workers: int = 1,
    engine: str = LOCAL,
    scheduler: str | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> Made:
    """Make every run of a plan that the folder does not hold yet; rows appear in it as they are done.

    `engine` "local" uses `workers` spawned processes (1: this one); "dask" the workers of the `scheduler` at
    an address, or `workers` of its own. Every run is computed as if alone: the rows do not depend on workers,
    engine or order, but for `took_s` and `host`. Raises InputError for a folder that holds anything else, and
    for a scheduler that does not answer.

        >>> import maurice_datasets as md
        >>> md.run_plan(md.read_plan("kidnapped", seeds=2), "trials", workers=2).runs  # doctest: +SKIP
        6
    """
    store = RowStore.begin(Path(folder), plan, resume=resume)
    report = progress or (lambda done, total: None)
    before = len(store.done)
    report(before, plan.runs)
    share = -(-(plan.runs - before) // max(workers, 1))  # of each worker, where there are but few runs
    jobs = jobs_of(plan, set(store.done), min(max(share, 1), RUNS_A_JOB))
    try:
        with _results(jobs, workers, engine, scheduler) as results:
            for rows in results:
                store.add(rows)
                report(len(store.done), plan.runs)
    except KeyboardInterrupt as stop:
        there = f"{len(store.done):,} of {plan.runs:,} runs are in {folder}"
        stop.args = (f"{there}; the same command with --resume makes the others",)
        raise
    return Made(Path(folder), plan.runs, len(store.done) - before, store.failed, store.error)


def tables_of(
    asked: Sequence[SeededRuns], progress: Progress | None = None, *, workers: int | None = None
) -> list[tuple[RunTable, ...]]:
    """Make runs on all cores (`workers`: on so many); return the tables of each, in the order of the asked.

    Parts of them, the largest first, go to spawned processes where that is worth their start. `progress` is
    told how many parts are made, of how many.
    """
    parts = [(number, part) for number, runs in enumerate(asked) for part in runs.parts()]
    order = sorted(range(len(parts)), key=lambda number: -parts[number][1].particles)
    tables: list[tuple[RunTable, ...]] = [()] * len(parts)
    processes = min(workers or joblib.cpu_count(), len(parts))
    is_worth = processes > 1 and sum(runs.particles for runs in asked) >= WORTH_PROCESSES
    numbered = ((number, parts[number][1]) for number in order)
    with (
        in_processes(_tables, numbered, processes)
        if is_worth
        else nullcontext(map(_tables, numbered)) as each
    ):
        for count, (number, some) in enumerate(each, 1):
            tables[number] = some
            if progress:
                progress(count, len(parts))
    return [
        tuple(chain.from_iterable(tables[at] for at, (whose, _) in enumerate(parts) if whose == number))
        for number in range(len(asked))
    ]


def _tables(part: tuple[int, SeededRuns]) -> tuple[int, tuple[RunTable, ...]]:
    number, runs = part
    return number, runs.tables()


@contextmanager
def _results(
    jobs: Iterator[Job], workers: int, engine: str, scheduler: str | None
) -> Iterator[Iterator[list[Row]]]:
    if engine not in (LOCAL, DASK):
        raise InputError(None, f"engine: found {engine!r}, expected {LOCAL} or {DASK}")
    if engine == DASK:
        with _client(scheduler, workers) as client:
            yield _by_dask(client, jobs)
    elif workers <= 1:
        yield map(_alone, jobs)
    else:
        with in_processes(_alone, jobs, workers) as results:
            yield results


@contextmanager
def in_processes(
    work: Callable[[Item], Result], items: Iterable[Item], workers: int
) -> Iterator[Iterator[Result]]:
    """Yield the results of items in spawned processes, as they come; none outlives this process.

    joblib replaces a process that has grown, and need not say so.
    """
    parallel = joblib.Parallel(
        workers,
        return_as="generator_unordered",
        pre_dispatch=f"{AHEAD}*n_jobs",
        batch_size=1,
        initializer=end_with_parent,
        initargs=(os.getpid(),),
    )
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "A worker stopped", UserWarning)
        results = parallel(joblib.delayed(work)(item) for item in items)
        try:
            yield results
        finally:
            results.close()


def _alone(job: Job) -> list[Row]:
    """Run a job with one thread: the cores are taken by other jobs."""
    cv2.setNumThreads(1)
    return run_job(job)


def end_with_parent(parent: int) -> None:
    """Have this worker end soon after the process that started it, even if that one was killed."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.5)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def _client(scheduler: str | None, workers: int) -> Iterator[Any]:
    try:
        distributed = importlib.import_module("distributed")
    except ImportError:
        raise InputError(None, f"engine dask: found no Dask; {CLUSTER}") from None
    try:
        if scheduler is not None:
            client = distributed.Client(scheduler, timeout=SCHEDULER_PATIENCE_S)
        else:
            cluster = distributed.LocalCluster(
                n_workers=workers, threads_per_worker=1, dashboard_address=None
            )
            client = distributed.Client(cluster)
    except (OSError, ValueError, TimeoutError) as problem:
        raise InputError(None, f"scheduler {scheduler}: does not answer: {problem}") from None
    with client:
        yield client
        if scheduler is None:
            cluster.close()


def _by_dask(client: Any, jobs: Iterator[Job]) -> Iterator[list[Row]]:
    """Hand out jobs as workers get free; a worker that dies has its job made again by another."""
    distributed = importlib.import_module("distributed")
    ahead = AHEAD * max(1, len(client.scheduler_info()["workers"]))
    waiting = distributed.as_completed(with_results=True)
    for _ in range(ahead):
        _hand_out(client, jobs, waiting)
    for _, rows in waiting:
        yield rows
        _hand_out(client, jobs, waiting)


def _hand_out(client: Any, jobs: Iterator[Job], waiting: Any) -> None:
    job = next(jobs, None)
    if job is not None:
        waiting.add(client.submit(_alone, job, pure=False, retries=3))
