"""Layouts of one run: at a glance, an update from the inside, why the winner wins, what pose sensors read."""

from __future__ import annotations

import numpy as np
import rerun.blueprint as rrb

from .. import entities
from ..drawing.canvas import map_extent
from ..panels.belief import belief_view, closeup_view
from ..panels.camera import camera_view, difference_views, edges_view, histogram_views, named_view
from ..panels.events import lanes_px, words_view
from ..panels.explanation import (
    CAMERA_CARD,
    column_view,
    columns_of,
    figures_view,
    references_map_view,
    sentence_view,
)
from ..panels.inside import AFTER, BEFORE, STRIP_PX, inside_words_view, phases_view, side_view
from ..panels.population import headings_view, weight_bars_view
from ..panels.references import best_references_view, circles_view, likelihood_views
from ..panels.sensors import (
    in_space,
    sensor_map_view,
    sensor_picture_views,
    sensor_space_view,
    sensor_words_view,
)
from ..panels.traces import single_plots
from ..panels.views import untitled
from ..scene import RunView, Scene
from .story import HEIGHT_PX, OWN_LANES, over_events

INSIDE_WORDS_PX = 78  # two lines
SENSOR_WORDS, SENSOR_PICTURES = 1.0, (3.6, 3.0)  # shares of a column: a few lines of text over the pictures
LEFT_SHARE = 1.45  # how much higher than the figures a square map is


def overview(run: RunView, scene: Scene) -> rrb.Vertical:
    """Lay out the arena and the words left, matching in the middle, pictures and traces right."""
    paths = run.paths
    distances, *others = single_plots(paths, scene)
    left = rrb.Vertical(
        belief_view(paths, scene),
        words_view(paths),
        distances,
        row_shares=[2.2, 0.95, 0.9],
    )
    middle = rrb.Vertical(
        rrb.Tabs(circles_view(paths, scene), *likelihood_views(paths, run.channels, scene), active_tab=0),
        rrb.Tabs(*histogram_views(paths, run.channels), active_tab=0),
        rrb.Tabs(*difference_views(paths, run.channels), active_tab=0),
        row_shares=[1.85, 1, 1],
    )
    right = rrb.Vertical(
        rrb.Horizontal(camera_view(), edges_view()),
        best_references_view(paths, scene),
        *others,
        row_shares=[1.3, 0.8] + [2 / len(others)] * len(others),
    )
    body = rrb.Horizontal(left, middle, right, column_shares=[1.2, 1, 1])
    return over_events(body, [run], noticed=True)


def inside_a_step(run: RunView, scene: Scene) -> rrb.Vertical:
    """Lay out the phases over two sentences; the cloud before and after, and the picture over the weights."""
    paths = run.paths
    seen = named_view("The robot sees", entities.CAMERA) if run.channels else headings_view(paths)
    beside = rrb.Vertical(seen, weight_bars_view(paths), row_shares=[52, 48])
    close_ups = [side_view(paths, side, scene) for side in (BEFORE, AFTER)]
    clouds = rrb.Horizontal(*close_ups, beside, column_shares=[445, 445, 390])
    middle = HEIGHT_PX - lanes_px(OWN_LANES) - STRIP_PX - INSIDE_WORDS_PX
    body = rrb.Vertical(
        phases_view(), inside_words_view(paths), clouds, row_shares=[STRIP_PX, INSIDE_WORDS_PX, middle]
    )
    return untitled(over_events(body, [run], noticed=True))


def explain(run: RunView, scene: Scene) -> rrb.Vertical:
    """Lay out the map and the figures left; the sentence right, over camera and references side by side."""
    paths = run.paths
    extent = map_extent(scene.arena, scene.scale)
    map_share = float(np.clip(LEFT_SHARE * extent.height / extent.width, 1.0, 2.6))  # as its shape needs
    table_share = 0.65 + 0.1 * len(run.channels)
    left = rrb.Vertical(
        references_map_view(paths, scene),
        figures_view(paths),
        row_shares=[map_share, table_share],
    )
    columns = [column_view(paths, who) for who in (CAMERA_CARD, *columns_of(scene.has_truth))]
    right = rrb.Vertical(sentence_view(paths), rrb.Horizontal(*columns), row_shares=[1, 2.6])
    return over_events(rrb.Horizontal(left, right, column_shares=[1, 1.6]), [run])


def sensors(run: RunView, scene: Scene) -> rrb.Vertical:
    """Lay out the map left; right the words and pictures of each sensor, or the distances."""
    paths = run.paths
    blocks = [_of_sensor(run, name) for name in run.sensors]
    right = blocks[0] if len(blocks) == 1 else rrb.Tabs(*blocks, active_tab=0)
    views: list[rrb.View] = [sensor_map_view(paths, scene, run.sensors)]
    sensors = {} if run.sensor is None else run.sensor.sensors
    in_3d = [name for name, sensor in sensors.items() if in_space(sensor)]
    views += [sensor_space_view(paths, scene, name) for name in in_3d]
    left = views[0] if len(views) == 1 else rrb.Tabs(*views, active_tab=0)
    distances = single_plots(paths, scene)[0]
    column = rrb.Vertical(left, distances, row_shares=[2.6, 1])
    return over_events(rrb.Horizontal(column, right, column_shares=[1, 1.1]), [run])


def _of_sensor(run: RunView, name: str) -> rrb.Container:
    pictures = sensor_picture_views(run, name)
    shares = [SENSOR_WORDS, *(SENSOR_PICTURES * len(pictures))[: len(pictures)]]
    return rrb.Vertical(sensor_words_view(run.paths, name), *pictures, name=name, row_shares=shares)


def recorded(run: RunView, scene: Scene) -> rrb.Vertical:
    """Lay out another localizer's clouds: the arena and the words left, the close-up, traces right."""
    paths = run.paths
    left = rrb.Vertical(belief_view(paths, scene), words_view(paths), row_shares=[2.2, 0.95])
    middle = rrb.Vertical(closeup_view(paths, scene))
    seen = rrb.Horizontal(*([camera_view()] if scene.has_pictures else []), headings_view(paths))
    plots = single_plots(paths, scene)
    right = rrb.Vertical(seen, *plots, row_shares=[1.3] + [2.8 / len(plots)] * len(plots))
    body = rrb.Horizontal(left, middle, right, column_shares=[1.2, 1, 1])
    return over_events(body, [run], noticed=True)
