"""All layouts by name: tabs of one blueprint, so that the viewer can switch between them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import rerun.blueprint as rrb

from ..panels.registry import views_of
from ..panels.views import FPS, window
from ..scene import RunView, Scene
from ..style import font_safe_names
from . import LIGHT_NAMES, one_run
from .compare import compare
from .story import recorded_traces, story, traces

EXPLAIN, SENSORS, MORE = "explain", "sensors", "more"
OF_CHANNELS = ("overview",)  # layouts about channels and their references

Layout = Callable[[Sequence[RunView], Scene], rrb.Container]


def _a_tab_a_run(
    one: Callable[[RunView, Scene], rrb.Container], has: Callable[[RunView], object] = bool
) -> Layout:
    """Return a layout of several runs, one tab per run that `has` what it shows, from that of one run."""

    def layout(runs: Sequence[RunView], scene: Scene) -> rrb.Container:
        if len(runs) == 1:
            return one(runs[0], scene)
        tabs = [_named(one(run, scene), run.label) for run in runs if has(run)]
        return rrb.Tabs(*tabs, active_tab=0)

    return layout


def _named(container: rrb.Container, name: str) -> rrb.Container:
    container.name = name
    return container


def _is_explained(run: RunView) -> object:
    return run.channels or run.sees_alone


LAYOUTS: Mapping[str, Layout] = {
    "story": story,
    "overview": _a_tab_a_run(one_run.overview, lambda run: run.channels),
    "inside-a-step": _a_tab_a_run(one_run.inside_a_step),
    EXPLAIN: _a_tab_a_run(one_run.explain, _is_explained),
    SENSORS: _a_tab_a_run(one_run.sensors, lambda run: run.sensors),
    "compare": compare,
    "traces": traces,
    MORE: _a_tab_a_run(lambda run, scene: rrb.Grid(*views_of(run, scene))),
}
RECORDED: Mapping[str, Layout] = {
    "compare": compare,
    "overview": _a_tab_a_run(one_run.recorded),
    "traces": recorded_traces,
}


def _fits(name: str, runs: Sequence[RunView], scene: Scene) -> bool:
    """Return whether a layout's panels are filled: by channels, by pose sensors, by views of panels' own."""
    if name == SENSORS:
        return any(run.sensors for run in runs)
    if name == EXPLAIN:
        return any(map(_is_explained, runs))
    if name == MORE:
        return any(views_of(run, scene) for run in runs)
    return name not in OF_CHANNELS or any(run.channels for run in runs)


def tabs_of(runs: Sequence[RunView], scene: Scene) -> tuple[Mapping[str, Layout], list[str]]:
    """Return the layouts that runs can have, and the names of those whose panels are filled."""
    layouts = RECORDED if all(run.is_recorded for run in runs) else LAYOUTS
    names = [name for name in layouts if name != "compare" or len(runs) > 1]
    return layouts, [name for name in names if layouts is RECORDED or _fits(name, runs, scene)]


def runs_blueprint(
    runs: Sequence[RunView],
    scene: Scene,
    first: str | None = None,
    *,
    light: bool = False,
) -> rrb.Blueprint:
    """Return a blueprint with one tab per layout, the tab `first` open.

    `light` leaves out those with panels that little detail does not fill. Raises ValueError if `first` is
    not one of the tabs.
    """
    layouts, names = tabs_of(runs, scene)
    if light and layouts is LAYOUTS:
        names = [name for name in names if name in LIGHT_NAMES]
    chosen = first or names[0]
    tabs = [_named(layouts[name](runs, scene), name) for name in names]
    for tab in tabs:
        font_safe_names(tab)
    body = rrb.Tabs(*tabs, active_tab=names.index(chosen))
    return window(body, play_state="following" if scene.live else "paused", fps=FPS)
