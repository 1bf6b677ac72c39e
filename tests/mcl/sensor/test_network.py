"""A channel from an ONNX file: what it gives, and one line for what is none."""

from __future__ import annotations

import numpy as np
import pytest

from helpers import onnx_files as onnx
from maurice_mcl import InputError
from maurice_mcl.sensor.descriptors.network import network_of
from maurice_mcl.sensor.descriptors.registry import CHANNELS, channel_names, give_channels

RNG = np.random.default_rng(5)
IMAGE = RNG.integers(0, 256, (30, 40, 3), np.uint8)
FLAT = np.full((30, 40, 3), (255, 102, 0), np.uint8)  # shares 1, 0.4, 0
SHARES = np.array([1, 0.4, 0])


@pytest.fixture
def network(tmp_path):
    def write(content, table=None, name="net.onnx"):
        (tmp_path / name).write_bytes(content)
        if table is not None:
            (tmp_path / name).with_suffix(".toml").write_text(table)
        return network_of(f"onnx:{tmp_path / name}")

    return write


def test_pictures_are_given_as_imagenets_unless_the_file_or_the_table_says_otherwise(network):
    usual = (SHARES - [0.485, 0.456, 0.406]) / [0.229, 0.224, 0.225]
    assert np.allclose(network(onnx.means()).describe(FLAT), usual, atol=1e-5)
    told = onnx.means(metadata={"mean": "[0.5, 0.5, 0.5]", "std": "0.25", "author": "somebody"})
    assert np.allclose(network(told).describe(FLAT), (SHARES - 0.5) / 0.25, atol=1e-5)
    table = 'mean = 0\nstd = 0.5\norder = "BGR"'
    assert np.allclose(network(told, table).describe(FLAT), SHARES[::-1] / 0.5, atol=1e-5), (
        "the table decides"
    )


def test_a_gray_network_sees_gray(network):
    nodes = [onnx.node("AveragePool", "image", "p", kernel_shape=[32, 16], strides=[32, 16])]
    nodes += [onnx.node("Flatten", "p", "out", axis=1)]
    content = onnx.model(nodes, {}, {"image": (1, 1, 32, 32)})
    half = np.zeros((32, 32, 3), np.uint8)
    half[:, 16:] = 255
    assert np.allclose(network(content, "mean = 0\nstd = 1").describe(half), [0, 1], atol=1e-6)


def test_the_size_is_the_files_or_else_the_tables(network):
    whole = network(onnx.small_network("n"), "size = [32, 32]").describe(IMAGE)
    assert np.allclose(network(onnx.small_network(32), "").describe(IMAGE), whole, rtol=1e-4, atol=1e-4)
    wide = onnx.means(("n", 3, "h", "w"))
    assert network(wide, "size = [48, 20]").shape.size == (48, 20)
    with pytest.raises(InputError, match=r"\(1, 3, 32, 32\)"):
        network(onnx.means(), "size = [64, 64]")


def test_one_of_several_outputs_is_chosen(network):
    nodes = [onnx.node("GlobalAveragePool", "image", "mean"), onnx.node("GlobalMaxPool", "image", "most")]
    content = onnx.model(nodes, {}, outputs=("mean", "most"))
    table = 'mean = 0\nstd = 1\noutput = "most"'
    assert np.allclose(network(content, table).describe(FLAT), SHARES, atol=1e-6)
    noisy = network(content, table.replace("most", "mean")).describe(IMAGE)
    assert (noisy < network(content, table).describe(IMAGE)).all()
    with pytest.raises(
        InputError, match=r'outputs mean, most, expected one; write output = "NAME" to net.toml'
    ):
        network(content, "")


@pytest.mark.parametrize("head", [onnx.cosplace, onnx.mixvpr, onnx.megaloc])
def test_heads_of_networks_that_people_use_run(network, head):
    channel = network(head())
    first, second = channel.describe(IMAGE), channel.describe(FLAT)
    assert np.isclose(np.linalg.norm(first), 1, atol=1e-5)
    assert first @ second < 0.999


def test_its_name_is_its_files_and_its_hash_that_of_file_and_table(network, tmp_path):
    first = network(onnx.means(), name="MixVPR-512.onnx")
    assert first.name == "mixvpr_512"
    assert network(onnx.means(), name="3d.onnx").name == "net_3d"
    assert first.digest == network(onnx.means(), name="copy.onnx").digest
    assert first.digest != network(onnx.means(), "mean = 0", name="copy.onnx").digest
    assert first.digest != network(onnx.means(metadata={"std": "1"}), name="other.onnx").digest
    (name,) = channel_names("sensor.channels", f"onnx:{tmp_path}/MixVPR-512.onnx")
    assert name == first.part == f"onnx:{tmp_path}/MixVPR-512.onnx@{first.digest}"
    assert give_channels([name]) == ("mixvpr_512",)
    assert CHANNELS["mixvpr_512"].parameters() == {"part": [f"@{first.digest}"]}, "wherever the file is"
    (tmp_path / "MixVPR-512.toml").write_text("mean = 0")
    with pytest.raises(InputError, match=f"expected {first.digest}; the network or its table was changed"):
        give_channels([name])


