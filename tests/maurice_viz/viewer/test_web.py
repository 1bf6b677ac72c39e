"""`--web`: the page comes up on this machine alone, a browser gets the recording, Ctrl-C ends it."""

from __future__ import annotations

import json
import re
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.error import HTTPError
from urllib.parse import urlsplit
from urllib.request import urlopen

import pytest

from helpers.browser import SOFTWARE, browser, needs_browser
from helpers.commands import COMMAND, maurice, no_display
from maurice_viz.entities import Phase, Place
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


def read(url: str) -> bytes:
    with urlopen(url, timeout=30) as answer:
        return bytes(answer.read())


def url_of(lines: list[str]) -> str:
    return next(line.removeprefix("in a browser: ") for line in lines if line.startswith("in a browser"))


def test_a_replay_is_served_on_this_machine_alone_until_ctrl_c(small_session, tmp_path):
    with serving(small_session, "--particles", "50", "--web") as (going, lines):
        url = urlsplit(url_of(lines))
        assert (url.scheme, url.hostname, url.path) == ("http", "127.0.0.1", "/")
        tunnel = next(line for line in lines if "ssh -N" in line)
        assert re.search(rf"ssh -N -L {url.port}:127.0.0.1:{url.port} \S+@\S+$", tunnel)
        assert b"re_viewer.js" in read(url.geturl())
        shown = json.loads(read(f"{url.geturl()}shown.json"))
        assert any(line.endswith(f"it opens at step {shown['number']}") for line in lines)
        assert shown["timeline"] == "step"
        assert read(f"{url.geturl()}recording.rrd").startswith(b"RRF")
        assert not listens_elsewhere(url.port or 0)
        going.send_signal(signal.SIGINT)
        out, err = going.communicate(timeout=120)
    assert (going.returncode, err) == (0, "")
    assert "heading error, mean" in out
    assert not list(tmp_path.glob("*.rrd"))
    with socket.socket() as probe:
        assert probe.connect_ex(("127.0.0.1", url.port or 0)) != 0


@pytest.mark.slow
@needs_browser
def test_a_browser_opens_the_recording_at_its_place(small_session, tmp_path):
    maurice(small_session, "--particles", "50", "-o", "a.rrd")
    words, place = ("open", "a.rrd", "--step", 5, "--phase", "weight"), Place(5, Phase.WEIGHT)
    with serving(*words, "--web") as (_, lines), browser(tmp_path / "profile", *SOFTWARE) as page:
        page.open(url_of(lines), 64, 64)  # small: the processor draws it
        until = time.monotonic() + ANSWERS_S
        while not page.value("document.getElementById('wait').hidden"):
            words_shown = page.value("document.getElementById('wait').textContent")
            assert time.monotonic() < until, words_shown
            assert words_shown.startswith(("Loading", "Starting", "Opening")), words_shown
            time.sleep(0.2)
        state = bytes(page.value("Array.from(viewer.viewer_state())"))
        cursor = place.timeline.encode() + rb".{1,4}\x02\x08" + re.escape(bytes([place.number]))
        assert re.search(cursor, state, re.DOTALL), state


def test_ports_are_the_same_every_time_unless_they_are_taken(monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        monkeypatch.setattr(web, "DATA_PORT", port)
        shown = web.WebViewer()
        assert shown.reserve() not in (0, port)
    assert shown.reserve() == shown.data == port


def test_what_cannot_be_served_is_one_line(tmp_path, monkeypatch):
    for module in (web, open_viewers):
        monkeypatch.setattr(module, "viewer_binary", lambda: Path(shutil.which("false") or ""))
    shown = web.WebViewer()
    with pytest.raises(web.SinkError, match=r"^[^\n]*gives no web viewer[^\n]*$"):
        shown.serve()
    assert not shown.is_serving
    monkeypatch.setattr(open_viewers, "viewer_binary", lambda: tmp_path / "none")
    with pytest.raises(web.SinkError, match=r"does not start"):
        shown.serve()
    broken = tmp_path / "b.rrd"
    broken.write_bytes(b"nothing")
    assert "found no Rerun recording" in maurice("b.rrd", "--web", expect=1)[1]


def test_the_page_gets_its_layout_with_the_wanted_tab(small_session, tmp_path):
    maurice(small_session, "--particles", "50", "-o", "a.rrd")
    shown = web.WebViewer()
    shown.serve(tmp_path / "a.rrd", Place(3, Phase.MEASURE), "none")
    try:
        said = json.loads(read(f"{shown.url}shown.json"))
        assert (said["timeline"], said["number"], said["layout"]) == ("phase", 6 * 3 + 1, "none")
        layout = json.dumps({"/viewport": {"ViewportBlueprint": {}}}).encode()
        with pytest.raises(HTTPError) as refused, urlopen(f"{shown.url}layout", layout, timeout=30):
            pass
        with refused.value as answer:
            assert answer.read().decode().startswith("found no layout 'none'")
    finally:
        shown.close()
