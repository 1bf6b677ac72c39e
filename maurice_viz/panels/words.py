"""What each step did, in words."""

from __future__ import annotations

import rerun as rr
import rerun.blueprint as rrb

from ..entities import Phase, RunPaths
from ..style import font_safe
from ..text import narration
from .panel import MARKDOWN, DrawnRun, Panel, StepUpdate, set_phase, set_phase_only

NOT_WHOLE = " · only partly drawn, see `--detail`"


class WordsPanel(Panel):
    """Logs a text for every phase, and a summary at the end of the step."""

    def __init__(self, run: DrawnRun) -> None:
        self._path, self._scale = run.paths.text, run.scale

    def prepare(self, rec: rr.RecordingStream) -> None:
        """Log what kind of text will come."""
        rec.log(self._path, rr.TextDocument.from_fields(media_type=MARKDOWN), static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        """Log the texts of one update."""
        moment, record = update.moment, update.record
        if update.whole:
            for phase in (Phase.PREDICT, Phase.MEASURE, Phase.WEIGHT):
                set_phase(rec, moment, phase)
                self._log(rec, narration.phase(moment, record, phase, self._scale))
            for phase in (Phase.RESAMPLE, Phase.RESEED)[: 1 + update.is_reseeded]:
                set_phase_only(rec, moment, phase)
                self._log(rec, narration.phase(moment, record, phase, self._scale))
        set_phase(rec, moment, Phase.ESTIMATE)
        title, rest = narration.summary(moment, record, self._scale).split("\n\n", 1)
        self._log(rec, f"{title}{'' if update.whole else NOT_WHOLE}\n\n{rest}")

    def _log(self, rec: rr.RecordingStream, text: str) -> None:
        rec.log(self._path, rr.TextDocument.from_fields(text=font_safe(text)))


def words_view(paths: RunPaths, title: str = "What this step did") -> rrb.TextDocumentView:
    """Show in words what happened."""
    return rrb.TextDocumentView(name=title, origin=paths.text)
