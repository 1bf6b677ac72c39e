"""Pictures with poses in space: 7-Scenes and ScanNet, COLMAP's text model, nerfstudio's transforms.json.

Formats: https://www.microsoft.com/en-us/research/project/rgb-d-dataset-7-scenes (a 4 x 4 matrix a picture),
https://colmap.github.io/format.html (`images.txt`, from the world to the camera), and
https://docs.nerf.studio/quickstart/data_conventions.html (a camera looks along its -z, with y up).

Their worlds stand anyhow. Seen from above is as most pictures were held: with the sky at their top.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from maurice_mcl.values import F64, Camera, SessionInfo

from ..errors import FieldError, InputError, ReadingNotes
from ..files.text import MOST, PICTURES, natural_order, numbers, read_bounded, read_json, reading, show, text
from ..reading.options import Reading
from ..reading.plane import OutOfPlane, Plane, Pose, forward_axis, planar, plane_of, rotation
from ..reading.recording import Note, Picture, Record, TruthPose
from ._poses import read_picture
from ._tables import Row, number_of, rows, words_of
from .registry import Format

PERIOD_S = 0.1  # between two pictures: none of these formats has times
MOST_BYTES = 64_000_000  # of transforms.json
LEVEL: Pose = (
    np.zeros(3),
    np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]),
)  # a level camera in a world with z up
OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])  # from axes x right, y up, z back to x right, y down, z forward
NO_TIMES = f"found no times: {1 / PERIOD_S:g} pictures a second are taken"
NO_SCALE = (
    "COLMAP's poses have no scale: its unit is taken for a meter; --reading truth_scale=... corrects it"
)

Posed = Iterator[tuple[str, Callable[[], F64]]]  # of each picture its name, and what reads its pose (4, 4)


@dataclass(frozen=True, eq=False)
class PosedPictures:
    """Pictures in the order of their names; poses (4, 4) are of the camera in the world: x right, y down."""

    path: Path
    info: SessionInfo
    folder: Path  # that names start from
    posed: Callable[[], Posed]
    options: Reading
    remarks: tuple[str, ...] = (NO_TIMES,)

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield truth and picture in turn; of a pose that is a problem the picture alone."""
        for remark in self.remarks:
            notes.warning(f"{self.path}: {remark}")
        plane = self._plane()
        left = OutOfPlane(plane)
        for number, (name, pose) in enumerate(self.posed()):
            t_s = number * PERIOD_S
            try:
                matrix = _checked(self.path, pose())
                position, turned = plane.place(matrix[:3, 3], matrix[:3, :3])
                note = left.add(position, turned)
                yield TruthPose(t_s, planar(position, turned, plane.forward))
                if note:
                    yield Note(t_s, note)
            except InputError as problem:
                notes.problem(problem)
            read = partial(read_picture, self.folder, name, self.options.pictures_outside)
            yield Picture(t_s, read, name)
        if words := str(left):
            notes.left_plane(str(self.path), left.tilt_rad, left.height_m, words)

    def _plane(self) -> Plane:
        """Return the plane that was asked for, else the one that is level by the pictures' tops."""
        poses = [(matrix[:3, 3], matrix[:3, :3]) for matrix in self._readable()]
        if self.options.plane not in (None, "auto"):
            plane = plane_of(poses, self.options.plane)
            return replace(plane, forward=forward_axis(plane.place(*pose)[1] for pose in poses or [LEVEL]))
        up = -np.mean([turned[:, 1] for _, turned in poses] or [np.array([0.0, -1.0, 0.0])], axis=0)
        up /= max(float(np.linalg.norm(up)), 1e-9)
        first = np.eye(3)[int(np.argmin(np.abs(up)))]
        first -= (first @ up) * up
        first /= np.linalg.norm(first)
        return Plane(
            "level", np.array([first, np.cross(up, first), up]), "z", upright=np.array([0.0, -1.0, 0.0])
        )

    def _readable(self) -> Iterator[F64]:
        for _, pose in self.posed():
            try:
                yield _checked(self.path, pose())
            except InputError:
                continue


