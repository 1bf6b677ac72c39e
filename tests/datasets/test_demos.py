"""The demo's drives come from the cache without the simulator."""

from __future__ import annotations

import json
import subprocess
import sys

from maurice_datasets import demos, sessions
from maurice_datasets.folders import seal
from maurice_datasets.tasks import simulation_key
from maurice_loaders.files.writing import cache_root


def test_keys_are_those_of_the_plans():
    plan = sessions.kidnapping_plan()
    key = simulation_key(plan.task.name, plan.arena_seed, plan.seed, plan.updates)
    assert key == simulation_key("kidnapped", demos.DEMO, demos.KIDNAPPING_SEED, demos.KIDNAPPING_UPDATES)


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
