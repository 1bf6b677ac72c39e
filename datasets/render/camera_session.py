"""One camera on one day: the survey's or a session's pictures of a world, under what changes meanwhile.

Pictures are pure functions of number and pose. The light of the two worlds baked last is kept.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from maurice_mcl.values import F64, U8, Domain, stream

from ..tasks import SimPurpose
from ..worlds.world import World
from .camera import Lens, LitScene, joined, radiance
from .conditions import Conditions, brightness_at, events_at, named_lights, reshades, weights_at
from .image_sensor import Exposure, Sensor, covered, draw_exposure, drifted, photograph
from .light import Lighting, bake, lighting_of, relit, unlit, windows_of
from .people import StandingPerson, people, standing_shade, stands_at


@dataclass(frozen=True, slots=True, eq=False)
class CameraSession:
    """Everything that makes pictures of a world; see `survey_camera` and `session_camera`."""

    world: World
    scene: LitScene  # lit for good; or, with `lighting`, to be lit anew for each picture
    lighting: Lighting | None
    exposure: Exposure
    seed: int
    purpose: SimPurpose  # of the pictures' noise
    conditions: Conditions
    lens: Lens
    sensor: Sensor

    def take(self, number: int, pose: F64) -> U8:
        """Take picture `number` (H, W, 3) from a true pose (3,); in a session number is the update's."""
        light = radiance(self._scene_at(number, pose), pose, self.lens)
        light *= np.float32(brightness_at(self.conditions.lights, number))
        rng = stream(Domain.SIMULATOR, self.seed, number, self.purpose)
        exposure = self.exposure_at(number)
        return photograph(light, self.sensor, exposure, rng, half=self.conditions.half_resolution)

    def take_covered(self, number: int) -> U8:
        """Take a picture with the lens covered."""
        rng = stream(Domain.SIMULATOR, self.seed, number, SimPurpose.COVERED_NOISE)
        return covered(self.sensor, (self.lens.height_px, self.lens.width_px), rng)

    def exposure_at(self, number: int) -> Exposure:
        """Return gain and white balance at an update; automatic gain is chosen picture by picture."""
        if not (self.conditions.drift or self.conditions.tint):
            return self.exposure
        return drifted(self.exposure, self.conditions, self.seed, number)

    def events(self, number: int) -> tuple[str, ...]:
        """Return what happens to the light at an update, for the log: "lights off west room lamp"."""
        return events_at(self.conditions.lights, number)

    @property
    def notes(self) -> tuple[str, ...]:
        """Return what differs from the survey, in a few words each, for a log's header."""
        conditions = self.conditions
        holds = {
            "automatic gain": conditions.gain == "auto",
            "half resolution: every other column read, and handed over twice": conditions.half_resolution,
            f"gain drifts by up to {conditions.drift:.0%}": conditions.drift > 0,
            f"white balance drifts by up to {conditions.tint:.0%}": conditions.tint > 0,
            f"people in {conditions.occluded:.0%} of the pictures": conditions.occluded > 0,
        }
        return tuple(text for text, is_so in holds.items() if is_so)

    def stands(self, number: int, pose: F64) -> tuple[StandingPerson, ...]:
        """Return the people who stand in view in one picture."""
        return stands_at(self.world.arena, pose, self.seed, number, self.conditions.occluded)

    def _scene_at(self, number: int, pose: F64) -> LitScene:
        if self.lighting is None:
            return self.scene
        lighting = self.lighting
        weights = weights_at(lighting.parts, windows_of(self.world), self.conditions.lights, number)
        room, stands = relit(self.scene, lighting.under(weights)), self.stands(number, pose)
        if not stands:
            return room
        standing = people(self.world, lighting.parts, weights, stands, self.seed)
        return joined(standing_shade(room, stands), standing)


@lru_cache(maxsize=1)
def lit_once(world: World) -> LitScene:
    """Light a world for good; kept for the last one."""
    return bake(world)


def survey_camera(world: World, seed: int, *, half_resolution: bool = False) -> CameraSession:
    """Make the survey's camera: its own light and white balance, and nothing that changes."""
    purposes = SimPurpose.SURVEY_LIGHT, SimPurpose.SURVEY_NOISE
    return _camera_session(world, seed, Conditions(half_resolution=half_resolution), purposes)


def session_camera(
    world: World, seed: int, conditions: Conditions | None = None, *, lens: Lens | None = None
) -> CameraSession:
    """Make the session's camera, on another day; ValueError for a light that the world does not have."""
    purposes = SimPurpose.SESSION_LIGHT, SimPurpose.SESSION_NOISE
    return _camera_session(world, seed, conditions or Conditions(), purposes, lens)


def _camera_session(
    world: World,
    seed: int,
    conditions: Conditions,
    purposes: tuple[SimPurpose, SimPurpose],
    lens: Lens | None = None,
) -> CameraSession:
    """Build a camera session; `purposes` are those of its light and of its noise."""
    lights = named_lights(world, conditions.lights)
    drawn = draw_exposure(stream(Domain.SIMULATOR, seed, 0, purposes[0]))
    moving = reshades(conditions) or conditions.occluded > 0
    return CameraSession(
        world=world,
        scene=unlit(lighting_of(world)) if moving else lit_once(world),
        lighting=lighting_of(world) if moving else None,
        exposure=Exposure(drawn.gain, conditions.gain == "auto"),
        seed=seed,
        purpose=purposes[1],
        conditions=replace(conditions, lights=lights),
        lens=lens or Lens(),
        sensor=Sensor(),
    )
