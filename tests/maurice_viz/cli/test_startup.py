"""What commands do to start sooner."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from maurice_viz.cli.app import COMMANDS

HEAVY = (
    "rerun",
    "matplotlib",
    "pandas",
    "jinja2",
    "av",
    "dask",
    "scipy.signal",
    "scipy.stats",
    "scipy.optimize",
)


def _seen(code: str) -> dict[str, object]:
    """Run code in a fresh Python and return what it has put into `seen`."""
    told = subprocess.run(
        [sys.executable, "-c", f"import json, sys\nseen = {{}}\n{code}\nprint(json.dumps(seen))"],
        check=True,
        capture_output=True,
        text=True,
    )
    return dict(json.loads(told.stdout))


def test_pyarrow_does_not_import_pandas_until_somebody_asks_for_its_tables():
    pytest.importorskip("pandas")
    seen = _seen(
        "import pyarrow as pa\n"
        "from maurice_viz.cli.shared.startup import skip_pandas\n"
        "skip_pandas()\n"
        "pa.array([0.5]), pa.table({'a': [1]})\n"
        "seen['early'] = 'pandas' in sys.modules\n"
        "seen['cell'] = int(pa.table({'a': [1]}).to_pandas().a[0])\n"
        "import pandas\n"
        "seen['missing'] = pa.array(pandas.Series([1.0, float('nan')])).null_count\n"
    )
    assert seen == {"early": False, "cell": 1, "missing": 1}


def test_no_command_imports_rerun_matplotlib_or_templates_before_it_is_called():
    seen = _seen(
        "from maurice_viz.cli.app import COMMANDS, load\n"
        "for name, one in COMMANDS.items():\n"
        "    load(one)\n"
        f"    seen[name] = [one for one in {HEAVY!r} if one in sys.modules]\n"
    )
    assert seen == {name: [] for name in COMMANDS}
