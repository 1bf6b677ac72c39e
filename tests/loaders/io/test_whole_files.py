import os
from pathlib import Path

import pytest

from maurice_loaders.errors import InputError
from maurice_loaders.io.files import write_whole


def test_what_cannot_be_written_whole_leaves_what_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "a.png"
    write_whole(file, b"old")
    with pytest.raises(InputError, match="--force"):
        write_whole(file, b"new")

    def full(path: Path, data: bytes) -> int:
        path.touch()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(InputError, match=r"a.png: cannot be written: No space left"):
        write_whole(file, b"new", force=True)
    assert file.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [file]


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="found a folder"):
        write_whole(tmp_path, b"", force=True)


def test_a_device_or_pipe_is_never_replaced_by_a_file(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(InputError, match="device or pipe"):
        write_whole(pipe, b"data", force=True)
    assert pipe.is_fifo()
