"""Layouts of one run: at a glance, an update from the inside, why the winner wins, what pose sensors read."""

from __future__ import annotations

import rerun.blueprint as rrb

from maurice_mcl.sensor.laser.sensor import LASER

from .. import entities
from ..panels import explanation as why
from ..panels import sensors as sensed
from ..panels.belief import belief_view, closeup_view
from ..panels.camera import named_view, seen_views
from ..panels.events import lanes_px, words_view
from ..panels.inside import AFTER, BEFORE, STRIP_PX, inside_words_view, phases_view, side_view
from ..panels.laser.explanation import columns_of_scan, scan_map_view
from ..panels.laser.scan import here_view
from ..panels.population import headings_view, weight_bars_view
from ..panels.references import best_references_view, circles_view, likelihood_views
from ..panels.story import HEIGHT_PX, OWN_LANES
from ..panels.traces import marks_key, run_plots
from ..panels.views import untitled
from ..scene import RunView, Scene
from .story import over_events

INSIDE_WORDS_PX = 78  # two lines
SENSOR_WORDS, SENSOR_PICTURES = 1.9, (3.4, 2.9)  # shares of a column: a few lines of text over the pictures
MARKS_PX = 54  # of the key of plots, in two rows
FIGURES_PX, FIGURE_PX = 188, 23  # of a table without channels, and of each channel's row
MAP_PERCENT = 40  # of the width: the map of a run


def overview(run: RunView, scene: Scene) -> rrb.Vertical:
    """Lay out the map over the words; right circles and camera, over the five best and two plots."""
    paths = run.paths
    left = _map_over_words(run, scene)
    maps = rrb.Tabs(circles_view(paths, scene), *likelihood_views(paths, run.channels, scene), active_tab=0)
    compared = rrb.Horizontal(maps, *seen_views([run]), column_shares=[1.25, 1])
    plots = run_plots(run, scene)
    rows = compared, best_references_view(paths, scene), rrb.Horizontal(*plots)
    right = rrb.Vertical(*rows, row_shares=[310, 178, 142])
    body = rrb.Horizontal(left, right, column_shares=[MAP_PERCENT, 100 - MAP_PERCENT])
    return untitled(over_events(body, [run], noticed=True), but=plots)


def inside_a_step(run: RunView, scene: Scene) -> rrb.Vertical:
    """Lay out the phases over two sentences; the cloud before and after, and the picture over the weights."""
    paths = run.paths
    seen = named_view("The robot sees", entities.CAMERA) if scene.has_pictures else headings_view(paths)
    seen = here_view(run) if run.sees_alone else seen
    beside = rrb.Vertical(seen, weight_bars_view(paths), row_shares=[52, 48])
    close_ups = [side_view(paths, side, sensed.scan_on_map(run)) for side in (BEFORE, AFTER)]
    clouds = rrb.Horizontal(*close_ups, beside, column_shares=[445, 445, 390])
    middle = HEIGHT_PX - lanes_px(OWN_LANES) - STRIP_PX - INSIDE_WORDS_PX
    body = rrb.Vertical(
        phases_view(), inside_words_view(paths), clouds, row_shares=[STRIP_PX, INSIDE_WORDS_PX, middle]
    )
    return untitled(over_events(body, [run], noticed=True))


def explain(run: RunView, scene: Scene) -> rrb.Vertical:
    """Lay out the map over the figures; right the sentences, over camera and references side by side.

    Of a robot with a laser alone: over the scan on the map, and its ranges.
    """
    paths = run.paths
    if run.sees_alone:
        left = rrb.Vertical(scan_map_view(run, scene), why.figures_view(paths), row_shares=[355, 220])
        right = rrb.Vertical(why.sentence_view(paths), columns_of_scan(run, scene), row_shares=[88, 487])
        body = rrb.Horizontal(left, right, column_shares=[MAP_PERCENT, 100 - MAP_PERCENT])
        return untitled(over_events(body, [run], noticed=True))
    figures = FIGURES_PX + FIGURE_PX * len(run.channels)
    above = HEIGHT_PX - lanes_px(OWN_LANES) - figures
    left = rrb.Vertical(
        why.references_map_view(paths, scene), why.figures_view(paths), row_shares=[above, figures]
    )
    whose = why.columns_of(scene.has_truth)
    cards = rrb.Horizontal(why.camera_card_view(run, scene), *(why.card_view(paths, who) for who in whose))
    charts = rrb.Horizontal(*(why.chart_view(paths, who) for who in (why.CAMERA_CARD, *whose)))
    right = rrb.Vertical(why.sentence_view(paths), cards, charts, row_shares=[176, 270, 167])
    body = rrb.Horizontal(left, right, column_shares=[MAP_PERCENT, 100 - MAP_PERCENT])
    return untitled(over_events(body, [run], noticed=True))


def sensors(run: RunView, scene: Scene) -> rrb.Vertical:
    """Lay out the map left; right the words and pictures of each sensor, over the errors."""
    paths = run.paths
    blocks = [_of_sensor(run, name) for name in run.sensors]
    right = blocks[0] if len(blocks) == 1 else rrb.Tabs(*blocks, active_tab=0)
    views: list[rrb.View] = [sensed.sensor_map_view(paths, scene, run.sensors)]
    in_3d = () if run.sensor is None else run.sensor.sensors.items()
    views += [
        sensed.sensor_space_view(paths, scene, name) for name, sensor in in_3d if sensed.in_space(sensor)
    ]
    left: rrb.View | rrb.Container = views[0] if len(views) == 1 else rrb.Tabs(*views, active_tab=0)
    plot = run_plots(run, scene)[0]
    left = rrb.Vertical(left, plot, marks_key(paths), row_shares=[400, 125, MARKS_PX])
    body = rrb.Horizontal(left, right, column_shares=[1, 1.1])
    return untitled(over_events(body, [run], noticed=True), but=[plot])


def _of_sensor(run: RunView, name: str) -> rrb.Container:
    pictures = [here_view(run)] if name == LASER else sensed.sensor_picture_views(run, name)
    shares = [SENSOR_WORDS, *(SENSOR_PICTURES * len(pictures))[: len(pictures)]]
    return rrb.Vertical(sensed.sensor_words_view(run.paths, name), *pictures, name=name, row_shares=shares)


def _map_over_words(run: RunView, scene: Scene) -> rrb.Vertical:
    """Lay out the map over the words, over the key of the plots beside it."""
    views = belief_view(run.paths, scene), words_view(run.paths), marks_key(run.paths)
    return rrb.Vertical(*views, row_shares=[370, 140, MARKS_PX])


def recorded(run: RunView, scene: Scene) -> rrb.Vertical:
    """Lay out another localizer's clouds: the map over the words; right the close-up over headings, plots."""
    paths = run.paths
    left = _map_over_words(run, scene)
    pictures = seen_views([run]) if scene.has_pictures else []
    scans = [] if scene.laser_of(run) is None else [here_view(run)]
    seen = rrb.Vertical(*pictures, *scans, headings_view(paths))
    close = rrb.Horizontal(closeup_view(paths, scene), seen, column_shares=[1.25 if scans else 1.6, 1])
    plots = run_plots(run, scene)
    right = rrb.Vertical(close, rrb.Horizontal(*plots), row_shares=[3.2, 1])
    body = rrb.Horizontal(left, right, column_shares=[MAP_PERCENT, 100 - MAP_PERCENT])
    return untitled(over_events(body, [run], noticed=True), but=plots)
