"""Two hours of robot time: does a live replay hold its memory, keep up, and record everything?

    python -m benchmarks.speed.soak [--rate 10] [--hours 2]

The simulated robot speaks over a socket at so many times real time; `maurice-replay tcp://... --capture`
follows, drawing into a file and serving viewers, and is stopped by SIGTERM at the end. Prints the megabytes
that it holds (Linux) forty times. Exit status 1 when memory grew over the second
half, a line was lost, or the recording is not complete.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import maurice_loaders as ml

COMMAND = str(Path(sys.executable).with_name("maurice-replay"))
UPDATE_S = 7.6  # of robot time, about
GROWTH_MB = 40.0  # over the second half; the buffer for viewers is full before
LOOKS = 40
LATE_S = 15.0  # the follower starts this long after the robot; earlier lines were never sent to it


def held_mb(pid: int) -> float:
    """Return what a process holds in memory."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rate", type=float, default=10.0, help="times real time")
    parser.add_argument("--hours", type=float, default=2.0, help="of robot time")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        return soak(Path(folder), asked.rate, asked.hours * 3600)


def soak(folder: Path, rate: float, robot_s: float) -> int:
    subprocess.run([COMMAND, "survey", "-o", folder / "survey"], check=True, stdout=subprocess.DEVNULL)
    updates = str(round(robot_s / UPDATE_S))
    serve = [
        "simulate",
        "tracking",
        "--serve",
        "tcp://127.0.0.1:0",
        "--rate",
        str(rate),
        "--updates",
        updates,
    ]
    robot = subprocess.Popen([COMMAND, *serve], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert robot.stdout is not None
    address = robot.stdout.readline().strip()
    record = ["--library", folder / "survey" / "survey.log", "--capture", folder / "drive"]
    save = ["-o", folder / "live.rrd", "--patience", "30"]
    output = (folder / "follower.txt").open("w")
    follower = subprocess.Popen([COMMAND, address, *record, *save], stdout=output, stderr=output)
    memory = watch(robot, follower, robot_s / rate / LOOKS)
    time.sleep(2)
    follower.send_signal(signal.SIGTERM)
    status = follower.wait(60)
    last_line = robot.communicate()[1].strip().splitlines()[-1]
    print((folder / "follower.txt").read_text())
    least = int(updates) - round(LATE_S * rate / UPDATE_S) - 1
    return judge(memory, status, last_line, folder, least)


def watch(robot: subprocess.Popen[str], follower: subprocess.Popen[bytes], every_s: float) -> list[float]:
    """Look at the follower's memory until the robot has driven."""
    memory = []
    while robot.poll() is None and follower.poll() is None:
        time.sleep(every_s)
        if follower.poll() is None:
            memory.append(held_mb(follower.pid))
            print(f"{len(memory):4}: {memory[-1]:6.0f} MB", flush=True)
    return memory


def judge(held: list[float], status: int, robot_said: str, folder: Path, least: int) -> int:
    """Print the result."""
    half = held[len(held) // 2 :]
    growth = max(half) - half[0] if half else 0.0
    log = ml.open_session(folder / "drive" / "session.log")
    pictures = log.count_pictures()
    print(f"robot: {robot_said}")
    print(f"held {held[0]:.0f} MB at first, {half[0]:.0f} MB half way, {max(half):.0f} MB at most after that")
    size_mb = (folder / "live.rrd").stat().st_size / 1e6
    print(f"{pictures} of at least {least} pictures; live.rrd has {size_mb:.0f} MB; exit status {status}")
    whole = status == 143 and "slow ones: 0" in robot_said and pictures >= least
    return 0 if whole and growth < GROWTH_MB else 1


if __name__ == "__main__":
    sys.exit(main())
