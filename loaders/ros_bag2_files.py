"""Which file of a ROS 2 bag is opened: the folder by its metadata, or the one file that is there."""

from __future__ import annotations

from pathlib import Path

from .errors import LogError

METADATA = "metadata.yaml"
PARTS = (".db3", ".mcap")
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
    raise LogError(path, f"{found}, expected it; `ros2 bag reindex {path.name}` makes it anew")


def message_files(path: Path) -> list[Path]:
    """Give the files that hold a bag's messages, by name."""
    return sorted(file for file in path.iterdir() if file.name.endswith((*PARTS, *PACKED)))
