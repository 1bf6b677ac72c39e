"""What commands do to start sooner."""

from __future__ import annotations

import subprocess
import sys

import pytest


def test_pyarrow_does_not_import_pandas_until_somebody_asks_for_its_tables():
    pytest.importorskip("pandas")
    code = (
        "import sys, pyarrow as pa\n"
        "from maurice_viz.cli.shared.startup import skip_pandas\n"
        "skip_pandas()\n"
        "pa.array([0.5]), pa.table({'a': [1]})\n"
        "assert 'pandas' not in sys.modules\n"
        "assert pa.table({'a': [1]}).to_pandas().a[0] == 1\n"
        "import pandas\n"
        "assert pa.array(pandas.Series([1.0, float('nan')])).null_count == 1\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
