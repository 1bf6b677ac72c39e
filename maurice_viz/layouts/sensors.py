"""What the pose sensors of a run read: the map with their marks, their pictures, their words."""

from __future__ import annotations

import rerun.blueprint as rrb

from ..panels.sensors import (
    in_space,
    sensor_map_view,
    sensor_picture_views,
    sensor_space_view,
    sensor_words_view,
)
from ..panels.traces import single_plots
from ..scene import RunView, Scene
from .story import over_events

WORDS, PICTURES = 1.0, (3.6, 3.0)  # shares of a column: a few lines of text over the pictures


def sensors(run: RunView, scene: Scene) -> rrb.Vertical:
    """Lay out the map left; right the words and pictures of each sensor, or the distances."""
    paths = run.paths
    blocks = [_of_sensor(run, name) for name in run.sensors]
    right = blocks[0] if len(blocks) == 1 else rrb.Tabs(*blocks, active_tab=0)
    views: list[rrb.View] = [sensor_map_view(paths, scene, run.sensors)]
    known = {} if run.sensor is None else run.sensor.sensors
    views += [sensor_space_view(paths, scene, name) for name, one in known.items() if in_space(one)]
    left = views[0] if len(views) == 1 else rrb.Tabs(*views, active_tab=0)
    distances = single_plots(paths, scene)[0]
    column = rrb.Vertical(left, distances, row_shares=[2.6, 1])
    return over_events(rrb.Horizontal(column, right, column_shares=[1, 1.1]), [run])


def _of_sensor(run: RunView, name: str) -> rrb.Container:
    pictures = sensor_picture_views(run, name)
    shares = [WORDS, *(PICTURES * len(pictures))[: len(pictures)]]
    return rrb.Vertical(sensor_words_view(run.paths, name), *pictures, name=name, row_shares=shares)
