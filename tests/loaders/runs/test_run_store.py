"""Saved runs on disk: what is read back is what was written, and damage is one line."""

import gc
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from polars.testing import assert_frame_equal

from maurice_loaders.errors import InputError
from maurice_loaders.runs.manifest import library_hash, put, read_manifest, source_of, write_manifest
from maurice_loaders.runs.store import open_runs, same
from maurice_loaders.runs.writer import (
    BEST,
    PART_STEPS,
    PARTICLES,
    RENEWED,
    RunWriter,
    StepRows,
    begin_comparison,
    moment_of,
    record_of,
    rows_of,
    steps_schema,
)
from maurice_mcl.library import Library

from ..conftest import Save, edit, opened

EVERYTHING = {
    "recovery.strategy": "always",
    "recovery.share": 0.1,
    "resampling.roughening": 0.2,
    "resampling.adaptive": True,
    "resampling.kld.least": 20,
}


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
    [{}, EVERYTHING, {"resampling.when": "effective"}, {"recovery.strategy": "mixture"}],
    ids=["default", "injected, roughened, of changing number", "not always resampled", "dual draws"],
)
def test_what_is_read_is_what_was_written_to_the_last_bit(save_run: Save, settings: dict[str, Any]) -> None:
    folder, played = save_run(**settings)
    if settings == EVERYTHING:  # these settings are what they are for
        assert any(r.injected is not None for _, r in played)
        assert len({r.belief.size for _, r in played}) > 1
    if "resampling.when" in settings:
        assert {r.parents is None for _, r in played} == {True, False}
    saved = opened(folder)
    origin = np.array(saved.manifest.origin_m)
    for rows, (moment, record) in zip(saved.steps(), played, strict=True):
        again = moment_of(rows, moment.frame.image)
        assert_same(again, moment)
        found = record_of(rows, again.frame, record.sighting, origin)
        assert_same(found, record)
        assert sum(found.took_s.values()) == sum(record.took_s.values())


def test_best_entries_and_evidences_can_be_read_without_the_project(save_run: Save) -> None:
    folder, played = save_run()
    steps = pl.scan_parquet(folder / "steps" / "*.parquet").collect()
    _, record = played[3]
    comparison = record.sighting.comparison
    assert steps["best_entries"][3].to_list() == comparison.best(BEST).tolist()
    assert steps["best_quality"][3].to_list() == comparison.quality[comparison.best(BEST)].tolist()
    assert [steps[f"evidence_{c}"][3] for c in ("color", "edges")] == record.channel_evidence.tolist()
    cloud = pl.scan_parquet(folder / "particles" / "*.parquet").filter(pl.col("step") == 4).collect()
    np.testing.assert_array_equal(cloud["x_m"].to_numpy(), record.weighted.poses[:, 0])
    np.testing.assert_allclose(np.exp(cloud["log_weight"].to_numpy()).sum(), 1)
    moment, record = played[0]
    rows = rows_of(replace(moment, truth=None), record)
    assert moment_of(rows, moment.frame.image).truth is None


def test_the_manifest_reads_back_and_says_how_far_it_got(save_run: Save) -> None:
    folder, played = save_run(close="stopped")
    manifest = read_manifest(folder)
    assert (manifest.state, manifest.steps) == ("stopped", len(played))
    write_manifest(folder, manifest)
    assert read_manifest(folder) == manifest


def test_a_run_that_was_never_closed_has_the_parts_that_were_full(save_run: Save) -> None:
    folder, played = save_run(times=4, close=None)
    assert len(played) > 2 * PART_STEPS
    saved = opened(folder)
    assert saved.manifest.state == "writing"
    assert sum(1 for _ in saved.steps()) == len(played) // PART_STEPS * PART_STEPS == 2 * PART_STEPS
    part = folder / "particles" / "00000051.parquet"
    part.write_bytes((folder / "particles" / "00000026.parquet").read_bytes())  # its steps never came
    (folder / "steps" / ".00000051.parquet.part").write_bytes(b"PAR1")
    assert sum(1 for _ in opened(folder).steps()) == 2 * PART_STEPS


@pytest.fixture
def frozen() -> Iterator[None]:
    """Leave out of counting what is there already: it is much, and looking through it slow."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


def held() -> int:
    return sum(isinstance(thing, StepRows) for thing in gc.get_objects())


@pytest.mark.usefixtures("frozen")
def test_memory_does_not_grow_with_the_session(
    save_run: Save, run_library: Library, small_session: Path
) -> None:
    folder, played = save_run(times=8)
    toml = (folder / "configuration.toml").read_text()
    writer = RunWriter(folder.with_name("long"), read_manifest(folder), toml, run_library.arena)
    before = held()
    most = 0
    for moment, record in played:
        writer.add(moment, record)
        most = max(most, held() - before)
    writer.close("complete")
    assert 0 < most <= PART_STEPS
    assert held() == before
    assert max(held() - before for _ in opened(folder).steps()) <= 2  # this one and the next


def test_a_folder_is_replaced_only_with_force_and_only_when_it_is_a_run(
    save_run: Save, run_library: Library, tmp_path: Path
) -> None:
    folder, _ = save_run()
    manifest = read_manifest(folder)
    with pytest.raises(InputError, match="--force"):
        RunWriter(folder, manifest, "", run_library.arena)
    assert read_manifest(folder) == manifest
    RunWriter(folder, manifest, "", run_library.arena, force=True)
    assert list(folder.rglob("*.parquet")) == []
    for name, text in (("notes.txt", "mine"), ("manifest.json", '{"format": "maurice-library"}')):
        other = tmp_path / name.split(".")[0]
        other.mkdir()
        (other / name).write_text(text)
        with pytest.raises(InputError, match="remove it yourself"):
            RunWriter(other, manifest, "", run_library.arena, force=True)
        assert (other / name).read_text() == text


def test_the_runs_of_a_comparison_are_opened_in_order(save_run: Save, tmp_path: Path) -> None:
    folder, _ = save_run()
    both = tmp_path / "both"
    begin_comparison(both, ["zebra", "ant"])
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


def test_put_leaves_the_old_file_when_writing_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "x.json"
    put(file, b"old")

    def full(self: Path, data: bytes) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError, match="No space"):
        put(file, b"new")
    assert file.read_bytes() == b"old"


def frames(folder: Path) -> Iterator[pl.DataFrame]:
    for table in ("steps", "particles", "renewed"):
        yield pl.scan_parquet(folder / table / "*.parquet").collect()


def test_parts_do_not_show_in_what_is_read(save_run: Save) -> None:
    folder, played = save_run(times=3)
    steps, particles, renewed = frames(folder)
    assert steps["step"].to_list() == list(range(1, len(played) + 1))
    assert_frame_equal(particles, pl.concat(rows_of(*update).particles for update in played))
    assert_frame_equal(renewed, pl.concat(rows_of(*update).renewed for update in played))


def test_every_column_is_documented() -> None:
    text = (Path(__file__).parents[3] / "docs" / "saved-runs.md").read_text(encoding="utf-8")
    for column in [*steps_schema(["<channel>"]), *PARTICLES, *RENEWED]:
        assert f"`{column}`" in text, column
