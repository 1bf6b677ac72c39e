"""`--web`: the page comes up on this machine alone, a browser gets the recording, Ctrl-C ends it."""

from __future__ import annotations

import re
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import parse_qs, urlsplit
from urllib.request import urlopen

import pytest

from helpers.browser import SOFTWARE, browser, needs_browser
from helpers.commands import COMMAND, maurice, no_display
from maurice_viz.viewer import open_viewers, web

ANSWERS_S = 240.0


def listens_elsewhere(port: int) -> bool:
    """Whether another address of this machine answers on that port."""
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.2", port)) == 0


@contextmanager
def serving(*words: object) -> Iterator[tuple[subprocess.Popen[str], list[str]]]:
    """Give a command, and yield it with its lines when it serves."""
    pipe = subprocess.PIPE
    args = [*COMMAND, *map(str, words)]
    with subprocess.Popen(args, env=no_display(), stdout=pipe, stderr=pipe, text=True) as going:
        assert going.stderr is not None
        lines = []
        for line in going.stderr:
            lines.append(line.strip())
            if "until Ctrl-C" in line:
                break
        try:
            yield going, lines
        finally:
            going.terminate()


def url_of(lines: list[str]) -> str:
    return next(line.removeprefix("in a browser: ") for line in lines if line.startswith("in a browser"))


def test_a_replay_is_served_on_this_machine_alone_until_ctrl_c(small_session, tmp_path):
    with serving(small_session, "--particles", "50", "--web") as (going, lines):
        url = urlsplit(url_of(lines))
        data = urlsplit(parse_qs(url.query)["url"][0])
        assert (url.scheme, url.hostname, data.scheme, data.hostname, data.path) == (
            "http", "127.0.0.1", "rerun+http", "127.0.0.1", "/proxy",
        )  # fmt: skip
        way = re.compile(r"ssh -N -L (\d+):127.0.0.1:\1 -L (\d+):127.0.0.1:\2 \S+@\S+$")
        tunnel = next(match for match in map(way.search, lines) if match is not None)
        assert tunnel.groups() == (str(url.port), str(data.port))
        assert any("to look at step" in line for line in lines)
        with urlopen(url.geturl(), timeout=30) as page:
            assert b"re_viewer.js" in page.read()
        assert not any(listens_elsewhere(port or 0) for port in (url.port, data.port))
        going.send_signal(signal.SIGINT)
        out, err = going.communicate(timeout=120)
    assert (going.returncode, err) == (0, "")
    assert "heading error, mean" in out
    assert not list(tmp_path.glob("*.rrd"))
    for port in (url.port, data.port):
        with socket.socket() as probe:
            assert probe.connect_ex(("127.0.0.1", port or 0)) != 0


def test_the_server_ends_when_the_replay_is_killed(small_session):
    with serving(small_session, "--particles", "50", "--web") as (going, lines):
        port = urlsplit(url_of(lines)).port or 0
        with urlopen(f"http://127.0.0.1:{port}", timeout=30) as page:
            assert page.status == 200
        going.kill()
        until = time.monotonic() + 20
        while time.monotonic() < until:
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", port)) != 0:
                    return
            time.sleep(0.05)
    raise AssertionError("the server outlives the command")


@pytest.mark.slow
@needs_browser
def test_a_browser_gets_the_recording(small_session, tmp_path):
    maurice(small_session, "--particles", "50", "-o", "a.rrd")
    size = (tmp_path / "a.rrd").stat().st_size
    with serving("a.rrd", "--web") as (_, lines), browser(tmp_path / "profile", *SOFTWARE) as page:
        page.open(url_of(lines) + "&renderer=webgl", 64, 64)  # small: the processor draws it
        asked, received = set[str](), 0
        for event in page.events_until(time.monotonic() + ANSWERS_S):
            params = event["params"]
            if event["method"] == "Network.requestWillBeSent" and "/ReadMessages" in params["request"]["url"]:
                asked.add(params["requestId"])
            elif event["method"] == "Network.dataReceived" and params["requestId"] in asked:
                received += params["dataLength"]
            if received > 0.5 * size:  # a file also has an index
                break
    assert received > 0.5 * size, (received, size)


def test_ports_are_the_same_every_time_unless_they_are_taken(monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        monkeypatch.setattr(web, "PAGE_PORT", port)
        shown = web.WebViewer()
        shown.reserve()
        assert shown.page not in (0, port)
    shown.reserve()
    assert shown.page == port


def test_what_cannot_be_served_is_one_line(tmp_path, monkeypatch):
    for module in (web, open_viewers):
        monkeypatch.setattr(module, "viewer_binary", lambda: Path(shutil.which("false") or ""))
    shown = web.WebViewer()
    with pytest.raises(web.SinkError, match=r"^[^\n]*serves no page on the ports[^\n]*$"):
        shown.serve()
    assert not shown.is_serving
    monkeypatch.setattr(open_viewers, "viewer_binary", lambda: tmp_path / "none")
    with pytest.raises(web.SinkError, match=r"does not start"):
        shown.serve()
    broken = tmp_path / "b.rrd"
    broken.write_bytes(b"nothing")
    assert "found no Rerun recording" in maurice("b.rrd", "--web", expect=1)[1]
