"""Live sources as sessions: over real sockets, from a real file, through scripted channels."""

from __future__ import annotations

import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from functools import partial
from itertools import islice
from pathlib import Path

import pytest

from helpers.live_peers import HEADER, free_address, line, log, peer, says, says_nothing_until, update
from helpers.recordings import assert_same_drive
from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import open_session
from maurice_loaders.live import source as live_source_module
from maurice_loaders.live.session import ListenOptions, LiveRecorder, LiveSession
from maurice_loaders.live.source import LineCutter, LiveSource, Patience, is_live, live_source
from maurice_loaders.reading.observations import Gate
from maurice_mcl.values.session import Moment

SOON, LATER = Patience(0.3), Patience(20.0)


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_source_module, "POLL_S", 0.02)
    monkeypatch.setattr(live_source_module, "LONGEST_WAIT_S", 0.1)
    monkeypatch.setattr(live_source_module, "SENSE_S", 0.3)


def gone_through(
    source: LiveSource, folder: Path | None = None, patience: Patience = SOON, count: int | None = None
) -> tuple[LiveSession, list[Moment]]:
    """Go through a source until its end, or to so many updates."""
    recorder = None if folder is None else LiveRecorder(folder)
    with LiveSession(source, ListenOptions(keep_up=False, patience=patience), recorder) as session:
        return session, list(islice(session.moments(), count))


def times(moments: list[Moment]) -> list[float]:
    return [round(moment.frame.time_s, 6) for moment in moments]


def test_what_a_socket_says_is_a_session_and_is_recorded_byte_for_byte(tmp_path: Path) -> None:
    said = log(range(20)) + line(20, event="bump", note="kept too")
    with peer(says(said)) as address:
        session, moments = gone_through(live_source(address), tmp_path)
    assert times(moments) == list(range(20))
    assert [moment.frame.step for moment in moments] == list(range(1, 21))
    assert all(moment.frame.motions.tolist() == [[0.1, 0.0, 0.0]] for moment in moments)
    recorded = (tmp_path / "session.log").read_bytes()
    assert recorded.split(b"\n", 1)[1] == said.split(b"\n", 1)[1]
    assert open_session(tmp_path / "session.log").info.name == "live"
    assert session.problem_count == 0


def test_portions_of_any_size_are_put_together_and_a_reset_connection_is_survived() -> None:
    def dribble(connection: socket.socket) -> None:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        data = log(range(3))
        for at in range(0, len(data), 37):
            connection.sendall(data[at : at + 37])

    with peer(dribble) as address:
        assert times(gone_through(live_source(address))[1]) == [0, 1, 2]

    def reset(connection: socket.socket) -> None:
        connection.sendall(log(range(2)))
        time.sleep(0.2)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))

    with peer(reset, says(log([4]))) as address:
        assert times(gone_through(live_source(address), patience=LATER, count=3)[1]) == [0, 1, 4]


def test_a_source_that_is_restarted_loses_only_what_it_never_sent(tmp_path: Path) -> None:
    cut = update(7)[:-30]
    with peer(says(log(range(5)) + cut), says(b""), says(log(range(3))), says(log([2, 3]))) as address:
        session, moments = gone_through(live_source(address), tmp_path, LATER, 10)
    # The clock that began anew goes on 2 s behind the last time: 7 is what the cut update's odometry said.
    assert times(moments) == [0, 1, 2, 3, 4, 9, 10, 11, 11, 12]
    assert [len(moment.frame.motions) for moment in moments] == [1, 1, 1, 1, 1, 2, 1, 1, 1, 1]
    assert [bool(m.events) for m in moments] == [False] * 5 + [True, False, False, True, False]
    assert moments[5].events[0].startswith("gap: the source was away for")
    assert session.counts.gaps == 2
    assert any("cut off" in warning for warning in session.warnings)
    again = list(open_session(tmp_path / "session.log").moments())
    assert times(again) == times(moments)
    assert [m.events for m in again] == [m.events for m in moments]


