"""A CMUcam2 that answers on the other end of a real pseudo-terminal."""

from __future__ import annotations

import os
import pty
import select
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from maurice_mcl.values.arrays import U8

SCENE = np.random.default_rng(5).integers(16, 241, (12, 10, 3), np.uint8)  # rows, triplets


def frame_packet(scene: U8) -> bytes:
    rows, columns = scene.shape[:2]
    return bytes([1, columns, rows]) + b"".join(b"\x02" + row.tobytes() for row in scene) + b"\x03"


def histogram_packet(values: U8) -> bytes:
    counts = np.histogram(values, np.append(16 + 8 * np.arange(28), 241))[0] * 256 // values.size
    return b"H " + b" ".join(str(count).encode() for count in counts) + b"\r"


def answer_to(command: str) -> bytes:
    word, *numbers = command.split()
    match word:
        case "RS":
            return b"ACK\rCMUcam2 v1.00 c6\r:"
        case "GV":
            return b"ACK\rCMUcam2 v1.00 c6\r:"
        case "SF":
            return b"ACK\r" + frame_packet(SCENE) + b"\r:"
        case "GH":
            return b"ACK\r" + histogram_packet(SCENE[..., int(numbers[0])]) + b":"
    return b"ACK\r:"


Answer = Callable[[str], bytes | None]  # None: the plug is pulled


@contextmanager
def camera(answer: Answer = answer_to, portion: int = 1000) -> Iterator[str]:
    """A camera that answers every command, so many bytes at a time."""
    head, tail = pty.openpty()
    tty.setraw(tail)
    name, over = os.ttyname(tail), threading.Event()

    def serve() -> None:
        waiting = b""
        while not over.is_set():
            if select.select([head], [], [], 0.02)[0]:
                waiting += os.read(head, 100)
            while b"\r" in waiting:
                command, _, waiting = waiting.partition(b"\r")
                said = answer(command.decode()) if command else b"NCK\r:"
                if said is None:
                    over.set()
                    break
                for at in range(0, len(said), portion):
                    os.write(head, said[at : at + portion])
        os.close(tail)
        os.close(head)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield f"cmucam://{name}"
    finally:
        over.set()
        thread.join(5)
