"""Saved runs on disk: what is read back is what was written, damage is one line, differences are named."""

from __future__ import annotations

import errno
import gc
import os
import re
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from polars.testing import assert_frame_equal

from maurice_loaders.errors import InputError
from maurice_loaders.libraries.files import hash_file
from maurice_loaders.runs import writer as writing
from maurice_loaders.runs.manifest import (
    CONFIGURATION,
    RunManifest,
    library_hash,
    read_manifest,
    source_of,
    write_manifest,
)
from maurice_loaders.runs.store import first_difference, open_runs, same
from maurice_mcl.values.library import Library

from ..conftest import Save, edit, opened

EVERYTHING = {
    "recovery.strategy": "always",
    "recovery.share": 0.1,
    "resampling.roughening": 0.2,
    "resampling.adaptive": True,
    "resampling.kld.least": 20,
}

THRESHOLD = {"recovery.strategy": "threshold", "recovery.threshold.settle": 2}


def assert_same(a: Any, b: Any, where: str = "") -> None:
    """Compare two values to the last bit, whatever dataclasses they are made of."""
    if is_dataclass(a):
        for field in fields(a):
            if field.name != "took_s":
                assert_same(getattr(a, field.name), getattr(b, field.name), f"{where}.{field.name}")
    elif isinstance(a, np.ndarray):
        assert (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes()), where
    elif isinstance(a, tuple):
        for k, (x, y) in enumerate(zip(a, b, strict=True)):
            assert_same(x, y, f"{where}[{k}]")
    elif isinstance(a, float):
        assert same(a, b), where
    elif not isinstance(a, dict):
        assert a == b, where


@pytest.mark.parametrize(
    "settings",
    [{}, EVERYTHING, {"resampling.when": "effective"}, {"recovery.strategy": "mixture"}, THRESHOLD],
    ids=[
        "default",
        "injected, roughened, of changing number",
        "not always resampled",
        "dual draws",
        "threshold",
    ],
)
def test_what_is_read_is_what_was_written_to_the_last_bit(save_run: Save, settings: dict[str, Any]) -> None:
    folder, played = save_run(**settings)
    if settings == EVERYTHING:  # these settings are what they are for
        assert any(r.injected is not None for _, r in played)
        assert len({r.belief.size for _, r in played}) > 1
    if settings == THRESHOLD:
        assert {r.recovery_test is None for _, r in played} == {True, False}
    if "resampling.when" in settings:
        assert {r.parents is None for _, r in played} == {True, False}
    saved = opened(folder)
    origin = np.array(saved.manifest.origin_m)
    for rows, (moment, record) in zip(saved.steps(), played, strict=True):
        again = writing.moment_of(rows, moment.frame.image)
        assert_same(again, moment)
        found = writing.record_of(rows, again.frame, record.sighting, origin, saved.manifest.radii)
        assert_same(found, record)
        assert sum(found.took_s.values()) == sum(record.took_s.values())


def test_best_entries_and_evidences_can_be_read_without_the_project(save_run: Save) -> None:
    folder, played = save_run()
    steps = pl.scan_parquet(folder / "steps" / "*.parquet").collect()
    _, record = played[3]
    comparison = record.sighting.comparison
    assert steps["best_entries"][3].to_list() == comparison.best(writing.BEST).tolist()
    assert steps["best_quality"][3].to_list() == comparison.quality[comparison.best(writing.BEST)].tolist()
    assert [steps[f"evidence_{c}"][3] for c in ("color", "edges")] == record.channel_evidence.tolist()
    cloud = pl.scan_parquet(folder / "particles" / "*.parquet").filter(pl.col("step") == 4).collect()
    np.testing.assert_array_equal(cloud["x_m"].to_numpy(), record.weighted.poses[:, 0])
    np.testing.assert_allclose(np.exp(cloud["log_weight"].to_numpy()).sum(), 1)
    moment, record = played[0]
    rows = writing.rows_of(replace(moment, truth=None), record)
    assert writing.moment_of(rows, moment.frame.image).truth is None


def test_a_run_whose_configuration_lacks_a_key_is_refused(save_run: Save) -> None:
    folder, _ = save_run()
    assert opened(folder).configuration.parameters.guided_motion.share == 0.5
    file = next(folder.rglob(CONFIGURATION))
    text = file.read_text(encoding="utf-8")
    older = re.sub(r"\[guided_motion\]\nshare = 0\.5\n", "", text)
    assert older != text
    file.write_text(older, encoding="utf-8")
    manifest = read_manifest(file.parent)
    write_manifest(file.parent, replace(manifest, configuration_sha256=hash_file(file)))
    with pytest.raises(InputError, match=r"found no guided_motion\.share, .*replay the session again"):
        opened(folder)


def test_the_manifest_reads_back_and_says_how_far_it_got(save_run: Save) -> None:
    folder, played = save_run(close="stopped")
    manifest = read_manifest(folder)
    assert (manifest.state, manifest.steps) == ("stopped", len(played))
    write_manifest(folder, manifest)
    assert read_manifest(folder) == manifest


