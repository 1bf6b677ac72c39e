"""The Python of docs/tasks.md runs as it stands there, one block after another."""

from __future__ import annotations

import os
import subprocess
import sys

from helpers.pages import ROOT, steps_of
from maurice_datasets.sessions import demo_plan, write_simulation


def test_all_tasks_run_in_one_script(tmp_path):
    blocks = [step.text for step in steps_of("docs/tasks.md") if step.is_python]
    assert len(blocks) == 1 + (ROOT / "docs" / "tasks.md").read_text().count("\n## ")
    write_simulation(tmp_path / "my-demo", demo_plan(updates=45))
    script = tmp_path / "tasks.py"
    text = "\n\n".join(blocks).replace("seeds=20", "seeds=2")  # as true with fewer
    script.write_text(text)
    env = os.environ | {"PYTHONPATH": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, script], cwd=tmp_path, env=env, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("the same, all 45 steps to the last bit") == 2
    assert (tmp_path / "kept.html").stat().st_size > 10_000
