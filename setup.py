"""What pyproject.toml cannot say: the packages below the four folders, and a README that renders anywhere."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from setuptools import setup

ROOT = Path(__file__).parent
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
REPOSITORY = SETTINGS["project"]["urls"]["Repository"]
LINK = re.compile(r"(!?)(\[[^\]]*\])\((?!\w+:)([^)]+)\)")  # a Markdown link without a scheme


def packages() -> list[str]:
    """Return the dotted names of all folders with a file; folders of data count, as setuptools expects."""
    names = set()
    for package, folder in SETTINGS["tool"]["setuptools"]["package-dir"].items():
        for file in (ROOT / folder).rglob("*.*"):
            if file.suffix != ".pyc" and file.is_file():
                names.add(".".join([package, *file.parent.relative_to(ROOT / folder).parts]))
    return sorted(names)


def absolute(link: re.Match[str]) -> str:
    """Return a link of README.md as one that leads to the repository from anywhere."""
    picture, words, target = link.groups()
    page = f"README.md{target}" if target.startswith("#") else target
    return f"{picture}{words}({REPOSITORY}/{'raw' if picture else 'blob'}/main/{page})"


setup(
    packages=packages(),
    long_description=LINK.sub(absolute, (ROOT / "README.md").read_text(encoding="utf-8")),
    long_description_content_type="text/markdown",
)
