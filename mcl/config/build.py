"""From a configuration to a localizer. Every name is looked up here and nowhere else."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import InputError
from ..filter.following import GuidedProposal, can_propose
from ..filter.localizer import Localizer
from ..filter.motion import motion_model
from ..filter.proposal import MixtureProposal, MotionProposal, Proposal, Regions, regions
from ..filter.recovery import RecoveryStep, strategy_of
from ..filter.resampling import POLICIES, Resampling, resampler_of
from ..library.left_out import LeftOutTable, PlaceScore, fitted_scale, is_sparse, score_places
from ..sensor.descriptors.registry import CHANNELS, OUR_NAMES, OwnChannel, give_channels, weights_of
from ..sensor.distances import SIGNED
from ..sensor.laser.sensor import LASER, laser_of
from ..sensor.map_places import reference_of
from ..sensor.model import SensorModel, SensorParameters
from ..sensor.outside import with_sensors
from ..sensor.references import NearestReference, interpolated_reference
from ..sensor.virtual_references import virtual_references
from ..values import (
    POSE_SENSORS,
    Library,
    PoseSensor,
    PoseSpread,
    Radii,
    Session,
    expected_one_of,
    radii_of,
    spacing,
)
from .parameters import (
    PRESETS,
    Configuration,
    FilterParameters,
    Layer,
    ResamplingParameters,
    Setting,
    check_channel,
    configure,
)

TRACKED_M = 0.3  # on a map, whose places are no references: see `GuidedProposal.reach_m`


def make_localizer(
    library: Library,
    *,
    preset: str | None = None,
    feature: str | None = None,
    particles: int | None = None,
    seed: int = 0,
    motion: Any = None,
    settings: Mapping[str, Any] | None = None,
    sensors: Sequence[PoseSensor | str] = (),
) -> Localizer:
    """Make a filter over a library, with the same defaults as the command line.

    `preset` is a key of `PRESETS`; `feature` a key of `FEATURES` (`sensor.descriptors.registry`) or a channel
    ("blended" unless a preset says otherwise); `particles` defaults to 2000; the same `seed` repeats a run
    bit for bit. `motion` holds motion parameters as under robot.motion in a session's header, or is a model
    of your own; with None, it is that of the session which `run` is given. `settings` maps any key of
    docs/configuration.md to a value; it overrides the preset, and the other arguments override it.
    `sensors` are pose sensors besides those of the library (`maurice_mcl.PoseSensor`), or names of those that
    packages provide ("beacon", "module:Class"); each is used, with weight 1 unless "sensor.weights" has
    another. Environment variables are not read. The scales of a library
    with few places are widened (`adapted`), and a library without landmarks is used without them
    (`available`), with a warning.

    Raises InputError, in one line, for an unknown name, key or channel and for a value out of range.

        >>> import maurice_mcl as mcl
        >>> library = mcl.tiny_library()
        >>> settings = {"recovery.strategy": "augmented"}
        >>> mcl.make_localizer(library, preset="robust", settings=settings).particles
        2000
    """
    preset = "laser" if preset is None and library.is_map else preset
    if preset is not None and preset not in PRESETS:
        raise InputError(None, f"preset: found {preset!r}, {expected_one_of(preset, PRESETS)}")
    weights = None if feature is None else weights_of(feature)
    arguments = {
        "sensor.weights": weights,
        "particles": particles,
        "motion": motion,
        "sensor.outside": sensors or None,
    }
    layers = [Layer(f"preset {preset}", PRESETS[preset])] if preset else []
    layers += [Layer("settings", settings or {})]
    layers += [Layer("argument", {key: value for key, value in arguments.items() if value is not None})]
    try:
        nearest = reference_of(library)
        configuration, missing = available(configure(layers, library.sensors), library)
        parameters = adapted(configuration, library, nearest)[0].parameters
        localizer = build_localizer(library, None, parameters, reference=nearest, seed=seed)
    except ValueError as problem:
        raise InputError(None, str(problem)) from None
    if missing:
        warnings.warn(
            _without(library, missing), stacklevel=3
        )  # of the caller: between is the check of the front page
    return localizer


def _without(library: Library, missing: Sequence[str]) -> str:
    lacking = f"the library {library.name!r} holds no {', '.join(missing)}: the other channels are used alone"
    finding = [f"with_{name}" for name in missing if name in ("landmarks", "keypoints")]
    advice = f"{' and '.join(finding)} of maurice_loaders find some in its pictures"
    return f"{lacking}; {advice}" if finding else lacking


def available(configuration: Configuration, library: Library) -> tuple[Configuration, tuple[str, ...]]:
    """Leave out pose sensors that a library does not hold; return the names of those, too.

    What a preset or a feature names is used, and nothing else that the library holds. Where nobody chose
    either, a laser is used beside the channels, and the pose sensors of a library without channels.
    InputError when the library lacks a channel that is asked for, or nothing of what is asked for is there.
    """
    weights = configuration.parameters.sensor.weights
    library = equipped(library, configuration.parameters.sensor)
    origins = {setting.key: setting.origin for setting in configuration.settings}
    if library.occupancy is not None and library.index and origins["sensor.weights"] == "default":
        return _with_weights(configuration, {**weights, LASER: 1.0}, library), ()
    if not library.index and library.sensors and origins["sensor.weights"] == "default":
        return _with_weights(configuration, dict.fromkeys(library.sensors, 1.0), library), ()
    holds = {**library.index, **library.sensors}
    missing = tuple(name for name in weights if name not in holds)
    library_weights = {name: weight for name, weight in weights.items() if name in holds}
    has_channel = any(library_weights[name] for name in library_weights if name in library.index)
    is_unfounded = "keypoints" in library_weights and not has_channel
    if not missing and not is_unfounded:
        return configuration, ()
    lacking = [name for name in missing if name not in POSE_SENSORS]
    if lacking or not any(library_weights.values()):
        if library.is_map or missing == (LASER,):
            other = (
                "a camera's features need a library of pictures" if library.is_map else "a laser needs a map"
            )
            raise InputError(None, f"found no {', '.join(missing)} in {library.name!r}: {other}")
        fault = f"found {', '.join(holds) or 'no channel'} in the library {library.name!r}"
        fault += f", expected {(lacking or missing)[0]}"
        again = "build the library again, or " if lacking else ""  # another build finds no more landmarks
        raise InputError(None, f"{fault}; {again}choose another feature")
    if is_unfounded:
        wanted = "expected a channel, too: keypoints verify the references that channels find"
        raise InputError(None, f"sensor.weights: found {', '.join(library_weights)}, {wanted}")
    return _with_weights(configuration, library_weights, library), missing


def equipped(library: Library, sensor: SensorParameters) -> Library:
    """Return a library with all pose sensors there are for it: those of other packages, and a laser."""
    library = with_sensors(library, sensor.outside)
    if library.occupancy is None:
        return library
    return replace(library, sensors={**library.sensors, LASER: laser_of(library.occupancy, sensor.laser)})


def _with_weights(
    configuration: Configuration, weights: Mapping[str, float], library: Library
) -> Configuration:
    setting = Setting("sensor.weights", weights, f"library {library.name}")
    settings = tuple(setting if other.key == setting.key else other for other in configuration.settings)
    p = configuration.parameters
    parameters = replace(p, sensor=replace(p.sensor, weights=weights))
    return replace(configuration, parameters=parameters, settings=settings)


def build_localizer(
    library: Library,
    session: Session | None,
    parameters: FilterParameters | None = None,
    *,
    reference: NearestReference | None = None,
    seed: int = 0,
    radii: Radii | None = None,
    sensor: SensorModel | None = None,
) -> Localizer:
    """Build the localizer that some parameters describe.

    `reference`, that of the library's own map, and `sensor` can be shared.

    The motion model is that of the parameters, else of the session, else of the one that `run` is given. The
    radii, unless they are known (those of a saved run), are derived from the library.
    Raises KeyError for an unknown name, ValueError for bad motion parameters.
    """
    p = parameters or FilterParameters()
    give_channels(p.sensor.channels)
    library = equipped(library, p.sensor)
    arena = library.arena.trusted(p.map.obstacles)
    shared = reference if arena is library.arena else None
    nearest = shared or reference_of(library, arena)
    where = regions(nearest, library.size)
    motion = session.info.motion if p.motion is None and session is not None else p.motion
    unknown = p.motion is None and session is None
    sensor = _sensor(library, nearest, p) if sensor is None else sensor
    return Localizer(
        library=library,
        reference=nearest,
        regions=where,
        motion=None if unknown else motion_model(motion, nearest.grid),
        sensor=sensor,
        resampling=_resampling(p.resampling),
        recovery=RecoveryStep(
            strategy=strategy_of(p.recovery),
            reference=nearest,
            regions=where,
            draw_evenly={"evenly": True, "likelihood": False}[p.recovery.draw],
            is_relative=p.recovery.strategy == "library",
        ),
        proposal=_proposal(sensor, nearest, where, p),
        outliers=p.motion_outliers,
        obstacles=p.map.obstacles,
        particles=p.particles,
        start_sd=(p.start.sd_m, p.start.heading_sd_rad),
        seed=seed,
        radii=radii_of(library, p.radii) if radii is None else radii,
    )


def adapted(
    configuration: Configuration, library: Library, nearest: NearestReference
) -> tuple[Configuration, PlaceScore | None]:
    """Widen the scales where the library's own pictures show that they are overconfident there.

    Where places are sparse, a channel gets its own scale, fitted on places left out and drawn toward ours, if
    that is wider. All are widened together where the sensor is then worse than knowing nothing.

    That is done only where nobody has set `sensor.widening` or `sensor.scales`, and for likelihoods that have
    scales. Also returns what the pictures show; None for a blind sensor or a library without its channels.
    """
    _check_signs(library, configuration.parameters.sensor)
    configuration = own_scaled(configuration, library, nearest)
    sensor = configuration.parameters.sensor
    library = equipped(library, sensor)
    model = SensorModel(library, nearest, sensor)
    if sensor.sharpness == 0 or not model.weights or any(name not in library.index for name in model.weights):
        return configuration, None
    table = LeftOutTable.of(model)
    scored = score_places(table, fit=is_sparse(nearest))
    origins = {setting.key: setting.origin for setting in configuration.settings}
    sources = [origins[key] for key in ("sensor.widening", "sensor.scales")]
    chosen = any(origin not in ("default", OWN_SCALES) for origin in sources)
    ours = (sensor.blend, sensor.likelihood) == ("calibrated", "exponential")
    if chosen or not ours or (scored.widening == 1 and not scored.stretched):
        return configuration, replace(scored, widening=1.0, stretched={})
    changed: dict[str, Any] = {"sensor.widening": scored.widening}
    if scored.stretched:
        scales = {name: sensor.scale_of(name) * factor for name, factor in scored.stretched.items()}
        fitted = replace(sensor, scales={**sensor.scales, **scales})
        score = score_places(replace(table, sensor=replace(model, parameters=fitted)))
        scored = replace(score, stretched=scored.stretched)
        factors = {name: scored.widening * factor for name, factor in scored.stretched.items()}
        scales = {name: sensor.scale_of(name) * factor for name, factor in factors.items()}
        scales = {**sensor.scales, **scales}
        changed = {"sensor.widening": scored.widening, "sensor.scales": scales}
    changes = {key: Setting(key, value, f"library {library.name}") for key, value in changed.items()}
    settings = tuple(changes.get(setting.key, setting) for setting in configuration.settings)
    widened = replace(sensor, widening=scored.widening, scales=changed.get("sensor.scales", sensor.scales))
    parameters = replace(configuration.parameters, sensor=widened)
    return replace(configuration, parameters=parameters, settings=settings), scored


def _check_signs(library: Library, sensor: SensorParameters) -> None:
    """Raise ValueError where numbers below 0 would be compared by a distance that takes none."""
    for name in library.index.keys() & sensor.distances.keys() - OUR_NAMES:
        distance = sensor.distances[name]
        if distance not in SIGNED and library.index[name].references.min(initial=0) < 0:
            expected = f"expected one of {', '.join(sorted(SIGNED))}: it has numbers below 0"
            raise ValueError(f"sensor.distances: found {distance!r} for {name}, {expected}")


OWN_SCALES = "the library's places"  # origin of the scales of the user's channels


def own_scaled(configuration: Configuration, library: Library, nearest: NearestReference) -> Configuration:
    """Give the user's channels that have no scale one that is fitted to the library's own pictures."""
    sensor = configuration.parameters.sensor
    own = [name for name in sensor.weights if isinstance(CHANNELS.get(name), OwnChannel)]
    scales = dict(sensor.scales)
    for name in own:
        if name not in scales and name in library.index:
            alone = replace(sensor, weights={name: 1.0}, blend="calibrated", scales={}, widening=1.0)
            scales[name] = fitted_scale(LeftOutTable.of(SensorModel(library, nearest, alone)))
    if scales == dict(sensor.scales):
        return configuration
    setting = Setting("sensor.scales", scales, OWN_SCALES)
    settings = tuple(setting if each.key == setting.key else each for each in configuration.settings)
    parameters = replace(configuration.parameters, sensor=replace(sensor, scales=scales))
    return replace(configuration, parameters=parameters, settings=settings)


def _sensor(library: Library, nearest: NearestReference, p: FilterParameters) -> SensorModel:
    channels = {name: weight for name, weight in p.sensor.weights.items() if name not in library.sensors}
    try:
        for name in channels:
            check_channel("sensor.weights", name)
    except ValueError as problem:
        raise KeyError(str(problem)) from None
    replace(p.sensor, weights=channels).check_names()
    sensors = {name: library.sensors[name] for name in p.sensor.weights if name in library.sensors}
    model = SensorModel(library, nearest, p.sensor, sensors=sensors, spread=_spread(library, nearest))
    if not {"nearest": False, "interpolated": True}[p.references.method] or not model.weights:
        return model
    poses, index, how = library.poses, {}, p.references.interpolation
    sources = model.sources
    if how.virtual:
        virtual = virtual_references(library.poses, library.arena, library.keep)
        poses = np.concatenate([library.poses, virtual.poses])
        index = virtual.extend({name: library.index[name] for name in model.weights})
        sources = virtual.sources
    lookup = interpolated_reference(nearest, poses, library.arena, how, library.keep)
    return replace(model, references=lookup, index=index, sources=sources)


def _spread(library: Library, nearest: NearestReference) -> PoseSpread:
    """Return how far the poses nearest to a reference lie from it, if they lie evenly around it."""
    headings = max(library.size / max(len(nearest.places), 1), 1.0)
    return PoseSpread(spacing(nearest.places) / np.sqrt(12), 2 * np.pi / headings / np.sqrt(12))


def _proposal(
    sensor: SensorModel, nearest: NearestReference, where: Regions, p: FilterParameters
) -> Proposal:
    mixed = p.recovery.strategy == "mixture"
    mixture = MixtureProposal(p.recovery.mixture, nearest, where) if mixed else None
    if can_propose(sensor.sensors.values()) and (mixed or p.guided_motion.share > 0):
        reach_m = TRACKED_M if sensor.library.is_map else nearest.spacing_m
        return GuidedProposal(p.guided_motion, reach_m, mixture)
    return mixture or MotionProposal()


def _resampling(p: ResamplingParameters) -> Resampling:
    kld = p.kld if p.adaptive else None
    return Resampling(resampler_of(p.scheme), POLICIES[p.when](p.below, p.every), p.roughening, kld)
