"""All panels of a run, in the order in which they are drawn. A new panel is a new file and one line here."""

from __future__ import annotations

import rerun.blueprint as rrb

from ..scene import RunView, Scene
from .belief import CloseupPanel, CloudPanel, EllipsesPanel, EstimatePanel
from .camera import CameraPanel, HerePanel
from .events import WordsPanel
from .explanation import ExplanationPanel
from .inside import InsidePanel, PhasesPanel
from .laser.explanation import ScanExplanationPanel
from .laser.scan import ScanPanel
from .panel import Panel
from .population import HeadingsPanel, ModesPanel, WeightBarsPanel
from .references import BestReferencesPanel, LikelihoodPanel, MatchCirclesPanel
from .sensors import SensorsPanel
from .story import LimitsPanel
from .traces import TracesPanel
from .world import KeysPanel, TruthPanel, WorldPanel

OF_THE_SCENE: tuple[type[Panel], ...] = (
    WorldPanel,
    TruthPanel,
    CameraPanel,
    LimitsPanel,
    PhasesPanel,
)  # once for all runs
OF_A_RUN: tuple[type[Panel], ...] = (
    KeysPanel,
    CloudPanel,
    CloseupPanel,
    InsidePanel,
    WeightBarsPanel,
    MatchCirclesPanel,
    BestReferencesPanel,
    HerePanel,
    EstimatePanel,
    EllipsesPanel,
    HeadingsPanel,
    ModesPanel,
    TracesPanel,
    ExplanationPanel,
    SensorsPanel,
    ScanPanel,
    ScanExplanationPanel,
    WordsPanel,
)
OF_REFERENCES: tuple[type[Panel], ...] = (LikelihoodPanel,)  # where the library has entries


OF_CHANNELS: frozenset[type[Panel]] = frozenset(
    (MatchCirclesPanel, BestReferencesPanel, ExplanationPanel)
)  # which a robot without a camera has not
OF_FILTERS: frozenset[type[Panel]] = frozenset((InsidePanel, WeightBarsPanel))  # not of recorded runs


def panels_of(run: RunView, scene: Scene) -> list[Panel]:
    """Return the panels of a run; the first run has those of the scene, too."""
    kinds = [*(OF_THE_SCENE if run.number == 0 else ()), *OF_A_RUN]
    kinds += OF_REFERENCES if scene.library.size else ()
    left_out = set[type[Panel]](() if scene.compares_pictures(run) else (HerePanel,))
    left_out |= OF_CHANNELS if run.sensors and not run.channels else OF_FILTERS if run.is_recorded else set()
    return [kind(run, scene) for kind in kinds if kind not in left_out]


def views_of(run: RunView, scene: Scene) -> list[rrb.View]:
    """Return the views that panels of a run have of their own."""
    views = [panel.view(run, scene) for panel in OF_A_RUN]
    return [view for view in views if view is not None]
