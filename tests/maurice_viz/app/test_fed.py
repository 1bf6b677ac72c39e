"""A filter that a program feeds frame by frame, and sessions of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

import maurice_viz as mv
from helpers.small_session import write_small_session, write_small_survey
from maurice_loaders import InputError, open_library, open_session
from maurice_mcl.config.build import make_localizer
from maurice_mcl.examples import tiny_library, tiny_session
from maurice_mcl.filter.localizer import run

IMAGE = np.full((24, 32, 3), 90, np.uint8)
FEW = mv.Filter(particles=60, start="global")


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fed")
    write_small_survey(folder)
    return write_small_session(folder)


def test_it_is_the_run_that_a_replay_of_the_drive_is_and_its_capture_too(drive, tmp_path):
    session = open_session(drive)
    place = session.info.survey
    replayed = mv.replay(drive, place, FEW).runs[0]
    with mv.Live(place, FEW, motion=session.info.motion, capture=tmp_path / "kept") as live:
        for moment in session.moments():
            frame = moment.frame
            live.update(
                frame.image, frame.motions, time_s=frame.time_s, truth=moment.truth, events=moment.events
            )
        assert live.result.score == replace(replayed.score, distance_m=live.result.score.distance_m)
        assert live.table.frame().height == replayed.score.updates
    captured = mv.replay(tmp_path / "kept" / "session.log", filter=FEW).runs[0]
    assert captured.score.error_mean_m == live.result.score.error_mean_m


def test_it_draws_into_a_stream_of_the_callers_beside_the_callers_entities(tmp_path):
    rec = rr.RecordingStream("mine")
    rec.save(tmp_path / "mine.rrd")
    with mv.Live(tiny_library(), mv.Filter(particles=50), rerun=rec) as live:
        for moment in tiny_session().moments():
            live.update(moment.frame.image, moment.frame.motions, truth=moment.truth)
            rec.log("mine/range", rr.Scalars(1.0))
    rec.flush()
    rec.disconnect()
    steps, paths = set(), set()
    for chunk in RrdReader(tmp_path / "mine.rrd").stream():
        paths.add(str(chunk.entity_path))
        batch = chunk.to_record_batch()
        if str(chunk.entity_path) == "/mine/range":
            steps |= set(batch.column("step").to_pylist())
    assert steps == set(range(1, 7))
    assert {"/filter/belief/estimate", "/mine/range", "/what_happened"} <= paths or "/what_happened" in paths


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"image": IMAGE[..., 0]}, r"image: found uint8 \(24, 32\), expected uint8 \(H, W, 3\) RGB"),
        ({"image": IMAGE / 255}, "image: found float64"),
        ({"image": "picture.png"}, "image: found str"),
        ({"motion": [0.1, 0.0]}, r"motion: found \(1, 2\), expected \(M, 3\)"),
        ({"motion": [0.1, 0.0, np.nan]}, "motion: found .*nan.*expected finite numbers"),
        ({"truth": [1.0, 2.0]}, "truth: found .*expected three finite numbers"),
        ({"time_s": np.nan}, "time_s: found nan"),
        ({"time_s": -5.0}, "time_s: found -5.0, expected a finite time from 0 on"),
        ({"readings": {"range": np.inf}}, "reading range: found inf"),
    ],
)
def test_what_cannot_be_used_is_one_line_and_nothing_is_filtered(given, said):
    live = mv.Live(tiny_library(), mv.Filter(particles=20))
    live.update(IMAGE)
    with pytest.raises(InputError, match=said) as caught:
        live.update(**{"image": IMAGE} | given)
    assert len(str(caught.value).splitlines()) == 1
    live.update(IMAGE, [0.1, 0.0, 0.0])
    assert live.table.steps.tolist() == [1, 2]


def test_before_the_first_frame_there_is_no_result_and_closing_does_no_harm():
    live = mv.Live(tiny_library())
    with pytest.raises(InputError, match="nothing was fed yet"):
        _ = live.result
    live.close()
    live.close()


def test_a_session_of_ones_own_is_replayed_compared_and_checked_frame_by_frame(drive, tmp_path):
    scores = mv.compare(tiny_session(), tiny_library(), ["color", "edges"], to=tmp_path / "own.rrd")
    assert [each.label for each in scores.runs] == ["color", "edges"]
    alone = mv.replay(tiny_session(), tiny_library(), mv.Filter("color")).runs[0]
    assert alone.score == scores.runs[0].score

    class Repeats:
        info = tiny_session().info

        def moments(self):
            first = next(tiny_session().moments())
            yield from (first, first)

    with pytest.raises(InputError, match="step: found 1, expected 2 or more"):
        mv.replay(Repeats(), tiny_library())
    with pytest.raises(InputError, match="step: found 1, expected 2 or more"):
        list(run(make_localizer(tiny_library(), particles=20), Repeats()))
    with pytest.raises(InputError, match="name one with library="):
        mv.replay(tiny_session())
    with pytest.raises(InputError, match="session: found int"):
        mv.replay(3, tiny_library())
    with pytest.raises(InputError, match="SessionWriter"):
        mv.replay(tiny_session(), tiny_library(), save_run=tmp_path / "run")
    assert open_library(open_session(drive).info.survey).size
