"""Which file of a ROS 2 bag is opened: the folder by its metadata, or the one file that is there."""

from __future__ import annotations

from pathlib import Path

from .errors import LogError
from .mcap_records import MAGIC

METADATA = "metadata.yaml"
PARTS = (".db3", ".mcap")
BESIDE = {"-wal": b"\x37\x7f\x06", "-journal": b"\xd9\xd5\x05\xf9"}  # of SQLite, and how they begin
PACKED = tuple(f"{part}.zstd" for part in PARTS)


def is_bag_folder(path: Path) -> bool:
    """Tell a folder with a bag's metadata, or, where recording was not ended, with nothing but its files."""
    if (path / METADATA).is_file():
        return True
    try:
        names = [entry.name for entry in path.iterdir()]
    except OSError:
        return False
    return bool(names) and all(any(part in name for part in PARTS) for name in names)


def opened_as(path: Path) -> Path:
    """Give the folder where it has metadata, else the file to open alone. LogError where that is not one."""
    if path.is_file():
        if path.name.endswith(PACKED):
            raise LogError(
                path, f"found a packed file, expected it unpacked; `zstd -d {path.name}` does that"
            )
        return path
    if (path / METADATA).is_file():
        return path
    files = message_files(path)
    if len(files) == 1:
        return opened_as(files[0])
    found = f"found {len(files)} files of a bag and no {METADATA}"
    mends = f"`ros2 bag reindex {path.name}` makes it anew, --keep-going does without"
    raise LogError(path, f"{found}, expected it; {mends}")


def message_files(path: Path) -> list[Path]:
    """Give the files that hold a bag's messages, by name; a file is its own."""
    if not path.is_dir():
        return [path]
    return sorted(file for file in path.iterdir() if file.name.endswith((*PARTS, *PACKED)))


def not_there(path: Path) -> list[str]:
    """Name the files that a bag's metadata lists and that are gone; none where it cannot be read."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        found = YAML(typ="safe", pure=True).load(path / METADATA)["rosbag2_bagfile_information"]
        names = [str(name) for name in found["relative_file_paths"]]
    except (OSError, ValueError, TypeError, KeyError, YAMLError):
        return []
    gone = [name for name in names if not (path / name).exists()]
    return [f"{name} is not there, though {METADATA} lists it" for name in gone]


def not_merged(file: Path) -> str:
    """Say what of a database still lies beside it, where nobody finds it who only reads; "" for nothing."""
    for ending, magic in BESIDE.items():
        beside = file.with_name(f"{file.name}{ending}")
        if starts_with(beside, magic):
            found = f"{beside.stat().st_size} bytes that belong into {file.name} are still in {beside.name}"
            why = "as the recording was killed, or goes on"
            return f"{found}, {why}; `sqlite3 {file.name} 'PRAGMA quick_check'` puts them in"
    return ""


def is_mcap(path: Path) -> bool:
    """Tell whether a file begins as MCAP does."""
    return starts_with(path, MAGIC)


def starts_with(path: Path, magic: bytes) -> bool:
    """Tell whether a file begins with these bytes; False for what cannot be read."""
    try:
        if not path.is_file():
            return False
        with path.open("rb") as file:
            return file.read(len(magic)) == magic
    except OSError:
        return False
