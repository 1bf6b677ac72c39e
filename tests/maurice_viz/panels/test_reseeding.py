"""What a step that draws particles anew looks like in a recording."""

from pathlib import Path

import numpy as np

from helpers import viz_fakes as fakes
from helpers import viz_recordings as recordings
from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import Layer, configure
from maurice_mcl.filter.localizer import run
from maurice_viz import entities
from maurice_viz.entities import Phase, RunPaths
from maurice_viz.layouts.registry import runs_blueprint
from maurice_viz.panels.belief import PARTICLE
from maurice_viz.panels.observer import RerunObserver
from maurice_viz.scene import RunView, SceneInfo
from maurice_viz.style import scale_for
from maurice_viz.text import narration as narrate
from maurice_viz.viewer import sinks

SHARE = 0.25


def _records(session: fakes.FakeSession) -> recordings.Played:
    always = {
        "particles": 40,
        "sensor.weights": {"color": 1.0},
        "recovery.strategy": "always",
        "recovery.share": SHARE,
    }
    parameters = configure([Layer("test", always)]).parameters
    return list(run(build_localizer(session.library, session, parameters), session, None))


def test_fresh_particles_stand_out_in_their_own_phase(tmp_path: Path) -> None:
    session = fakes.make_session(fakes.make_library(), 3)
    library, played = session.library, _records(session)
    path = tmp_path / "reseeded.rrd"
    shown = SceneInfo(library.arena, scale_for("in", library.arena), True)
    layout = runs_blueprint([RunView("color", ("color",))], shown)
    with sinks.to_file(path, "x", layout) as rec:
        observer = RerunObserver(rec, "color", {"color": "hellinger"})
        recordings.observe(observer, session.info, library, played)
    rows = recordings.rows(path, RunPaths("color").particles)
    for step, (_, record) in enumerate(played, start=1):
        at = {slot: entities.phase_number(step, slot) for slot in Phase}
        survivors = next(row for row in rows if row.phase == at[Phase.RESAMPLE])
        everyone = next(row for row in rows if row.phase == at[Phase.RESEED])
        assert len(survivors.values["Points2D:radii"]) == 40
        assert "Points2D:positions" not in survivors.values
        assert len(everyone.values["Points2D:positions"]) == 40
        assert record.injected is not None
        radii = np.array(everyone.values["Points2D:radii"])
        assert (np.abs(radii) > PARTICLE).sum() == record.injected.sum() == 40 * SHARE
        said = narrate.phase(played[step - 1][0], record, Phase.RESEED, scale_for("in", library.arena))
        assert "10 of 40 particles were drawn anew" in said