@pytest.mark.parametrize("name", ["hog.onnx", "landmarks.onnx"])
def test_it_takes_no_name_of_ours(network, name):
    with pytest.raises(ValueError, match="that no channel has; rename the file"):
        give_channels([network(onnx.means(), name=name).part])


def _with(nodes, **more):
    return onnx.model(nodes, {"none": np.zeros(1, np.float32)}, **more)


NUMBER = onnx.node("ReduceMean", "image", "out", axes=[1, 2, 3])
DIVIDED_BY_ZERO = onnx.node("Div", "p none", "out")
RELU = onnx.node("Relu", "image", "out")
BROKEN = {
    "text": (b"these are not weights\n" * 40, "is no ONNX file"),
    "empty": (b"", "is no ONNX file"),
    "cut": (onnx.small_network()[:-200], "is no ONNX file, or is cut off"),
    "cut short": (onnx.small_network()[:9], "is no ONNX file, or is cut off"),
    "unknown operator": (_with([onnx.node("Frobnicate", "image", "out")]), "has no operator Frobnicate"),
    "unknown input": (_with([onnx.node("Relu", "nothing", "out")]), "OpenCV .* cannot read it"),
    "a map": (_with([RELU]), r"shape \(1, 3, 32, 32\), expected one descriptor, \(1, D\)"),
    "a number": (
        _with([onnx.node("ReduceMean", "image", "out", axes=[1, 2, 3])]),
        r"expected one descriptor",
    ),
    "six colors": (onnx.means((1, 6, 32, 32)), r"\(1, 6, 32, 32\), expected \(1, 3, height, width\)"),
    "two pictures": (onnx.means((2, 3, 32, 32)), r"\(2, 3, 32, 32\), expected \(1, 3, height, width\)"),
    "colors last": (onnx.means((1, 32, 32, 3)), r"expected \(1, 3, height, width\)"),
    "flat": (onnx.means((1, 3072)), r"expected \(1, 3, height, width\)"),
    "any size": (onnx.means(("n", 3, "h", "w")), r"write its size to net.toml beside it"),
    "whole numbers": (onnx.means(kind=2), "type 2, expected float32"),
    "two inputs": (
        _with([RELU], inputs={"image": (1, 3, 8, 8), "mask": (1, 3, 8, 8)}),
        r"found 2 inputs \(image, mask\), expected one",
    ),
    "no input": (_with([RELU], inputs={}), r"found 0 inputs \(none\)"),
    "not finite": (
        _with([onnx.node("GlobalAveragePool", "image", "p"), DIVIDED_BY_ZERO]),
        "its output is not finite",
    ),
    "bad metadata": (onnx.means(metadata={"std": "0"}), "std: found 0, expected one number or three above 0"),
}


@pytest.mark.parametrize("what", BROKEN)
def test_what_is_no_network_is_one_line(network, capfd, what):
    content, said = BROKEN[what]
    with pytest.raises(InputError, match=said) as caught:
        network(content)
    assert len(str(caught.value).splitlines()) == 1
    assert "/net.onnx: " in str(caught.value)
    assert capfd.readouterr() == ("", ""), "OpenCV says nothing of its own"


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("size = 320", "size: found 320, expected"),
        ("size = [0, 320]", "sides of 1 to 4096 pixels"),
        ("mean = [0.5, 0.5]", "mean: found"),
        ('std = "wide"', "std: found 'wide'"),
        ('order = "GBR"', 'order: found \'GBR\', expected "RGB" or "BGR"'),
        ("sd = 1", "found sd, expected size, mean, std, order, output"),
        ('output = "none"', "found the outputs out, expected none"),
        ("size = [", "is no TOML"),
    ],
)
def test_a_table_that_says_nothing_sensible_is_one_line(network, table, said):
    with pytest.raises(InputError, match=said.replace("[", r"\[")) as caught:
        network(onnx.means(("n", 3, "h", "w") if "size" in table else (1, 3, 32, 32)), table)
    assert len(str(caught.value).splitlines()) == 1


def test_no_file_is_one_line(tmp_path):
    with pytest.raises(InputError, match=r"gone.onnx: cannot be read: No such file"):
        network_of(f"onnx:{tmp_path}/gone.onnx")


def test_weights_in_another_file_are_asked_for(network):
    far = onnx.tensor("w", onnx.numbers(8, 3, 3, 3)) + onnx.field(14, 1)
    with pytest.raises(InputError, match=r"its weights are in another file; export it as one file"):
        network(onnx.model([onnx.node("Conv", "image w", "out")], {"w": far}))
