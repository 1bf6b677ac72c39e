"""The engine: what is made does not depend on how many processes make it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from maurice_datasets.trials import engine
from maurice_datasets.trials.engine import tables_of
from maurice_mcl.examples import tiny_library, tiny_session
from maurice_mcl.scoring.batch import SeededRuns, compared_once


@pytest.fixture
def asked() -> list[SeededRuns]:
    import maurice_mcl as mcl

    moments = list(tiny_session().moments())
    runs = []
    for particles in (30, 70):
        localizer = mcl.make_localizer(tiny_library(), particles=particles).of_session(tiny_session())
        bare = [moment.without_picture for moment in moments]
        runs.append(SeededRuns(localizer, bare, compared_once(localizer.sensor, moments), range(5)))
    return runs


def test_parts_hold_every_seed_once_and_few_particles(asked: list[SeededRuns], monkeypatch) -> None:
    monkeypatch.setattr("maurice_mcl.scoring.batch.STEPPED_AT_ONCE", 100)
    for runs, sizes in zip(asked, ([3, 2], [1, 1, 1, 1, 1]), strict=True):
        parts = list(runs.parts())
        assert [len(part.seeds) for part in parts] == sizes
        assert [seed for part in parts for seed in part.seeds] == list(range(5))


@pytest.mark.parametrize("worth", [0, 10**12], ids=["in processes", "here"])
def test_tables_are_those_of_each_alone_in_the_order_asked(
    asked: list[SeededRuns], worth: int, monkeypatch
) -> None:
    monkeypatch.setattr(engine, "WORTH_PROCESSES", worth)
    monkeypatch.setattr("maurice_mcl.scoring.batch.STEPPED_AT_ONCE", 100)
    told: list[tuple[int, int]] = []
    tables = tables_of(asked, lambda done, total: told.append((done, total)), workers=2)
    assert told == [(done, 7) for done in range(1, 8)]
    for runs, some in zip(asked, tables, strict=True):
        alone = [table for seed in runs.seeds for table in replace(runs, seeds=[seed]).tables()]
        assert [table.frame().to_dicts() for table in some] == [table.frame().to_dicts() for table in alone]
