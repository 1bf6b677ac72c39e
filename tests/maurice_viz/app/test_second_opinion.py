"""The second opinion stands beside a filter wherever one runs, and saved runs keep it."""

from __future__ import annotations

import numpy as np
import polars as pl

import maurice_mcl as mcl
import maurice_viz as mv
from maurice_viz.playback import FilterRun, run_together


def test_it_changes_nothing_of_the_filter():
    session = mcl.tiny_session()
    localizer = mcl.make_localizer(mcl.tiny_library(), particles=300).of_session(session)
    run, plain = FilterRun("one", localizer, session.info.start), mcl.run(localizer, session)
    for (_, together), (_, alone) in zip(run_together([run], session.moments()), plain, strict=True):
        assert together["one"].opinion is not None
        assert alone.opinion is None
        assert np.array_equal(together["one"].weighted.poses, alone.weighted.poses)
        assert np.array_equal(together["one"].belief.log_weights, alone.belief.log_weights)


def test_a_saved_run_keeps_it(small_session, tmp_path):
    folder = tmp_path / "run"
    mv.replay(small_session, save_run=folder)
    kept = pl.read_parquet(folder / "steps" / "*.parquet")
    assert kept["not_lost"].is_between(0, 1).all()
    assert mv.traces(folder)["knows"].to_list() == kept["not_lost"].to_list()
    assert mv.verify(folder)[0].same
