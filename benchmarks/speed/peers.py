"""The peers' side of the filter benchmark: their own environment, and a process that runs them there."""

from __future__ import annotations

import json
import subprocess
import sys
import venv
from pathlib import Path
from types import TracebackType

import numpy as np

from maurice_mcl.sensor.references import NearestReference
from maurice_mcl.values.arrays import F64

PEERS = {"filterpy": "filterpy", "particles": "particles", "pfilter": "pfilter", "stonesoup": "stonesoup"}
HERE = Path(__file__).parent
ENVIRONMENT = HERE.parents[1] / ".venv-peers"


def install(environment: Path = ENVIRONMENT) -> dict[str, str]:
    """Install every peer that can be had; return the version of each, or why it is missing."""
    python = environment / "bin" / "python"
    if not python.exists():
        venv.create(environment, with_pip=True)
    versions = {}
    for name, package in PEERS.items():
        have = _version(python, package)
        if not have:
            pip = [str(python), "-m", "pip", "install", "--quiet", package]
            done = subprocess.run(pip, capture_output=True, text=True, check=False)
            why = (done.stderr.strip().splitlines() or ["pip failed"])[-1]
            have = _version(python, package) or f"missing: {why}"
        versions[name] = have
    return versions


def _version(python: Path, package: str) -> str:
    code = f"from importlib.metadata import version; print(version({package!r}))"
    return subprocess.run(
        [str(python), "-c", code], capture_output=True, text=True, check=False
    ).stdout.strip()


class PeerProcess:
    """A process in the peers' environment that runs one step at a time."""

    def __init__(self, folder: Path, reference: NearestReference, likelihood: F64, origin: F64) -> None:
        """Start it with what all look up: a library's tables, and the likelihood (L,) of a picture."""
        tables, grid = folder / "tables.npz", reference.grid
        np.savez(
            tables,
            place=reference.place_of_cell,
            entry_of=reference.entry_of,
            likelihood=likelihood,
            corner=grid.corner - origin,
            cell_m=grid.cell_m,
            shape=np.array(grid.shape),
        )
        command = [str(ENVIRONMENT / "bin" / "python"), str(HERE / "peer_filters.py"), str(tables)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def step(self, peer: str, particles: int, scheme: str) -> float:
        """Return the seconds that one step of a peer took. RuntimeError where it fails."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        asked = {"peer": peer, "particles": particles, "scheme": scheme}
        self._process.stdin.write(json.dumps(asked) + "\n")
        self._process.stdin.flush()
        answer = json.loads(self._process.stdout.readline())
        if "problem" in answer:
            raise RuntimeError(f"{peer}: {answer['problem']}")
        return float(answer["seconds"])

    def __enter__(self) -> PeerProcess:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        problem: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


if __name__ == "__main__":
    for peer, what in install().items():
        sys.stdout.write(f"{peer} {what}\n")
