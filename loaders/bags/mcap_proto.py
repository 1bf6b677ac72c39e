"""Decoding protobuf messages by the description that an MCAP file carries (a FileDescriptorSet).

Only what messages need: no groups, no extensions, no default values of proto2. Fields that are not in a
message have the default of their kind, and other messages are None.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

VARINT, FIXED64, BYTES, FIXED32 = 0, 1, 2, 5  # how a value is written
DOUBLE, FLOAT, INT64, UINT64, INT32, FIX64, FIX32, BOOL, STRING = range(1, 10)  # google.protobuf's numbers
MESSAGE, DATA, UINT32, ENUM, SFIX32, SFIX64, SINT32, SINT64 = range(11, 19)
PLAIN = {DOUBLE: "<d", FLOAT: "<f", FIX64: "<Q", FIX32: "<I", SFIX32: "<i", SFIX64: "<q"}
REPEATED = 3
DEEPEST = 50  # messages within messages
LONGEST = 10  # bytes of a variable-length number

Value = int | bytes


class ProtoError(ValueError):
    """Bytes that are no such message."""


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a message."""

    name: str
    kind: int  # DOUBLE, STRING ...
    repeated: bool
    type: str  # of a message within; "" otherwise


Fields = dict[int, Field]


def decode_proto(data: bytes, kind: str, description: bytes) -> Any:
    """Decode a message, `foxglove.RawImage` for example. ProtoError where it is damaged or not described."""
    return _decode(memoryview(data), _described(description), kind, 0)


@lru_cache(maxsize=100)  # a peer may announce new ones for ever
def _described(description: bytes) -> dict[str, Fields]:
    """Read a FileDescriptorSet: the fields of every message by its full name."""
    messages: dict[str, Fields] = {}
    for file in _all(memoryview(description), 1):
        package = _text(_last(file, 2))
        for message in _all(file, 4):
            _describe(message, package, messages, 0)
    return messages


def _describe(message: memoryview, within: str, messages: dict[str, Fields], depth: int) -> None:
    if depth > DEEPEST:
        raise ProtoError("found message types too deep within each other")
    name = ".".join(part for part in (within, _text(_last(message, 1))) if part)
    messages[name] = dict(_field(field) for field in _all(message, 2))
    for inner in _all(message, 3):
        _describe(inner, name, messages, depth + 1)


def _field(data: memoryview) -> tuple[int, Field]:
    numbers = {key: value for key, value in _values(data) if isinstance(value, int)}
    name, kind = _text(_last(data, 1)), _text(_last(data, 6)).lstrip(".")
    return numbers.get(3, 0), Field(name, numbers.get(5, 0), numbers.get(4) == REPEATED, kind)


def _decode(data: memoryview, messages: dict[str, Fields], kind: str, depth: int) -> SimpleNamespace:
    if kind not in messages:
        raise ProtoError(f"found no description of {kind}, expected one")
    if depth > DEEPEST:
        raise ProtoError("found messages too deep within each other")
    fields = messages[kind]
    found = {field.name: _default(field) for field in fields.values()}
    for number, value in _values(data):
        field = fields.get(number)
        if field is None:
            continue
        values = [_value(one, field, messages, depth) for one in _unpacked(value, field)]
        if field.repeated:
            found[field.name].extend(values)
        else:
            found[field.name] = values[-1] if values else found[field.name]
    return SimpleNamespace(**found)


def _default(field: Field) -> Any:
    if field.repeated:
        return []
    return {STRING: "", DATA: b"", MESSAGE: None, BOOL: False}.get(field.kind, 0)


def _unpacked(value: int | memoryview, field: Field) -> list[int | memoryview]:
    """Give the values of a field that may hold several in one."""
    if isinstance(value, int) or field.kind in (STRING, DATA, MESSAGE):
        return [value]
    if field.kind in PLAIN:
        size = struct.calcsize(PLAIN[field.kind])
        return [value[at : at + size] for at in range(0, len(value) - size + 1, size)]
    numbers, at = list[int | memoryview](), 0
    while at < len(value):
        number, at = _varint(value, at)
        numbers.append(number)
    return numbers


def _value(value: int | memoryview, field: Field, messages: dict[str, Fields], depth: int) -> Any:
    if isinstance(value, int):
        return _whole(value, field.kind)
    if field.kind == STRING:
        return _text(value)
    if field.kind == DATA:
        return bytes(value)
    if field.kind == MESSAGE:
        return _decode(value, messages, field.type, depth + 1)
    if field.kind not in PLAIN or len(value) != struct.calcsize(PLAIN[field.kind]):
        raise ProtoError(f"found a field {field.name!r} that is not of its kind")
    return struct.unpack(PLAIN[field.kind], value)[0]


def _whole(value: int, kind: int) -> int:
    """Give a whole number with its sign."""
    if kind in (SINT32, SINT64):
        return (value >> 1) ^ -(value & 1)
    if kind in (INT32, INT64, ENUM) and value >= 1 << 63:
        return value - (1 << 64)
    return value


def _values(data: memoryview) -> Iterator[tuple[int, int | memoryview]]:
    """Give number and value of every field, in the order in which they stand."""
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        if key & 7 == VARINT:
            number, at = _varint(data, at)
            yield key >> 3, number
            continue
        if key & 7 == BYTES:
            size, at = _varint(data, at)
        elif key & 7 in (FIXED64, FIXED32):
            size = 8 if key & 7 == FIXED64 else 4
        else:
            raise ProtoError(f"found a field written in the way {key & 7}, which is not known")
        if at + size > len(data):
            raise ProtoError("found a message that ends within a field")
        yield key >> 3, data[at : at + size]
        at += size


def _varint(data: memoryview, at: int) -> tuple[int, int]:
    value = 0
    for place in range(LONGEST):
        if at + place >= len(data):
            raise ProtoError("found a message that ends within a number")
        byte = data[at + place]
        value |= (byte & 127) << 7 * place
        if byte < 128:
            return value, at + place + 1
    raise ProtoError("found a number of too many bytes")


def _all(data: memoryview, number: int) -> list[memoryview]:
    return [value for key, value in _values(data) if key == number and not isinstance(value, int)]


def _last(data: memoryview, number: int) -> memoryview:
    return (_all(data, number) or [memoryview(b"")])[-1]


def _text(data: memoryview) -> str:
    return str(data, "utf-8", "replace")
