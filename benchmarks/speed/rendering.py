"""Milliseconds per picture: two worlds, several sizes, and what changing light and people add to it.

Each world is looked at from its own nodes, in headings drawn once. Every line is compared with the first of
its world, the plain session; the lines take turns picture by picture, so a busy neighbor slows all of them.
"""

from __future__ import annotations

from time import perf_counter

import cv2
import numpy as np

import maurice_datasets as md
from maurice_datasets.render.camera import Lens
from maurice_datasets.render.camera_session import CameraSession, lit_once, session_camera
from maurice_datasets.render.conditions import Conditions, parse_lights
from maurice_datasets.render.light import lighting_of
from maurice_datasets.worlds.world import World

WORLDS = ("two-rooms", "office")
PICTURES = 60
GOAL_MS, LIMIT_MS = 10, 20
SIZES = ((88, 143), (352, 288), (640, 480))


def camera_sessions(world: World) -> dict[str, CameraSession]:
    moving = parse_lights("daylight@1-1000")
    cases = {
        "plain": Conditions(),
        "automatic gain, drift": Conditions(drift=0.2, tint=0.1, gain="auto"),
        "daylight moves": Conditions(moving),
        "people in every picture": Conditions(occluded=1.0),
        "daylight and people": Conditions(moving, occluded=1.0),
    }
    cameras = {name: session_camera(world, 0, conditions) for name, conditions in cases.items()}
    for width, height in SIZES:
        lens = Lens(width, height, pixel_aspect=2.0 if width < height else 1.0)
        cameras[f"plain, {width} x {height}"] = session_camera(world, 0, lens=lens)
    return cameras


def measure(name: str) -> None:
    world = md.load_world(name, 0)
    began = perf_counter()
    lighting = lighting_of(world)
    lit_once(world)
    baked = perf_counter() - began
    memory = sum(part.light.nbytes + part.where.nbytes for part in lighting.by_part) / 1e6
    counts = f"{len(world.faces)} faces, {len(world.boxes)} boxes, {len(world.sources)} sources of light"
    print(f"{name}: {counts}")
    print(f"  {'baked in':30} {baked * 1000:7.0f} ms, light by source {memory:.0f} MB")
    cases = camera_sessions(world)
    rng = np.random.default_rng(1)
    places = world.nodes[rng.integers(len(world.nodes), size=PICTURES)]
    poses = np.column_stack([places, rng.uniform(-np.pi, np.pi, PICTURES)])
    took: dict[str, list[float]] = {case: [] for case in cases}
    for number, pose in enumerate(poses, start=1):
        for case, camera in cases.items():
            began = perf_counter()
            camera.take(number, pose)
            took[case].append((perf_counter() - began) * 1000)
    plain = np.median(took["plain"])
    for case, times in took.items():
        middle, most = np.median(times), np.quantile(times, 0.95)
        print(f"  {case:30} {middle:7.1f} ms  {middle / plain:5.2f} x  95 % under {most:6.1f} ms")


def main() -> None:
    cv2.setNumThreads(1)
    for name in WORLDS:
        measure(name)
    print(f"goal {GOAL_MS} ms and limit {LIMIT_MS} ms per picture of 176 x 144")


if __name__ == "__main__":
    main()
