"""Make the picture of docs/share.md: .venv/bin/python docs/make_report.py. Needs Chromium."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

PICTURE = Path(__file__).parent / "pictures" / "report.png"
COMMAND = [sys.executable, "-c", "from maurice_viz.cli.main import main; main()"]
SIZE = "1200,2560"
STEPS = (
    ("simulate", "kidnapped", "-o", "drive", "--tier", "hard", "--seed", "3", "--updates", "100"),
    ("compare", "drive/session.log", "--preset", "thesis", "--preset", "robust", "--save-run", "both",
     "-o", "none"),
    ("report", "both", "-o", "report.html"),
)  # fmt: skip


def main() -> None:
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        sys.exit("found no Chromium; apt-get install chromium")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for step in STEPS:
            subprocess.run([*COMMAND, *step], cwd=folder, check=True, capture_output=True)
        options = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"]
        options += [f"--user-data-dir={folder / 'profile'}", f"--window-size={SIZE}"]
        page = (folder / "report.html").as_uri()
        shot = [browser, *options, f"--screenshot={PICTURE}", page]
        subprocess.run(shot, cwd=folder, check=True, capture_output=True)
    print(PICTURE)


if __name__ == "__main__":
    main()
