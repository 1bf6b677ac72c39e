"""AMCL's and MRPT's filters for a laser, built where there is a compiler and their sources can be had."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tarfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import compose
from maurice_mcl.values.laser import FREE, OCCUPIED
from maurice_mcl.values.library import Library
from maurice_mcl.values.session import Moment

from .peers import ENVIRONMENT, HERE

BUILT = ENVIRONMENT / "laser"
AMCL = "amcl==0.1.2"  # its source distribution: C and C++ of Nav2, without ROS
MRPT_ROOT = Path("/")  # below which Debian's libmrpt-slam-dev is
MRPT = (
    "slam",
    "obs",
    "maps",
    "bayes",
    "poses",
    "math",
    "random",
    "core",
    "system",
    "serialization",
    "rtti",
    "containers",
)
FLAGS = ("-O3", "-w", "-DNDEBUG")


@dataclass(frozen=True, slots=True)
class Peer:
    """A program that runs a filter over a drive, or why there is none."""

    name: str
    program: Path | None
    problem: str = ""

    def times(self, drive: Path, model: str, particles: int) -> tuple[F64, float]:
        """Return the seconds of processor time of every update (U,), and the mean error in meters."""
        assert self.program is not None
        command = [str(self.program), str(drive), model, str(particles)]
        lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
        return np.array(lines[:-1], np.float64), float(lines[-1])


def built(mrpt_root: Path = MRPT_ROOT) -> list[Peer]:
    """Build what can be built, once; the others say why not."""
    BUILT.mkdir(parents=True, exist_ok=True)
    if shutil.which("g++") is None or shutil.which("gcc") is None:
        return [Peer(name, None, "found no compiler (g++, gcc)") for name in ("AMCL", "MRPT")]
    return [_built("AMCL", _build_amcl), _built("MRPT", lambda program: _build_mrpt(program, mrpt_root))]


def _built(name: str, build: Callable[[Path], None]) -> Peer:
    program = BUILT / f"peer_{name.lower()}"
    try:
        if not program.exists():
            build(program)
    except (OSError, subprocess.CalledProcessError) as problem:
        why = getattr(problem, "stderr", None) or str(problem)
        return Peer(name, None, why.strip().splitlines()[-1])
    started = subprocess.run([program], capture_output=True, text=True, check=False)
    if started.stderr:  # by the loader, of libraries that are not there
        return Peer(name, None, started.stderr.strip().splitlines()[-1])
    return Peer(name, program)


def _run(*words: object) -> None:
    subprocess.run(list(map(str, words)), capture_output=True, text=True, check=True)


def _build_amcl(program: Path) -> None:
    if not list(BUILT.glob("amcl-*.tar.gz")):
        _run(sys.executable, "-m", "pip", "download", "--no-deps", "--no-binary", "amcl", "-d", BUILT, AMCL)
    (archive,) = BUILT.glob("amcl-*.tar.gz")
    with tarfile.open(archive) as files:
        files.extractall(BUILT, filter="data")
    root = BUILT / archive.name.removesuffix(".tar.gz")
    wanted = ("pf/pf", "pf/eig3", "pf/pf_kdtree", "pf/pf_pdf", "pf/pf_vector", "map/map", "map/map_range")
    sources = [root / "src" / f"{name}.c" for name in wanted]
    sources += [root / "src/map/map_cspace.cpp", root / "src/motion_model/differential_motion_model.cpp"]
    sources += [*(root / "src/sensors/laser").glob("*.cpp"), HERE / "peer_amcl.cpp"]
    objects = []
    for source in sources:
        compiler = ("gcc", "-std=gnu99") if source.suffix == ".c" else ("g++", "-std=c++17")
        objects.append(BUILT / f"{source.stem}.o")
        _run(*compiler, *FLAGS, "-DHAVE_DRAND48", "-I", root / "include", "-c", source, "-o", objects[-1])
    _run("g++", *objects, "-o", program, "-lm")


def _build_mrpt(program: Path, root: Path) -> None:
    includes = sorted((root / "usr/include/mrpt").glob("*/include"))
    includes += sorted((root / "usr/include").glob("*-linux-gnu/mrpt/*/include"))
    if not includes:
        raise OSError("found no MRPT; on Debian and Ubuntu it is in libmrpt-slam-dev")
    libraries = [*(root / "usr/lib").glob("*-linux-gnu"), *(root / "usr/lib").glob("*-linux-gnu/*la*")]
    flags = [word for folder in (*includes, root / "usr/include/eigen3") for word in ("-I", folder)]
    flags += ["-idirafter", root / "usr/include"]
    flags += [word for folder in libraries for word in ("-L", folder, f"-Wl,-rpath,{folder}")]
    flags += ["-Wl,--allow-shlib-undefined", *(f"-Wl,-rpath-link,{folder}" for folder in libraries)]
    names = [f"-lmrpt-{name}" for name in MRPT]
    _run("g++", "-std=c++17", *FLAGS, HERE / "peer_mrpt.cpp", "-o", program, *flags, *names)


def write_drive(file: Path, library: Library, moments: Sequence[Moment], start: F64, beams: int) -> None:
    """Write a drive as the programs read it: map, laser, and every update's odometry, truth and scan."""
    occupancy, first = library.occupancy, moments[0].frame.scan
    assert occupancy is not None
    assert first is not None
    height, width = occupancy.cells.shape
    states = np.zeros((height, width), np.int8)
    states[occupancy.cells == OCCUPIED], states[occupancy.cells == FREE] = 1, -1
    with file.open("wb") as out:
        np.array([beams, len(moments), width, height], np.int32).tofile(out)
        np.array([occupancy.cell_m, *occupancy.corner], np.float64).tofile(out)
        states.tofile(out)
        np.array([first.max_m, *first.mount, *start], np.float64).tofile(out)
        odometry = start
        for moment in moments:
            scan, before, motion = moment.frame.scan, odometry, np.zeros(3)
            assert scan is not None
            assert moment.truth is not None
            for part in moment.frame.motions:
                odometry, motion = compose(odometry, part), compose(motion, part)
            delta = odometry - before
            delta[2] = (delta[2] + np.pi) % (2 * np.pi) - np.pi
            np.array([*odometry, *delta, *moment.truth, *motion], np.float64).tofile(out)
            np.array([scan.size], np.int32).tofile(out)
            ranges = np.where(np.isfinite(scan.ranges_m), np.minimum(scan.ranges_m, scan.max_m), scan.max_m)
            np.column_stack([ranges, scan.angles_rad - scan.mount[2]]).astype(np.float64).tofile(out)
