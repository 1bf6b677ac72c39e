"""All panels of a run, in the order in which they are drawn. A new panel is a new file and one line here."""

from __future__ import annotations

from collections.abc import Callable

from ..scene import RunView, Scene
from .belief import CloseupPanel, CloudPanel, EllipsesPanel, EstimatePanel, FreshPanel
from .camera import CameraPanel
from .events import EventsPanel, WordsPanel
from .explanation import ExplanationPanel
from .histograms import HistogramsPanel
from .panel import Panel
from .population import AncestryPanel, HeadingsPanel, ModesPanel
from .references import BestReferencesPanel, LikelihoodPanel, MatchCirclesPanel
from .sensors import SensorsPanel
from .story import ErrorLinePanel, LimitsPanel
from .traces import TracesPanel
from .world import KeysPanel, TruthPanel, WorldPanel

PanelMaker = Callable[[RunView, Scene], Panel]

OF_THE_SCENE: tuple[PanelMaker, ...] = (
    WorldPanel,
    TruthPanel,
    CameraPanel,
    LimitsPanel,
)  # once for all runs
OF_A_RUN: tuple[PanelMaker, ...] = (
    KeysPanel,
    CloudPanel,
    FreshPanel,
    CloseupPanel,
    AncestryPanel,
    MatchCirclesPanel,
    BestReferencesPanel,
    HistogramsPanel,
    EstimatePanel,
    EllipsesPanel,
    ErrorLinePanel,
    HeadingsPanel,
    ModesPanel,
    TracesPanel,
    ExplanationPanel,
    SensorsPanel,
    EventsPanel,
    WordsPanel,
)
OF_REFERENCES: tuple[PanelMaker, ...] = (LikelihoodPanel,)  # where the library has entries


OF_CHANNELS: frozenset[PanelMaker] = frozenset(
    (MatchCirclesPanel, BestReferencesPanel, HistogramsPanel, ExplanationPanel)
)  # which a robot without a camera has not


def panels_of(run: RunView, scene: Scene) -> list[Panel]:
    """Return the panels of a run; the first run has those of the scene, too."""
    makers = [*(OF_THE_SCENE if run.number == 0 else ()), *OF_A_RUN]
    makers += OF_REFERENCES if scene.library.size else ()
    blind = bool(run.sensors) and not run.channels
    return [make(run, scene) for make in makers if not (blind and make in OF_CHANNELS)]
