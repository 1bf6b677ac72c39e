"""Damaged saved runs are one line each, and what differs from a run is named."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from maurice_loaders.errors import InputError
from maurice_loaders.runs.store import first_difference, same
from maurice_loaders.runs.writer import rows_of

from ..conftest import Save, edit, opened

INJECTING = {"recovery.strategy": "always", "recovery.share": 0.1}


def tamper(folder: Path, table: str, part: str, column: str, change: Callable[[pl.Expr], pl.Expr]) -> None:
    file = folder / table / part
    frame = pl.read_parquet(file)
    frame.with_columns(change(pl.col(column)).cast(frame.schema[column])).write_parquet(file)


def test_equal_steps_have_no_difference(save_run: Save) -> None:
    folder, played = save_run(**INJECTING)
    for stored, update in zip(opened(folder).steps(), played, strict=True):
        assert first_difference(stored, rows_of(*update)) is None


@pytest.mark.parametrize(
    ("table", "column", "said"),
    [
        ("particles", "heading_rad", "particles.heading_rad of particle 0"),
        ("steps", "log_evidence", "log_evidence"),
        ("steps", "estimate_sd_x_m", "estimate_sd_x_m"),
        ("renewed", "y_m", "renewed.y_m of particle 0"),
    ],
)
def test_the_first_different_field_is_named_down_to_one_bit(
    save_run: Save, table: str, column: str, said: str
) -> None:
    folder, played = save_run()
    width = np.float64 if table == "steps" else np.float32

    def next_number(values: pl.Expr) -> pl.Expr:
        return values.map_batches(
            lambda s: pl.Series(np.nextafter(s.to_numpy(), width(np.inf))), return_dtype=pl.self_dtype()
        )

    tamper(folder, table, "00000001.parquet", column, next_number)
    stored = next(opened(folder).steps())
    found = first_difference(stored, rows_of(*played[0]))
    assert found is not None
    assert (found.step, found.field) == (1, said)


def test_zero_and_minus_zero_are_not_the_same() -> None:
    assert not same(0.0, -0.0)
    assert same(float("nan"), float("nan"))
    assert not same([1.0], [1.0, 2.0])
    assert not same(1, 1.0)


def cut(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-100])


def tampered(table: str, column: str, more: int | None) -> Callable[[Path], None]:
    """Add to a column, or empty it."""

    def change(values: pl.Expr) -> pl.Expr:
        return pl.when(False).then(values) if more is None else values + more

    return lambda folder: tamper(folder, table, "00000001.parquet", column, change)


DAMAGE: dict[str, tuple[Callable[[Path], object], str]] = {
    "no manifest": (lambda f: (f / "manifest.json").unlink(), "found no manifest.json"),
    "broken manifest": (lambda f: cut(f / "manifest.json"), "is no manifest"),
    "deep manifest": (lambda f: (f / "manifest.json").write_text("[" * 100_000), "nested too deeply"),
    "other format": (lambda f: edit(f / "manifest.json", format="x"), "expected 'maurice-run'"),
    "unknown version": (lambda f: edit(f / "manifest.json", version=99), "found version 99"),
    "no seed": (lambda f: edit(f / "manifest.json", seed=None), "found seed nothing"),
    "bad start": (lambda f: edit(f / "manifest.json", start=[1, 2]), "found start [1, 2]"),
    "bad state": (lambda f: edit(f / "manifest.json", state="fine"), "found state 'fine'"),
    "bad source": (lambda f: edit(f / "manifest.json", session={}), "session.path"),
    "bad label": (lambda f: edit(f / "manifest.json", label="../x"), "label"),
    "changed configuration": (lambda f: cut(f / "configuration.toml"), "was changed after"),
    "no configuration": (lambda f: (f / "configuration.toml").unlink(), "is missing"),
    "cut steps": (lambda f: cut(f / "steps/00000001.parquet"), "damaged Parquet"),
    "cut particles": (lambda f: cut(f / "particles/00000001.parquet"), "damaged Parquet"),
    "no renewed": (lambda f: (f / "renewed/00000001.parquet").unlink(), "is missing"),
    "no steps": (lambda f: (f / "steps/00000001.parquet").unlink(), "found 0 steps, expected the 14"),
    "fewer particles": (tampered("steps", "particles", 1), "found 50 particles at step 1, expected 51"),
    "steps out of order": (tampered("steps", "step", 1), "found step 2, expected step 1"),
    "parent out of reach": (tampered("renewed", "parent", 10**9), "parent that is no particle"),
    "empty values": (tampered("particles", "x_m", None), "found no value of x_m"),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_damage_is_one_line(save_run: Save, name: str) -> None:
    damage, said = DAMAGE[name]
    folder, _ = save_run()
    damage(folder)
    with pytest.raises(InputError, match=said.replace("[", r"\[")) as caught:
        list(opened(folder).steps())
    assert "\n" not in str(caught.value)