def test_a_run_that_was_never_closed_has_the_parts_that_were_full(save_run: Save) -> None:
    folder, played = save_run(times=4, close=None)
    assert len(played) > 2 * writing.PART_STEPS
    saved = opened(folder)
    assert saved.manifest.state == "writing"
    assert (
        sum(1 for _ in saved.steps())
        == len(played) // writing.PART_STEPS * writing.PART_STEPS
        == 2 * writing.PART_STEPS
    )
    part = folder / "particles" / "00000051.parquet"
    part.write_bytes((folder / "particles" / "00000026.parquet").read_bytes())  # its steps never came
    (folder / "steps" / ".00000051.parquet.part").write_bytes(b"PAR1")
    assert sum(1 for _ in opened(folder).steps()) == 2 * writing.PART_STEPS


@pytest.fixture
def frozen() -> Iterator[None]:
    """Leave out of counting what is there already: it is much, and looking through it slow."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


def held() -> int:
    return sum(isinstance(thing, writing.StepRows) for thing in gc.get_objects())


@pytest.mark.usefixtures("frozen")
def test_memory_does_not_grow_with_the_session(
    save_run: Save, run_library: Library, small_session: Path
) -> None:
    folder, played = save_run(times=8)
    toml = (folder / "configuration.toml").read_text()
    writer = writing.RunWriter(folder.with_name("long"), read_manifest(folder), toml, run_library.arena)
    before = held()
    most = 0
    for moment, record in played:
        writer.add(moment, record)
        most = max(most, held() - before)
    writer.close("complete")
    assert 0 < most <= writing.PART_STEPS
    assert held() == before
    assert max(held() - before for _ in opened(folder).steps()) <= 2  # this one and the next


def test_a_folder_is_replaced_only_with_force_and_only_when_it_is_a_run(
    save_run: Save, run_library: Library, tmp_path: Path
) -> None:
    folder, _ = save_run()
    manifest = read_manifest(folder)
    with pytest.raises(InputError, match="--force"):
        writing.RunWriter(folder, manifest, "", run_library.arena)
    assert read_manifest(folder) == manifest
    writing.RunWriter(folder, manifest, "", run_library.arena, force=True)
    assert list(folder.rglob("*.parquet")) == []
    for name, text in (("notes.txt", "mine"), ("manifest.json", '{"format": "maurice-library"}')):
        other = tmp_path / name.split(".")[0]
        other.mkdir()
        (other / name).write_text(text)
        with pytest.raises(InputError, match="remove it yourself"):
            writing.RunWriter(other, manifest, "", run_library.arena, force=True)
        assert (other / name).read_text() == text


def test_a_run_that_cannot_be_begun_leaves_no_folder(
    save_run: Save, run_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A folder without a manifest would not be replaced with --force."""
    folder, _ = save_run()
    manifest = read_manifest(folder)

    def full(folder: Path, manifest: RunManifest) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(folder))

    monkeypatch.setattr(writing, "write_manifest", full)
    for target in (tmp_path / "new", folder):
        with pytest.raises(InputError, match="cannot be written: No space left"):
            writing.RunWriter(target, manifest, "", run_library.arena, force=True)
    assert read_manifest(folder) == manifest
    assert [file for file in tmp_path.iterdir() if "new" in file.name] == []


def test_the_runs_of_a_comparison_are_opened_in_order(save_run: Save, tmp_path: Path) -> None:
    folder, _ = save_run()
    both = tmp_path / "both"
    writing.begin_comparison(both, ["zebra", "ant"])
    for name in ("zebra", "ant"):
        folder.rename(both / name) if name == "ant" else save_run()[0].rename(both / name)
        save_run()
    assert [run.folder.name for run in open_runs(both)] == ["zebra", "ant"]
    edit(both / "manifest.json", runs=["../run"])
    with pytest.raises(InputError, match="list of runs"):
        open_runs(both)


def test_a_source_is_found_where_it_was_or_beside_the_run(tmp_path: Path) -> None:
    (tmp_path / "a" / "run").mkdir(parents=True)
    (tmp_path / "a" / "session.log").write_text("x")
    source = source_of(tmp_path / "a" / "session.log", tmp_path / "a" / "run")
    assert source.find(tmp_path / "a" / "run") == tmp_path / "a" / "session.log"
    (tmp_path / "a").rename(tmp_path / "b")
    found = source.find(tmp_path / "b" / "run")
    assert found is not None
    assert found.resolve() == tmp_path / "b" / "session.log"
    found.unlink()
    assert source.find(tmp_path / "b" / "run") is None


def test_the_library_hash_follows_what_the_filter_uses(run_library: Library) -> None:
    moved = replace(run_library, poses=run_library.poses + 1e-12)
    renamed = replace(run_library, name="other", pictures=(None,) * run_library.size)
    color = library_hash(run_library, ["color"])
    assert library_hash(renamed, ["color"]) == color
    assert library_hash(moved, ["color"]) != color
    assert library_hash(run_library, ["edges"]) != color


