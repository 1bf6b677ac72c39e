"""The demo's drives come from the cache without the simulator."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np

import maurice_mcl as mcl
from maurice_datasets import demos, sessions
from maurice_datasets.folders import seal
from maurice_datasets.tasks import simulation_key
from maurice_loaders.files.writing import cache_root
from maurice_loaders.formats.registry import open_session
from maurice_loaders.libraries.store import open_library
from maurice_mcl.config.build import make_localizer

PRESETS = ("amcl", "laser")


def test_keys_are_those_of_the_plans():
    plan = sessions.kidnapping_plan()
    key = simulation_key(plan.task.name, plan.arena_seed, plan.seed, plan.updates)
    assert key == simulation_key("kidnapped", demos.DEMO, demos.KIDNAPPING_SEED, demos.KIDNAPPING_UPDATES)


def test_amcl_keeps_its_place_in_the_lasers_demo_until_it_is_carried_and_ours_finds_it_again():
    """As AMCL's users know it: tracked from its given start, and lost for good without its recovery."""
    plan = sessions.laser_plan()
    key = simulation_key("kidnapped", demos.DEMO, demos.LASER_SEED, demos.LASER_UPDATES, laser=True)
    assert key == simulation_key(plan.task.name, plan.arena_seed, plan.seed, plan.updates, laser=plan.laser)
    paths = demos.laser_paths()
    session, library = open_session(paths.session), open_library(paths.survey)
    runs = {preset: mcl.table(mcl.run(make_localizer(library, preset=preset), session)) for preset in PRESETS}
    carried = int(np.flatnonzero(runs["amcl"].kidnapped)[0])
    assert 60 < carried < runs["amcl"].updates < 120  # as many steps as make a story
    assert runs["amcl"].is_localized[:carried].mean() > 0.9
    assert runs["amcl"].error_m[:carried].max() < 0.2
    assert runs["amcl"].is_off[carried:].all()
    assert runs["laser"].is_localized[:carried].all()
    assert runs["laser"].is_localized[carried + 1 :].all()
    assert paths.session.stat().st_size < 2e6


def test_a_cached_demo_does_not_import_the_simulator(monkeypatch, tmp_path):
    monkeypatch.setenv("MAURICE_CACHE", str(tmp_path))
    key = simulation_key("kidnapped", demos.DEMO, demos.KIDNAPPING_SEED, demos.KIDNAPPING_UPDATES)
    folder = cache_root() / "demos" / key
    folder.mkdir(parents=True)
    (folder / "session.log").write_text("{}\n")
    seal(folder, key)
    code = "import json, sys; from maurice_datasets.demos import kidnapping_paths; kidnapping_paths()"
    code += "; print(json.dumps(list(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    loaded = json.loads(done.stdout)
    assert not [name for name in loaded if name.startswith(("maurice_datasets.robot", "scipy", "polars"))]
    assert folder.is_dir()