def _checked(path: Path, matrix: F64) -> F64:
    """Return a pose (4, 4) with a rotation of length 1. InputError for another matrix."""
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    if not (np.isfinite(matrix).all() and np.allclose(scale, 1, atol=0.1)):
        raise InputError(path, f"found {show(matrix[:3].round(3).tolist())}, expected a rotation and a place")
    return matrix


# 7-Scenes: frame-000000.color.png beside frame-000000.pose.txt. ScanNet: color/0.jpg and pose/0.txt.

POSE = ".pose.txt"


def _pairs(path: Path) -> list[tuple[Path, Path]]:
    """Return each picture of a folder with the file of its pose, in natural order."""
    if not path.is_dir():
        return []
    if poses := [file for file in path.iterdir() if file.name.endswith(POSE)]:
        return [(_picture_of(file, file.name.removesuffix(POSE)), file) for file in natural_order(poses)]
    color = next((path / name for name in ("color", "rgb") if (path / name).is_dir()), None)
    if color is None or not (path / "pose").is_dir():
        return []
    pictures = natural_order(file for file in color.iterdir() if file.suffix.lower() in PICTURES)
    pairs = [(file, path / "pose" / f"{file.stem}.txt") for file in pictures]
    return [pair for pair in pairs if pair[1].is_file()]


def _picture_of(pose: Path, stem: str) -> Path:
    names = [f"{stem}.color{ending}" for ending in PICTURES] + [f"{stem}{ending}" for ending in PICTURES]
    return next(
        (pose.with_name(name) for name in names if pose.with_name(name).is_file()), pose.with_name(names[0])
    )


def _matrix_file(file: Path) -> F64:
    words = [(row, word) for row in rows(file) for word in words_of(row.text)]
    if len(words) != 16:
        raise InputError(file, f"found {len(words)} values, expected a matrix of 4 x 4")
    return np.array([number_of(file, row, word, "value") for row, word in words]).reshape(4, 4)


def open_matrices(path: Path, options: Reading) -> PosedPictures:
    """Open a folder of pictures with a matrix each. InputError without any."""
    pairs = _pairs(path)
    if not pairs:
        raise InputError(
            path, f"found no frame-000000{POSE} and no color/ beside pose/, expected 7-Scenes or ScanNet"
        )

    def posed() -> Posed:
        for picture, pose in pairs:
            yield picture.relative_to(path).as_posix(), partial(_matrix_file, pose)

    return PosedPictures(path, SessionInfo(path.resolve().name), path, posed, options)


def looks_like_matrices(path: Path) -> bool:
    """Recognize 7-Scenes and ScanNet by the files of their poses."""
    try:
        return bool(_pairs(path))
    except OSError:
        return False


# COLMAP: images.txt, and the pictures in a folder `images` beside it or above.

IMAGES = ("images.txt", "sparse/0/images.txt", "sparse/images.txt")
BINARY = ("images.bin", "sparse/0/images.bin", "sparse/images.bin")


def open_colmap(path: Path, options: Reading) -> PosedPictures:
    """Open COLMAP's text model: its images.txt, or a folder with it. InputError without one."""
    file = _model(path, IMAGES)
    if file is None:
        text_model = "`colmap model_converter --output_type TXT` writes the text that is read"
        raise InputError(path, f"found COLMAP's binary model, expected images.txt; {text_model}")
    above = [folder / "images" for folder in file.resolve().parents[:4]]
    folder = next((images for images in above if images.is_dir()), file.parent)
    info = SessionInfo(folder.resolve().parent.name)
    return PosedPictures(path, info, folder, partial(_colmap_poses, file), options, (NO_TIMES, NO_SCALE))


def _model(path: Path, names: tuple[str, ...]) -> Path | None:
    if path.is_file():
        return path if path.name in names else None
    return next((path / name for name in names if (path / name).is_file()), None)


def _colmap_poses(file: Path) -> Posed:
    """Yield the pictures of a model by name. A row of points follows each, and is passed over."""
    by_name = {}
    for row in rows(file):
        words = row.text.split(maxsplit=9)
        if not row.text.startswith("#") and len(words) == 10 and not _begins_with_number(words[9]):
            by_name[Path(words[9])] = row
    for name in natural_order(by_name):
        yield name.as_posix(), partial(_colmap_pose, file, by_name[name])


