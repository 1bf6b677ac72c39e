"""A recording written in blocks holds the rows of one written call by call."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from maurice_viz.entities import PHASE, SESSION, STEP
from maurice_viz.viewer import blocks
from maurice_viz.viewer.blocks import BlockRecording

STEPS = 2 * blocks.UPDATES_A_BLOCK + 6  # two blocks and a part of one


def draw(rec: rr.RecordingStream) -> None:
    """Draw what panels draw: rows on all timelines and on one, static, cleared, twice at one time."""
    rng = np.random.default_rng(1)
    rec.log("/ground", rr.Points2D([[0, 0]]), static=True)
    for step in range(1, STEPS + 1):
        for phase in range(3):
            rec.set_time(STEP, sequence=step)
            rec.set_time(SESSION, duration=step / 7)
            rec.set_time(PHASE, sequence=6 * step + phase)
            rec.log("/cloud", rr.Points2D(rng.random((step, 2)), radii=0.1 if step % 3 else None))
            if phase == 1:
                rec.log("/text", rr.TextDocument(f"step {step}"), rr.AnyValues(mark=step))
                rec.log("/error", rr.Scalars(step / 2))
                rec.log("/chart", rr.BarChart(rng.random(5)))
                rec.log("/error", rr.Scalars(step / 3))  # again at the same time: this one counts
            if phase == 2:
                rec.disable_timeline(STEP)
                rec.disable_timeline(SESSION)
                rec.log("/text", rr.TextDocument(f"phase {phase}"))
                rec.log("/cloud", rr.Points2D.from_fields(colors=[[255, 0, step]]))
        if step % 20 == 0:
            rec.log("/cloud", rr.Clear(recursive=True))
            rec.log("/picture", rr.EncodedImage(contents=bytes(range(step)), media_type="image/png"))


def rows(path: Path) -> dict[str, list[tuple]]:
    """Return the rows of each entity in the order in which they were logged: times and components."""
    found: dict[str, list[tuple]] = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        names = [name for name in batch.schema.names if "RowId" not in name and "row_id" not in name]
        ids = batch.column(next(k for k, n in enumerate(batch.schema.names) if n not in names)).to_pylist()
        columns = {name: batch.column(batch.schema.names.index(name)).to_pylist() for name in names}
        for k, row_id in enumerate(ids):
            row = {name: repr(values[k]) for name, values in columns.items() if values[k] is not None}
            found.setdefault(str(chunk.entity_path), []).append((bytes(row_id), tuple(sorted(row.items()))))
    return {
        entity: [row for _, row in sorted(listed)]
        for entity, listed in found.items()
        if not entity.startswith("/__")
    }


def written(rec: rr.RecordingStream, path: Path) -> dict[str, list[tuple]]:
    rec.set_log_time_enabled(False)
    rec.set_log_tick_enabled(False)
    rec.save(path)
    draw(rec)
    rec.flush()
    rec.disconnect()
    return rows(path)


def test_blocks_hold_the_rows_that_calls_would(tmp_path):
    call_by_call = written(rr.RecordingStream("calls"), tmp_path / "calls.rrd")
    in_blocks = written(BlockRecording("blocks", patience_s=10), tmp_path / "blocks.rrd")
    assert (
        set(in_blocks) == set(call_by_call) >= {"/cloud", "/text", "/error", "/chart", "/picture", "/ground"}
    )
    for entity in call_by_call:
        assert sorted(in_blocks[entity]) == sorted(call_by_call[entity]), entity


def test_of_rows_at_one_time_the_later_one_wins(tmp_path):
    """Rerun takes the row with the highest identifier."""
    for rec, name in ((rr.RecordingStream("calls"), "a"), (BlockRecording("blocks", patience_s=10), "b")):
        found = written(rec, tmp_path / f"{name}.rrd")
        latest = {dict(row)[STEP]: dict(row) for row in found["/error"]}
        scalars = {
            step: value for step, row in latest.items() for key, value in row.items() if "Scalars" in key
        }
        assert scalars == {str(step): str([step / 3]) for step in range(1, STEPS + 1)}
        for step in range(1, STEPS + 1):  # also where the later one is on fewer timelines
            at = [row for row in map(dict, found["/cloud"]) if row.get(PHASE) == str(6 * step + 2)]
            drawn = [row for row in at if not any("Clear" in key for key in row)]
            is_last = [any("colors" in key for key in row) for row in drawn]
            assert is_last == [False, True]
        clears = [k for k, row in enumerate(found["/cloud"]) if any("Clear" in name for name, _ in row)]
        assert len(clears) == STEPS // 20
        assert clears[-1] > 3 * 60


def test_a_block_ends_when_it_is_large(tmp_path, monkeypatch):
    monkeypatch.setattr(blocks, "BYTES_A_BLOCK", 1000)
    rec, sent = BlockRecording("large", patience_s=10), []
    rec.save(tmp_path / "a.rrd")
    monkeypatch.setattr(rec, "send_rows", lambda: sent.append(rec._bytes) or rec._rows.clear())
    for step in range(1, 5):
        rec.set_time(STEP, sequence=step)
        rec.log("/a", rr.EncodedImage(contents=bytes(2000), media_type="image/png"))
    assert len(sent) == 3


def test_what_waits_is_written_when_the_file_is_closed(tmp_path):
    rec = BlockRecording("short", patience_s=10)
    rec.save(tmp_path / "a.rrd")
    rec.set_time(STEP, sequence=1)
    rec.log("/a", rr.Scalars(1.5))
    rec.disconnect()
    assert len(rows(tmp_path / "a.rrd")["/a"]) == 1


def test_an_error_of_the_disk_while_drawing_waits_for_the_end(tmp_path, monkeypatch):
    rec = BlockRecording("gone", patience_s=10)
    rec.save(tmp_path / "a.rrd")

    def fail(self: rr.RecordingStream, **how: float) -> None:
        raise RuntimeError("the disk is gone")

    monkeypatch.setattr(rr.RecordingStream, "flush", fail)
    for step in range(blocks.UPDATES_A_BLOCK + 2):
        rec.set_time(STEP, sequence=step)
        rec.log("/a", rr.Scalars(1.5))
    with pytest.raises(RuntimeError, match="the disk is gone"):
        rec.flush()
