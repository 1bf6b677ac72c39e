"""A picture channel from a network: an ONNX file of the user's, which OpenCV runs.

What its input is stands in the file, in its metadata, or in a table beside it: `net.toml` of `net.onnx`.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from threading import Lock
from typing import Any

import cv2
import numpy as np

from ...errors import InputError
from ...values import F32, U8

SCHEME = "onnx:"
VERSION = "1"  # of how a picture becomes the input: another one measures anew
HASH_DIGITS = 12
HASHED = re.compile(f"@[0-9a-f]{{{HASH_DIGITS}}}$")
MOST_SIDE_PX = 4096
MEAN, STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)  # of ImageNet, red first: what backbones expect
FLOAT32 = 1  # of ONNX's element types
EXTERNAL = 1  # where a tensor's numbers are: in another file

# numbers of fields in ONNX's protocol buffers (onnx.proto)
MODEL_GRAPH, MODEL_METADATA = 7, 14
GRAPH_TENSOR, GRAPH_INPUT, GRAPH_OUTPUT = 5, 11, 12
TENSOR_NAME, TENSOR_LOCATION = 8, 14
VARINT, FIXED64, BYTES, FIXED32 = 0, 1, 2, 5  # how a field is written


def is_network(name: Any) -> bool:
    """Return whether a name is that of a network: `onnx:FILE.onnx`, with or without a hash."""
    return isinstance(name, str) and name.startswith(SCHEME)


def file_of(name: str) -> Path:
    """Return the file of a network's name."""
    return Path(HASHED.sub("", name.removeprefix(SCHEME)))


def network_of(name: str) -> Network:
    """Return the network of a name. InputError for a file that is none, or that has changed."""
    path = file_of(name).expanduser().absolute()
    table = path.with_suffix(".toml")
    try:
        network = _opened(path, *(_stamp(file) for file in (path, table)))
    except OSError as problem:
        raise InputError(path, f"cannot be read: {problem.strerror}; a network is an .onnx file") from None
    if HASHED.search(name) and not name.endswith(network.digest):
        fault = f"found the hash {network.digest}, expected {name[-HASH_DIGITS:]}"
        raise InputError(path, f"{fault}; the network or its table was changed: restore it")
    return network


def _stamp(path: Path) -> tuple[int, int]:
    """Return what changes when a file does."""
    if not path.exists():
        return 0, 0
    status = path.stat()
    return status.st_mtime_ns, status.st_size


@lru_cache(maxsize=4)
def _opened(path: Path, *_stamps: tuple[int, int]) -> Network:
    content, table = path.read_bytes(), path.with_suffix(".toml")
    of_table = table.read_bytes() if table.exists() else b""
    digest = sha256(b"\0".join([VERSION.encode(), sha256(content).digest(), of_table])).hexdigest()
    graph = _graph(path, content)
    table_values = _told_by_table(table, of_table)
    values = {key: _told_by_model(path, text) for key, text in graph.metadata.items() if key in KEYS}
    shape = _input_shape(path, table, _checked(path, values) | _checked(table, table_values), graph)
    network = Network(path, digest[:HASH_DIGITS], _loaded(path), shape)
    network.describe(np.full((*shape.size[::-1], 3), 128, np.uint8))  # whether every operator runs
    return network


# A channel of it.


@dataclass(frozen=True, slots=True)
class InputShape:
    """How a picture becomes the input of a network, and which output is the descriptor."""

    size: tuple[int, int]  # width and height
    mean: tuple[float, ...]  # subtracted from values from 0 to 1, red first
    std: tuple[float, ...]  # then divided by
    is_gray: bool
    is_bgr: bool
    output: str


@dataclass(frozen=True, slots=True, eq=False)
class Network:
    """A network as a channel: what its output has for a picture, compared by the cosine."""

    path: Path
    digest: str  # of the file and of its table
    net: Any
    shape: InputShape
    _lock: Lock = field(default_factory=Lock)  # a network of OpenCV runs once at a time

    distance = "cosine"
    unit = "the network's numbers"

    @property
    def part(self) -> str:
        """Its name in settings."""
        return f"{SCHEME}{self.path}@{self.digest}"

    @property
    def name(self) -> str:
        """The channel's name, after its file: letters, digits and lines below."""
        word = re.sub("[^a-z0-9]+", "_", self.path.stem.lower()).strip("_")
        return word if word[:1].isalpha() else f"net_{word}".rstrip("_")

    def describe(self, image: U8) -> F32:
        """Return the output (D,) for a picture (H, W, 3) RGB. InputError for another shape."""
        with self._lock, _quiet():
            try:
                self.net.setInput(_blob(image, self.shape))
                output = np.asarray(self.net.forward(self.shape.output), np.float32)
            except cv2.error as problem:
                raise InputError(self.path, f"OpenCV cannot run it: {_reason(problem)}") from None
        row: F32 = output.reshape(-1).copy()
        if output.ndim < 1 or output.shape[0] != 1 or max(output.shape) != len(row) or len(row) < 2:
            fault = f"its output {self.shape.output!r} has the shape {output.shape}"
            raise InputError(self.path, f"{fault}, expected one descriptor, (1, D); export what pools, too")
        if not np.isfinite(row).all():
            raise InputError(self.path, "its output is not finite: is it made for the input it is given?")
        return row