def _begins_with_number(words: str) -> bool:
    """Return whether a tenth word is that of a row of points: x, y and a number, again and again."""
    first = words.split(maxsplit=1)[0]
    return first.replace(".", "", 1).replace("-", "", 1).isdigit()


def _colmap_pose(file: Path, row: Row) -> F64:
    values = [number_of(file, row, word, "value") for word in row.text.split()[1:8]]
    try:
        turned = rotation(np.array(values[:4])).T
    except ValueError as problem:
        raise InputError(file, str(problem), row.number) from None
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turned, -turned @ values[4:]
    return matrix


def looks_like_colmap(path: Path) -> bool:
    """Recognize COLMAP's model by its files."""
    try:
        return (_model(path, IMAGES) or _model(path, BINARY)) is not None
    except OSError:
        return False


# nerfstudio and instant-ngp: transforms.json.

TRANSFORMS = "transforms.json"


def open_transforms(path: Path, options: Reading) -> PosedPictures:
    """Open transforms.json, or a folder with it. InputError for one that makes no sense."""
    file = path / TRANSFORMS if path.is_dir() else path
    try:
        content = read_json(read_bounded(file, TRANSFORMS, MOST_BYTES))
        if not isinstance(content, dict) or not isinstance(content.get("frames"), list):
            raise FieldError(f"found {show(content)}, expected an object with frames")
        frames = {Path(text(frame.get("file_path"), "file_path")): frame for frame in content["frames"]}
        wide, focal = content.get("w"), content.get("fl_x")
        fov_rad = 2 * float(np.arctan2(wide / 2, focal)) if wide and focal else content.get("camera_angle_x")
    except (AttributeError, TypeError, ValueError) as problem:
        raise InputError(file, f"cannot be read as nerfstudio's: {problem}") from None

    def posed() -> Posed:
        for name in natural_order(frames):
            yield _with_ending(file.parent, name), partial(_opengl_pose, file, frames[name])

    cameras = (Camera("camera", horizontal_fov_rad=fov_rad),) if fov_rad else ()
    info = SessionInfo(file.resolve().parent.name, cameras=cameras)
    return PosedPictures(path, info, file.parent, posed, options)


def _with_ending(folder: Path, name: Path) -> str:
    """Return a picture's name with its ending, which instant-ngp leaves out."""
    endings = ("", *PICTURES)
    return next((f"{name}{end}" for end in endings if (folder / f"{name}{end}").is_file()), str(name))


def _opengl_pose(file: Path, frame: dict[str, Any]) -> F64:
    entry = frame.get("transform_matrix")
    try:
        listed = entry if isinstance(entry, list) else [entry]
        matrix = np.array([numbers(row, 4, "a row of transform_matrix", MOST) for row in listed])
    except FieldError as problem:
        raise InputError(file, f"{frame.get('file_path')}: {problem}") from None
    if matrix.shape not in ((3, 4), (4, 4)):
        raise InputError(file, f"{frame.get('file_path')}: found {show(entry)}, expected a matrix of 4 x 4")
    whole = np.vstack([matrix[:3], [0.0, 0.0, 0.0, 1.0]])
    return whole @ OPENGL


def looks_like_transforms(path: Path) -> bool:
    """Recognize transforms.json by its name and its first bytes."""
    file = path / TRANSFORMS if path.is_dir() else path
    try:
        if file.name != TRANSFORMS or not file.is_file():
            return False
        with reading(file, TRANSFORMS), file.open("rb") as data:
            return data.read(64).lstrip()[:1] == b"{"
    except (OSError, InputError):
        return False


FORMATS = (
    Format(
        "seven-scenes",
        "pictures with a matrix each: frame-000000.pose.txt (7-Scenes), or color/ and pose/ (ScanNet)",
        looks_like_matrices,
        open_matrices,
        in_space=True,
    ),
    Format(
        "colmap",
        "COLMAP's text model: images.txt, pictures in images/",
        looks_like_colmap,
        open_colmap,
        in_space=True,
    ),
    Format(
        "transforms", "nerfstudio's transforms.json", looks_like_transforms, open_transforms, in_space=True
    ),
)
