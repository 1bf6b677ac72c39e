"""Chromium without a window, driven through the pipe of its DevTools."""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium: apt-get install chromium")
HEADLESS = ("--headless", "--no-sandbox", "--hide-scrollbars", "--no-first-run")
SOFTWARE = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")  # WebGL without a GPU
PATIENCE_S = 120.0
INPUT, OUTPUT = 3, 4  # the files that Chromium reads commands from, and writes answers to


class Page:
    """The one page of a browser."""

    def __init__(self, commands: int, answers: int) -> None:
        self._commands, self._answers = commands, answers
        self._number, self._rest, self._session = 0, b"", ""
        self.events: list[dict[str, Any]] = []
        targets = self.call("Target.getTargets")["targetInfos"]
        target = next(one["targetId"] for one in targets if one["type"] == "page")
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        """Call a method of the DevTools protocol; events that come meanwhile are kept."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": params}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._commands, json.dumps(message).encode() + b"\0")
        deadline = time.monotonic() + PATIENCE_S
        while (found := self._message(deadline)) is not None:
            if found.get("id") == self._number:
                assert "result" in found, found
                return dict(found["result"])
            self.events.append(found)
        raise TimeoutError(method)

    def events_until(self, deadline: float) -> Iterator[dict[str, Any]]:
        """Yield what happens in the page, from its beginning to a time of the monotonic clock."""
        yield from self.events
        while (found := self._message(deadline)) is not None:
            self.events.append(found)
            yield found

    def open(self, url: str, width: int = 1600, height: int = 1000) -> None:
        """Show a page in this size, and wait until it is loaded."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **size)
        self.events.clear()
        self.call("Page.navigate", url=url)
        for event in self.events_until(time.monotonic() + PATIENCE_S):
            if event["method"] == "Page.loadEventFired":
                return
        raise TimeoutError(url)

    def value(self, script: str) -> Any:
        """Return the value of an expression of JavaScript."""
        found = self.call("Runtime.evaluate", expression=script, returnByValue=True)
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    def hover(self, x: float, y: float) -> None:
        """Move the mouse there, in px of the window."""
        self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)

    def tap(self, x: float, y: float) -> None:
        """Tap there, as a finger does."""
        self.call("Input.dispatchTouchEvent", type="touchStart", touchPoints=[{"x": x, "y": y}])
        self.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def press(self, key: str) -> None:
        """Press and release a key, such as ArrowRight."""
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=key)

    def picture(self, file: Path) -> None:
        """Write a picture of the window."""
        file.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))

    def _message(self, deadline: float) -> dict[str, Any] | None:
        while b"\0" not in self._rest:
            left = deadline - time.monotonic()
            if left <= 0 or not select.select([self._answers], [], [], left)[0]:
                return None
            read = os.read(self._answers, 1 << 20)
            if not read:
                raise EOFError("the browser ended")
            self._rest += read
        message, self._rest = self._rest.split(b"\0", 1)
        return dict(json.loads(message))


@contextmanager
def browser(profile: Path, *options: str) -> Iterator[Page]:
    """Start Chromium with an empty page; `profile` is a folder for its own files."""
    assert CHROMIUM is not None
    theirs, commands = os.pipe()
    answers, written = os.pipe()

    def place() -> None:
        high = [os.dup(one) for one in (theirs, written)]  # neither is overwritten by the other
        high = [one if one > OUTPUT else os.dup(one) for one in high]
        os.dup2(high[0], INPUT)
        os.dup2(high[1], OUTPUT)

    command = [CHROMIUM, *HEADLESS, "--remote-debugging-pipe", f"--user-data-dir={profile}", *options]
    quiet = subprocess.DEVNULL
    running = subprocess.Popen(
        [*command, "about:blank"], close_fds=False, preexec_fn=place, stdout=quiet, stderr=quiet
    )
    for one in (theirs, written):
        os.close(one)
    try:
        yield Page(commands, answers)
    finally:
        running.terminate()
        running.wait(30)
        os.close(commands)
        os.close(answers)