def _blob(image: U8, shape: InputShape) -> F32:
    """Return a picture (H, W, 3) as the input (1, C, h, w)."""
    shrinks = image.shape[1] >= shape.size[0] and image.shape[0] >= shape.size[1]
    small = cv2.resize(image, shape.size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
    if shape.is_gray:
        small = cv2.cvtColor(small, cv2.COLOR_RGB2GRAY)[..., None]
    mean, std = (np.array(numbers, np.float32) for numbers in (shape.mean, shape.std))
    values = (small.astype(np.float32) / 255 - mean) / std
    values = values[..., ::-1] if shape.is_bgr else values
    return np.ascontiguousarray(values.transpose(2, 0, 1)[None], np.float32)


def _loaded(path: Path) -> Any:
    with _quiet():
        try:
            return cv2.dnn.readNetFromONNX(str(path))
        except cv2.error as problem:
            raise InputError(path, f"OpenCV {cv2.__version__} cannot read it: {_reason(problem)}") from None


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep OpenCV from writing its own lines beside ours."""
    before = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(before)


def _reason(problem: cv2.error) -> str:
    """Return what OpenCV says, without its own files and lines."""
    text = str(problem)
    missing = re.search(r'Can\'t create layer "[^"]*" of type "([^"]+)"', text)
    if missing:
        return f"it has no operator {missing[1]}; export with another opset, or a simpler model"
    reasons = re.findall(r"error: \([^)]*\) ?([^\n>]*?)(?: in function|\n|$)", text)
    return " ".join((reasons or [text])[-1].split()) or "no reason is given"


# What the input is.


def _input_shape(path: Path, table: Path, told: Mapping[str, Any], graph: _Graph) -> InputShape:
    """Return how pictures are given to a network, by its graph and by what was told. InputError."""
    if len(graph.inputs) != 1:
        names = ", ".join(graph.inputs) or "none"
        raise InputError(path, f"found {len(graph.inputs)} inputs ({names}), expected one picture")
    ((name, (kind, dims)),) = graph.inputs.items()
    described = f"its input {name!r} is {_say(dims)}"
    if len(dims) != 4 or dims[0] not in (1, None) or dims[1] not in (1, 3, None):
        raise InputError(path, f"{described}, expected (1, 3, height, width): one picture, its colors first")
    if kind != FLOAT32:
        raise InputError(path, f"{described} of ONNX's type {kind}, expected float32 (type {FLOAT32})")
    fixed = None if None in dims[2:] else (int(dims[3] or 0), int(dims[2] or 0))
    size = told.get("size", fixed)
    if size is None:
        raise InputError(
            path, f"{described}: write its size to {table.name} beside it, such as size = [320, 320]"
        )
    if fixed not in (None, size) or not all(1 <= side <= MOST_SIDE_PX for side in size):
        fault = f"size is {list(size)}, and {described}"
        raise InputError(path, f"{fault}; expected the same, and sides of 1 to {MOST_SIDE_PX} pixels")
    is_gray = dims[1] == 1
    usual: dict[str, tuple[float, ...]] = {"mean": MEAN, "std": STD}
    if is_gray:
        usual = {key: (sum(values) / len(values),) for key, values in usual.items()}
    mean, std = (told.get(key, values) for key, values in usual.items())
    if {len(mean), len(std)} - {1, 1 if is_gray else 3}:
        raise InputError(path, f"{described}: expected as many numbers of mean and std as it has colors")
    output = told.get("output", graph.outputs[0] if len(graph.outputs) == 1 else None)
    if output not in graph.outputs:
        fault = f"found the outputs {', '.join(graph.outputs) or 'none'}"
        advice = f'write output = "NAME" to {table.name} beside it'
        raise InputError(path, f"{fault}, expected {output or 'one'}; {advice}")
    return InputShape(size, mean, std, is_gray, told.get("order") == "BGR", output)


def _say(dims: tuple[int | None, ...]) -> str:
    return f"({', '.join('?' if side is None else str(side) for side in dims)})"


def _size(value: Any) -> tuple[int, int]:
    width, height = value
    if not all(type(side) is int for side in (width, height)):
        raise ValueError
    return width, height


def _numbers(value: Any) -> tuple[float, ...]:
    numbers = tuple(float(number) for number in (value if isinstance(value, list) else [value]))
    if len(numbers) not in (1, 3) or not np.isfinite(numbers).all():
        raise ValueError
    return numbers


def _above_zero(value: Any) -> tuple[float, ...]:
    numbers = _numbers(value)
    if min(numbers) <= 0:
        raise ValueError
    return numbers


def _order(value: Any) -> str:
    if value not in ("RGB", "BGR"):
        raise ValueError
    return str(value)


# what may be told: how it is read, and what is expected
KEYS: Mapping[str, tuple[Callable[[Any], Any], str]] = {
    "size": (_size, "[width, height] in pixels"),
    "mean": (_numbers, "one number or three, red first, of values from 0 to 1"),
    "std": (_above_zero, "one number or three above 0, red first, of values from 0 to 1"),
    "order": (_order, '"RGB" or "BGR"'),
    "output": (str, "the name of an output"),
}


def _checked(file: Path, values: Mapping[str, Any]) -> dict[str, Any]:
    checked = {}
    for key, value in values.items():
        if key not in KEYS:
            raise InputError(file, f"found {key}, expected {', '.join(KEYS)}")
        read, expected = KEYS[key]
        try:
            checked[key] = read(value)
        except (TypeError, ValueError):
            raise InputError(file, f"{key}: found {value!r:.60}, expected {expected}") from None
    return checked


def _told_by_table(table: Path, content: bytes) -> dict[str, Any]:
    try:
        return tomllib.loads(content.decode())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as problem:
        raise InputError(table, f"is no TOML: {problem}") from None


def _told_by_model(path: Path, text: str) -> Any:
    """Return a value of a file's metadata: "[0.5, 0.5, 0.5]", or a word."""
    try:
        return json.loads(text)
    except ValueError:
        return text


# The file, as far as OpenCV does not tell.

Input = tuple[int, tuple[int | None, ...]]  # its element type, and its shape; None: any


@dataclass(frozen=True, slots=True)
class _Graph:
    inputs: Mapping[str, Input]
    outputs: list[str]
    metadata: Mapping[str, str]


def _graph(path: Path, content: bytes) -> _Graph:
    """Return inputs, outputs and metadata of an ONNX file. InputError for any other file."""
    try:
        model = list(_fields(memoryview(content)))
        graph = [each for _, part in _of(model, MODEL_GRAPH) for each in _fields(part)]
        metadata = dict(_pair(part) for _, part in _of(model, MODEL_METADATA))
        tensors = [dict(_fields(part)) for _, part in _of(graph, GRAPH_TENSOR)]
        constants = {_text(tensor[TENSOR_NAME]) for tensor in tensors if TENSOR_NAME in tensor}
        inputs = dict(_value(part) for _, part in _of(graph, GRAPH_INPUT))
        outputs = [_value(part)[0] for _, part in _of(graph, GRAPH_OUTPUT)]
    except (ValueError, IndexError, TypeError, KeyError):
        graph = []
    if not graph:
        raise InputError(path, "is no ONNX file, or is cut off; expected what torch.onnx.export writes")
    if any(tensor.get(TENSOR_LOCATION) == EXTERNAL for tensor in tensors):
        advice = "export it as one file (external_data=False)"
        raise InputError(path, f"its weights are in another file; {advice}")
    return _Graph({name: value for name, value in inputs.items() if name not in constants}, outputs, metadata)


Field = tuple[int, Any]  # its number; a whole number, or bytes


def _of(fields: list[Field], number: int) -> list[Field]:
    return [each for each in fields if each[0] == number]


def _fields(data: memoryview) -> Iterator[Field]:
    """Yield the fields of a message of protocol buffers. ValueError, IndexError for other bytes."""
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        number, kind = key >> 3, key & 7
        if kind == VARINT:
            value, at = _varint(data, at)
            yield number, value
            continue
        if kind == BYTES:
            length, at = _varint(data, at)
        elif kind in (FIXED32, FIXED64):
            length = 4 if kind == FIXED32 else 8
        else:
            raise ValueError(kind)
        if at + length > len(data):
            raise ValueError(length)
        yield number, data[at : at + length]
        at += length


def _varint(data: memoryview, at: int) -> tuple[int, int]:
    value = 0
    for shift in range(0, 64, 7):
        byte = data[at]
        at += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value, at
    raise ValueError(value)


def _text(data: Any) -> str:
    return bytes(data).decode()


def _pair(entry: memoryview) -> tuple[str, str]:
    both = {number: _text(part) for number, part in _fields(entry)}
    return both.get(1, ""), both.get(2, "")


def _value(info: memoryview) -> tuple[str, Input]:
    """Return name, element type and shape of an input or output."""
    outer = dict(_fields(info))
    tensor = dict(_fields(dict(_fields(outer[2])).get(1, memoryview(b"")))) if 2 in outer else {}
    sides = [dict(_fields(part)) for _, part in _fields(tensor.get(2, memoryview(b"")))]
    return _text(outer[1]), (tensor.get(1, 0), tuple(side.get(1) or None for side in sides))