def frames(folder: Path) -> Iterator[pl.DataFrame]:
    for table in ("steps", "particles", "renewed"):
        yield pl.scan_parquet(folder / table / "*.parquet").collect()


def test_parts_do_not_show_in_what_is_read_and_every_column_is_documented(save_run: Save) -> None:
    folder, played = save_run(times=3)
    steps, particles, renewed = frames(folder)
    assert steps["step"].to_list() == list(range(1, len(played) + 1))
    assert_frame_equal(particles, pl.concat(writing.rows_of(*update).particles for update in played))
    assert_frame_equal(renewed, pl.concat(writing.rows_of(*update).renewed for update in played))
    text = (Path(__file__).parents[3] / "docs" / "saved-runs.md").read_text(encoding="utf-8")
    for column in [*writing.steps_schema(["<channel>"]), *writing.PARTICLES, *writing.RENEWED]:
        assert f"`{column}`" in text, column


INJECTING = {"recovery.strategy": "always", "recovery.share": 0.1}


def tamper(folder: Path, table: str, part: str, column: str, change: Callable[[pl.Expr], pl.Expr]) -> None:
    file = folder / table / part
    frame = pl.read_parquet(file)
    frame.with_columns(change(pl.col(column)).cast(frame.schema[column])).write_parquet(file)


def test_equal_steps_have_no_difference(save_run: Save) -> None:
    folder, played = save_run(**INJECTING)
    for stored, update in zip(opened(folder).steps(), played, strict=True):
        assert first_difference(stored, writing.rows_of(*update)) is None


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
    found = first_difference(stored, writing.rows_of(*played[0]))
    assert found is not None
    assert (found.step, found.field) == (1, said)


def test_zero_and_minus_zero_are_not_the_same() -> None:
    assert not same(0.0, -0.0)
    assert same(float("nan"), float("nan"))
    assert not same([1.0], [1.0, 2.0])
    assert not same(1, 1.0)


def cut_end(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-100])


def tampered(table: str, column: str, more: int | None) -> Callable[[Path], None]:
    """Add to a column, or empty it."""

    def change(values: pl.Expr) -> pl.Expr:
        return pl.when(False).then(values) if more is None else values + more

    return lambda folder: tamper(folder, table, "00000001.parquet", column, change)


DAMAGE: dict[str, tuple[Callable[[Path], object], str]] = {
    "no manifest": (lambda f: (f / "manifest.json").unlink(), "found a folder with configuration.toml"),
    "broken manifest": (lambda f: cut_end(f / "manifest.json"), "is no manifest"),
    "deep manifest": (lambda f: (f / "manifest.json").write_text("[" * 100_000), "nested too deeply"),
    "other format": (lambda f: edit(f / "manifest.json", format="x"), "expected 'maurice-run'"),
    "unknown version": (lambda f: edit(f / "manifest.json", version=99), "found version 99"),
    "no seed": (lambda f: edit(f / "manifest.json", seed=None), "found seed nothing"),
    "bad start": (lambda f: edit(f / "manifest.json", start=[1, 2]), "found start [1, 2]"),
    "bad state": (lambda f: edit(f / "manifest.json", state="fine"), "found state 'fine'"),
    "bad source": (lambda f: edit(f / "manifest.json", session={}), "session.path"),
    "bad label": (lambda f: edit(f / "manifest.json", label="../x"), "label"),
    "changed configuration": (lambda f: cut_end(f / "configuration.toml"), "was changed after"),
    "no configuration": (lambda f: (f / "configuration.toml").unlink(), "is missing"),
    "cut_end steps": (lambda f: cut_end(f / "steps/00000001.parquet"), "damaged Parquet"),
    "cut_end particles": (lambda f: cut_end(f / "particles/00000001.parquet"), "damaged Parquet"),
    "no renewed": (lambda f: (f / "renewed/00000001.parquet").unlink(), "is missing"),
    "no steps": (lambda f: (f / "steps/00000001.parquet").unlink(), "found 0 steps, expected the 14"),
    "fewer particles": (tampered("steps", "particles", 1), "found 50 particles at step 1, expected 51"),
    "steps out of order": (tampered("steps", "step", 1), "found step 2, expected step 1"),
    "parent out of reach": (tampered("renewed", "parent", 10**9), "parent that is no particle"),
    "empty values": (
        tampered("particles", "x_m", None),
        "found x_m nothing in row 1 (step 1), expected a value",
    ),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_damage_is_one_line(save_run: Save, name: str) -> None:
    damage, said = DAMAGE[name]
    folder, _ = save_run()
    damage(folder)
    with pytest.raises(InputError, match=re.escape(said)) as caught:
        list(opened(folder).steps())
    assert "\n" not in str(caught.value)
