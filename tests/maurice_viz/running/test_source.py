"""What a source is: decided once, for every way of replaying and comparing."""

from __future__ import annotations

from pathlib import Path

import pytest

import maurice_viz as mv
from maurice_loaders.formats.registry import open_session
from maurice_mcl.values import SessionInfo
from maurice_viz.errors import OptionError
from maurice_viz.running.source import SourceKind, kind_of_source

FEW = mv.Filter(particles=30)


class Own:
    """A session of a user's own, without a moment."""

    info = SessionInfo("mine")

    def moments(self) -> list[object]:
        return []


@pytest.fixture
def saved(small_session: Path) -> Path:
    """A saved run of the session."""
    mv.replay(small_session, filter=FEW, save_run="kept")
    return Path("kept")


def test_a_source_is_of_one_kind(small_session: Path, saved: Path) -> None:
    usual, followed = mv.LiveOptions(), mv.LiveOptions(follow=True)
    assert kind_of_source(small_session, usual) is SourceKind.SESSION
    assert kind_of_source(open_session(small_session), usual) is SourceKind.SESSION
    assert kind_of_source(str(saved), usual) is SourceKind.SAVED
    assert kind_of_source(small_session, followed) is SourceKind.LIVE
    for address in ("-", "tcp://robot:5555", "ws://robot", "cmucam:///dev/ttyUSB0"):
        assert kind_of_source(address, mv.LiveOptions(patience_s=1.0)) is SourceKind.LIVE
    assert kind_of_source(Own(), usual) is SourceKind.OWN  # type: ignore[arg-type]  # its moments are a list


def test_options_of_listening_are_refused_wherever_nothing_is_listened_to(
    small_session: Path, saved: Path
) -> None:
    for source in (small_session, saved, open_session(small_session), Own()):
        for run in (mv.replay, mv.compare):
            with pytest.raises(OptionError, match="need a live source"):
                run(source, live=mv.LiveOptions(patience_s=1.0))  # type: ignore[operator]  # both take any source


def test_a_saved_run_of_an_opened_session_names_how_it_was_read(small_session: Path) -> None:
    opened = open_session(small_session, turn_scale=0.5, odometry_scale=1.1)
    kept = mv.replay(opened, filter=FEW, save_run="kept").runs[0].score
    assert mv.open_run("kept").manifest.reading == opened.options
    assert [run.same for run in mv.verify("kept")] == [True]
    assert kept != mv.replay(small_session, filter=FEW).runs[0].score


def test_particles_as_recorded_are_read_from_a_bag_alone(small_session: Path) -> None:
    for source in (open_session(small_session), Own(), "tcp://robot:5555"):
        with pytest.raises(OptionError, match="reads a bag that is finished"):
            mv.replay(source, as_recorded=True)  # type: ignore[arg-type]  # one of them is no session


def test_a_session_of_any_format_knows_its_format(small_session: Path) -> None:
    assert open_session(small_session).options.format == "session-log"