def test_broken_lines_are_counted_and_left_out_of_the_recording(tmp_path: Path) -> None:
    parts = [
        HEADER.encode(),
        b"nonsense",
        b"",
        update(1).strip(),
        b"\xff\xfe",
        b'{"t": 0.5, "event": "early"}',
    ]
    outside = b'{"t": 2, "image": "../outside.jpg"}'
    parts += [outside, b'{"t": 2, "image": {"base64": "AAAA"}}', update(3).strip()]
    with peer(says(b"\n".join(parts) + b"\n")) as address:
        session, moments = gone_through(live_source(address), tmp_path)
    assert times(moments) == [0, 2]
    assert session.counts.broken == 4
    assert session.problem_count == 5  # and a picture that cannot be decoded
    assert any("expected it inline" in str(problem) for problem in session.problems)
    assert all(str(problem).startswith(address) for problem in session.problems)
    assert b"nonsense" not in (tmp_path / "session.log").read_bytes()


HOSTILE: dict[str, tuple[bytes, str]] = {
    "another protocol": (b"HTTP/1.1 400 Bad Request\r\n\r\n", "found broken JSON"),
    "binary": (b"\0\1\2\n" * 100, "found binary data"),
    "another JSON": (b'{"hello": 1}\n', "found format nothing"),
    "a survey": (HEADER.replace('"session", ', '"survey", ', 1).encode() + b"\n", "found a survey log"),
    "a newer version": (HEADER.replace("1", "9").encode() + b"\n", "found format version 9"),
    "deep JSON": (b"[" * 100_000 + b"\n", "found JSON nested too deeply"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_peer_that_is_no_robot_is_told_in_one_line_at_once(name: str, tmp_path: Path) -> None:
    said, expected = HOSTILE[name]
    begun = time.monotonic()
    with peer(says(said)) as address, pytest.raises(InputError) as told:
        gone_through(live_source(address), tmp_path, Patience(60.0))
    assert expected in str(told.value)
    assert str(told.value).startswith(f"{address}:1: ")
    assert "\n" not in str(told.value)
    assert time.monotonic() - begun < 20
    assert list(tmp_path.iterdir()) == []  # nothing is written before there is a header


def test_an_endless_line_is_hung_up_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_source_module, "LineCutter", partial(LineCutter, 1_000_000))
    sent = [0]

    def endless(connection: socket.socket) -> None:
        while True:
            connection.sendall(b"x" * 65536)
            sent[0] += 65536

    with peer(endless) as address, pytest.raises(InputError, match="sent a line of more than"):
        gone_through(live_source(address))
    assert sent[0] < 30_000_000


def test_a_peer_that_says_nothing_is_hung_up_on_and_told() -> None:
    over = threading.Event()
    with peer(says_nothing_until(over)) as address:
        with pytest.raises(InputError, match="sent nothing valid for"):
            gone_through(live_source(address))
        over.set()


def test_a_peer_that_turns_bad_is_hung_up_on_and_what_was_good_is_kept(tmp_path: Path) -> None:
    with peer(says(log(range(3)) + b"{}\n" * 500), says(log([5]))) as address:
        session, moments = gone_through(live_source(address), tmp_path, LATER, 4)
    assert times(moments) == [0, 1, 2, 5]
    assert 100 <= session.counts.broken <= 500


def test_nobody_there_is_told_with_the_reason() -> None:
    address = free_address()
    with pytest.raises(InputError, match=f"^{address}: found no session log there .*refused"):
        gone_through(live_source(address))


def test_a_robot_that_is_slow_to_begin_is_waited_for() -> None:
    address = free_address()
    port = address.rpartition(":")[2]
    script = f"""
import socket, sys, time
time.sleep(0.5)
with socket.create_server(("127.0.0.1", {port})) as server:
    server.accept()[0].sendall(sys.stdin.buffer.read())
"""
    robot = subprocess.Popen([sys.executable, "-c", script], stdin=subprocess.PIPE)
    assert robot.stdin is not None
    robot.stdin.write(log(range(4)))
    robot.stdin.close()
    moments = gone_through(live_source(address), patience=LATER, count=4)[1]
    robot.wait(20)
    assert times(moments) == [0, 1, 2, 3]


WRITER = """
import sys, time
with open(sys.argv[1], "ab", buffering=0) as log:
    for part in sys.stdin.buffer.read().split(b"#"):
        log.write(part)
        time.sleep(0.05)
print("done", flush=True)
time.sleep(60)
"""


def write_and_kill(path: Path, *parts: bytes) -> None:
    """Write to a file from another process, which is then killed with kill -9."""
    pipe = subprocess.PIPE
    writer = subprocess.Popen([sys.executable, "-c", WRITER, path], stdin=pipe, stdout=pipe)
    assert writer.stdin is not None
    assert writer.stdout is not None
    writer.stdin.write(b"#".join(parts))
    writer.stdin.close()
    assert writer.stdout.readline() == b"done\n"
    writer.kill()
    writer.wait()
    writer.stdout.close()


def test_a_growing_file_is_followed_past_the_death_of_its_writer(tmp_path: Path) -> None:
    path, got = tmp_path / "growing.log", list[Moment]()
    patience = Patience(5.0, silent_s=1.0)
    session = LiveSession(
        live_source(path), ListenOptions(keep_up=False, patience=patience), LiveRecorder(tmp_path / "r")
    )

    def follow() -> None:
        with session:
            got.extend(session.moments())

    follower = threading.Thread(target=follow)
    follower.start()  # before there is a file
    data = log(range(4))
    half = update(4)[:-40]
    write_and_kill(path, data[:50], data[50:333], data[333:], half)
    write_and_kill(path, b"\n" + log(range(2)))  # a writer that begins anew in the same file
    path.unlink()
    write_and_kill(path, log([30]))  # and in another one by the same name
    follower.join(30)
    assert not follower.is_alive()
    # The killed writer's half line is all that is lost, of update 4; its odometry was whole. The clock that
    # began anew goes on 2 s behind 4, and so it stays.
    assert times(got) == [0, 1, 2, 3, 6, 7, 36]
    assert len(got[4].frame.motions) == 2
    assert session.counts.broken == 1
    assert times(list(open_session(tmp_path / "r" / "session.log").moments())) == times(got)
    assert "been silent for 1 s" in session.ended


def test_pictures_by_their_paths_are_put_into_the_recording(small_session: Path, tmp_path: Path) -> None:
    patience = Patience(0.5, silent_s=0.5)
    _, moments = gone_through(live_source(small_session), tmp_path / "r", patience)
    log_ = open_session(tmp_path / "r" / "session.log")
    assert log_.info.survey == open_session(small_session).info.survey
    assert not (tmp_path / "r" / "pictures").exists()
    assert_same_drive(open_session(small_session), log_)
    sent = open_session(small_session).moments()
    for one, other, captured in zip(sent, moments, log_.moments(), strict=True):
        assert (one.frame.image == other.frame.image).all()
        assert one.frame.time_s == other.frame.time_s
        assert other.frame.picture == captured.frame.picture  # a saved run names what can be read again
        assert one.truth is not None
        assert (one.truth == other.truth).all()


def test_the_latest_picture_does_not_wait_for_a_truth_that_does_not_come() -> None:
    over = threading.Event()

    def robot(connection: socket.socket) -> None:
        connection.sendall(log([0]) + line(0, truth=[0, 0, 0]) + update(1))
        over.wait(20)

    with (
        peer(robot) as address,
        LiveSession(live_source(address), ListenOptions(patience=Patience(30))) as session,
    ):
        moments: Iterator[Moment] = session.moments()
        next(moments)
        assert next(moments).truth is None
        over.set()


def test_with_a_slow_filter_pictures_are_skipped_and_no_motion_is(tmp_path: Path) -> None:
    with peer(says(log(range(60)))) as address:
        listen = ListenOptions(keep_up=True, patience=SOON)
        with LiveSession(live_source(address), listen, LiveRecorder(tmp_path)) as session:
            assert session.info.name == "live"
            session.listen()  # whoever filters is busy until everything is there
            moments = list(session.moments())
    assert session.counts.pictures == 60
    assert session.skipped == 56
    assert times(moments) == [56, 57, 58, 59]
    assert [len(moment.frame.motions) for moment in moments] == [57, 1, 1, 1]
    assert open_session(tmp_path / "session.log").count_pictures() == 60


def test_only_pictures_after_enough_movement_make_updates_and_all_are_recorded(tmp_path: Path) -> None:
    standing = b"".join(update(t, forward_m=0.0) for t in range(3, 9))
    with peer(says(log(range(3)) + standing + update(9) + update(10))) as address:
        listen = ListenOptions(keep_up=False, patience=SOON, gate=Gate(min_distance_m=0.15))
        with LiveSession(live_source(address), listen, LiveRecorder(tmp_path)) as session:
            moments = list(session.moments())
    assert times(moments) == [0, 2, 10]
    assert [len(moment.frame.motions) for moment in moments] == [1, 2, 8]
    assert open_session(tmp_path / "session.log").count_pictures() == 11


def scanned(t_s: float, **odometry: object) -> bytes:
    seen = {"ranges_m": [1 + t_s, None, "inf"], "start_rad": -1, "step_rad": 1, "min_m": 0, "max_m": 8}
    return line(t_s, **odometry) + line(t_s, scan=seen)


@pytest.mark.parametrize("poses", [False, True])
@pytest.mark.parametrize(
    ("gate", "used"), [(None, [0, 3, 6]), (Gate(), range(8)), (Gate(min_distance_m=0.45), [0, 5])]
)
def test_a_laser_that_is_heard_makes_the_updates_that_its_recording_does(
    gate: Gate | None, used: list[int], poses: bool, tmp_path: Path
) -> None:
    """By motions and by poses; the gate is AMCL's where none is asked for."""
    said = b"".join(
        scanned(k, odometry_pose=[0.1 * k, 0, 0]) if poses else scanned(k, odometry=[0.1 * (k > 0), 0, 0])
        for k in range(8)
    )
    with peer(says(log(()) + said)) as address:
        listen = ListenOptions(keep_up=False, patience=SOON, gate=gate)
        with LiveSession(live_source(address), listen, LiveRecorder(tmp_path)) as session:
            moments = list(session.moments())
    assert times(moments) == list(used)
    ranges = [float(m.frame.scan.ranges_m[0]) for m in moments if m.frame.scan is not None]
    assert ranges == [1.0 + k for k in used]
    assert sum(float(m.frame.motions[:, 0].sum()) for m in moments) == pytest.approx(0.1 * used[-1])
    asked = {} if gate is None else {"min_distance_m": gate.min_distance_m}
    assert times(list(open_session(tmp_path / "session.log", **asked).moments())) == list(used)


def test_once_a_picture_comes_pictures_make_the_updates_and_have_the_scan_before() -> None:
    said = b"".join(scanned(k, odometry=[0.3, 0, 0]) for k in range(3)) + update(3)
    said += scanned(4, odometry=[0.3, 0, 0]) + update(4.05) + scanned(5, odometry=[0.3, 0, 0]) + update(6)
    with peer(says(log(()) + said)) as address:
        _, moments = gone_through(live_source(address))
    assert times(moments) == [0, 1, 2, 3, 4.05, 6]
    assert [moment.frame.scan is not None for moment in moments] == [True, True, True, False, True, False]
    assert [len(moment.frame.motions) for moment in moments] == [1, 1, 1, 1, 2, 2]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full to write to")
def test_a_full_disk_is_told_in_one_line(tmp_path: Path) -> None:
    recorder = LiveRecorder(tmp_path)
    (tmp_path / "session.log").symlink_to("/dev/full")
    with (
        peer(says(log(range(5)))) as address,
        LiveSession(live_source(address), ListenOptions(keep_up=False, patience=SOON), recorder) as session,
        pytest.raises(InputError, match="cannot be recorded to: No space left"),
    ):
        list(session.moments())


def test_a_folder_that_holds_a_session_is_not_written_to(tmp_path: Path) -> None:
    (tmp_path / "session.log").write_text("mine")
    with pytest.raises(InputError, match="--force"):
        LiveRecorder(tmp_path)
    with pytest.raises(InputError, match="expected a folder"):
        LiveRecorder(tmp_path / "session.log")
    assert (tmp_path / "session.log").read_text() == "mine"


def test_what_is_live_and_that_it_leaves_no_folder_before_it_begins(tmp_path: Path) -> None:
    assert all(is_live(text) for text in ("-", "tcp://a:1", "ws://a:1", "wss://a:1", Path("tcp://a:1")))
    assert not any(is_live(text) for text in ("a.log", "tcp", "http://a:1", "tcp.log", "./tcp/a"))
    assert live_source(Path("tcp://127.0.0.1:5005")).name == "tcp://127.0.0.1:5005"
    session = LiveSession(live_source("tcp://127.0.0.1:9"), ListenOptions(), LiveRecorder(tmp_path / "rec"))
    for _ in range(2):
        session.close()
    assert not (tmp_path / "rec").exists()


@pytest.mark.parametrize(
    "text", ["tcp://a", "tcp://:1", "tcp://a:b", "tcp://a:70000", "tcp://a:1/x", "ws://a"]
)
def test_broken_addresses_are_told_in_one_line(text: str) -> None:
    with pytest.raises(InputError, match=r"^(tcp|ws)://.*: found .*, expected ") as told:
        live_source(text)
    assert "\n" not in str(told.value)
