"""Small networks as ONNX files, written byte by byte: no package for it is needed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

Shape = Sequence[int | str]  # a word: any number
FLOAT32, INT64 = 1, 7  # ONNX's element types
WHOLE, REAL, LIST = 2, 1, 7  # types of attributes
TOO_FAR = 1e-12


def varint(number: int) -> bytes:
    digits, number = bytearray(), number % (1 << 64)
    while number > 127:
        digits.append(number & 127 | 128)
        number >>= 7
    return bytes([*digits, number])


def field(number: int, value: int | float | str | bytes) -> bytes:
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    if isinstance(value, float):
        return varint(number << 3 | 5) + np.float32(value).tobytes()
    content = value.encode() if isinstance(value, str) else value
    return varint(number << 3 | 2) + varint(len(content)) + content


def fields(number: int, values: Iterable[int | float | str | bytes]) -> bytes:
    return b"".join(field(number, value) for value in values)


def tensor(name: str, values: np.ndarray) -> bytes:
    kind = INT64 if values.dtype == np.int64 else FLOAT32
    return fields(1, values.shape) + field(2, kind) + field(8, name) + field(9, values.tobytes())


def attribute(name: str, value: int | float | Sequence[int]) -> bytes:
    if isinstance(value, int):
        return field(1, name) + field(3, value) + field(20, WHOLE)
    if isinstance(value, float):
        return field(1, name) + field(2, value) + field(20, REAL)
    return field(1, name) + fields(8, value) + field(20, LIST)


def node(kind: str, inputs: str, outputs: str, **attributes: int | float | Sequence[int]) -> bytes:
    """An operator; names of inputs and outputs with spaces between them."""
    of_kind = fields(1, inputs.split()) + fields(2, outputs.split()) + field(4, kind)
    return of_kind + fields(5, [attribute(*each) for each in attributes.items()])


def value_info(name: str, shape: Shape, kind: int = FLOAT32) -> bytes:
    sides = fields(1, [field(1 if isinstance(side, int) else 2, side) for side in shape])
    return field(1, name) + field(2, field(1, field(1, kind) + field(2, sides)))


def model(
    nodes: Sequence[bytes],
    weights: Mapping[str, np.ndarray | bytes],
    inputs: Mapping[str, Shape] | None = None,
    outputs: Sequence[str] = ("out",),
    metadata: Mapping[str, str] | None = None,
    kind: int = FLOAT32,
) -> bytes:
    shapes = {"image": (1, 3, 32, 32)} if inputs is None else inputs
    tensors = [part if isinstance(part, bytes) else tensor(name, part) for name, part in weights.items()]
    graph = fields(1, nodes) + field(2, "net") + fields(5, tensors)
    graph += fields(11, [value_info(*each, kind) for each in shapes.items()])
    graph += fields(12, [value_info(name, (1, "D")) for name in outputs])
    told = fields(14, [field(1, key) + field(2, text) for key, text in (metadata or {}).items()])
    return field(1, 8) + field(7, graph) + field(8, field(1, "") + field(2, 17)) + told


def numbers(*shape: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng([seed, *shape]).normal(size=shape).astype(np.float32)


def small_network(size: int | str = 32, *, colors: int | str = 3, numbers_out: int = 16, **more) -> bytes:
    """A picture's edges in 4 x 4 parts, mixed: descriptors that tell places apart, with negative numbers."""
    depth = colors if isinstance(colors, int) else 3
    nodes = [
        node("Conv", "image w", "edges", kernel_shape=[3, 3], pads=[1, 1, 1, 1], strides=[8, 8]),
        node("Flatten", "edges", "flat", axis=1),
        node("MatMul", "flat mix", "out"),
    ]
    parts = 8 * (size // 8) ** 2 if isinstance(size, int) else 8 * 16
    weights = {"w": numbers(8, depth, 3, 3), "mix": numbers(parts, numbers_out)}
    return model(nodes, weights, {"image": (1, colors, size, size)}, **more)


def means(shape: Shape = (1, 3, 32, 32), **more) -> bytes:
    """The mean of each color of its input."""
    nodes = [node("GlobalAveragePool", "image", "p"), node("Flatten", "p", "out", axis=1)]
    return model(nodes, {}, {"image": shape}, **more)


# The heads of networks that people use, on a small backbone: each makes a descriptor of length 1.

UNIT = [
    node("ReduceL2", "d", "length", axes=[1], keepdims=1),
    node("Clip", "length least", "long"),
    node("Shape", "d", "shape"),
    node("Expand", "long shape", "lengths"),
    node("Div", "d lengths", "out"),
]
LEAST = {"least": np.array(TOO_FAR, np.float32)}


def cosplace() -> bytes:
    """Convolution, generalized mean, a linear layer (Berton, Masone and Caputo 2022)."""
    nodes = [
        node("Conv", "image w", "c", kernel_shape=[3, 3], pads=[1, 1, 1, 1], strides=[2, 2]),
        node("BatchNormalization", "c one bias bias one", "b"),
        node("Relu", "b", "r"),
        node("Clip", "r small", "r1"),
        node("Pow", "r1 p", "powers"),
        node("GlobalAveragePool", "powers", "mean"),
        node("Pow", "mean root", "gem"),
        node("Flatten", "gem", "flat", axis=1),
        node("Gemm", "flat linear shift", "d", transB=1),
        *UNIT,
    ]
    weights = {"w": numbers(8, 3, 3, 3), "one": np.ones(8, np.float32), "bias": numbers(8) / 9}
    weights |= {"small": np.array(1e-6, np.float32), "p": np.array([3], np.float32)}
    weights |= {"root": np.array([1 / 3], np.float32), "linear": numbers(12, 8), "shift": numbers(12)}
    return model(nodes, weights | LEAST)


def mixvpr() -> bytes:
    """A mixer over places of a feature map (Ali-bey, Chaib-draa and Giguere 2023)."""
    nodes = [
        node("Conv", "image w", "c", kernel_shape=[3, 3], pads=[1, 1, 1, 1], strides=[4, 4]),
        node("Reshape", "c rows", "x"),
        node("LayerNormalization", "x scale bias", "n", axis=-1),
        node("MatMul", "n w1", "h1"),
        node("Relu", "h1", "h2"),
        node("MatMul", "h2 w2", "h3"),
        node("Add", "x h3", "y"),
        node("Transpose", "y", "yt", perm=[0, 2, 1]),
        node("MatMul", "yt channels", "yc"),
        node("Transpose", "yc", "yb", perm=[0, 2, 1]),
        node("MatMul", "yb places", "yr"),
        node("Flatten", "yr", "d", axis=1),
        *UNIT,
    ]
    weights = {"w": numbers(8, 3, 3, 3), "rows": np.array([1, 8, 64]), "scale": numbers(64)}
    weights |= {"bias": numbers(64), "w1": numbers(64, 64) / 8, "w2": numbers(64, 64) / 8}
    weights |= {"channels": numbers(8, 6), "places": numbers(64, 4)}
    return model(nodes, weights | LEAST)


def megaloc() -> bytes:
    """A block of a vision transformer, and optimal transport's softmax (Berton and Masone 2025)."""
    nodes = [
        node("Conv", "image w", "c", kernel_shape=[8, 8], strides=[8, 8]),
        node("Reshape", "c rows", "x0"),
        node("Transpose", "x0", "x1", perm=[0, 2, 1]),
        node("Concat", "cls x1", "x2", axis=1),
        node("Add", "x2 position", "x"),
        node("LayerNormalization", "x scale bias", "n", axis=-1),
        node("MatMul", "n qkv", "a"),
        node("Reshape", "a heads", "a5"),
        node("Transpose", "a5", "at", perm=[2, 0, 3, 1, 4]),
        node("Split", "at", "q4 k4 v4", axis=0),
        *(node("Squeeze", f"{name}4 axis0", name) for name in "qkv"),
        node("Transpose", "k", "kt", perm=[0, 1, 3, 2]),
        node("MatMul", "q kt", "qk"),
        node("Softmax", "qk", "weights", axis=-1),
        node("MatMul", "weights v", "wv"),
        node("Transpose", "wv", "wt", perm=[0, 2, 1, 3]),
        node("Reshape", "wt joined", "z"),
        node("Mul", "z layer", "zl"),
        node("Add", "x zl", "x3"),
        node("Div", "x3 root2", "g1"),
        node("Erf", "g1", "g2"),
        node("Add", "g2 one", "g3"),
        node("Mul", "x3 g3", "gelu"),
        node("Slice", "gelu axis1 end axis1", "tokens"),
        node("Transpose", "tokens", "f", perm=[0, 2, 1]),
        node("ReduceLogSumExp", "f", "total", axes=[1], keepdims=1),
        node("Sub", "f total", "logs"),
        node("Exp", "logs", "shares"),
        node("Mul", "shares f", "parts"),
        node("ReduceSum", "parts axis2", "d", keepdims=0),
        *UNIT,
    ]
    weights = {"w": numbers(16, 3, 8, 8), "rows": np.array([1, 16, 16]), "cls": numbers(1, 1, 16)}
    weights |= {"position": numbers(1, 17, 16), "scale": numbers(16), "bias": numbers(16)}
    weights |= {"qkv": numbers(16, 48) / 4, "heads": np.array([1, 17, 3, 2, 8]), "layer": numbers(16)}
    weights |= {"joined": np.array([1, 17, 16]), "root2": np.array(2**0.5, np.float32)}
    weights |= {"one": np.array(1, np.float32), "end": np.array([17])}
    weights |= {f"axis{axis}": np.array([axis]) for axis in range(3)}
    return model(nodes, weights | LEAST)
