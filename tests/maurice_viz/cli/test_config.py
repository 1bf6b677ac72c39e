"""The configuration as commands show and check it, and as docs/configuration.md lists it."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from helpers import expect_facts
from helpers.commands import run
from maurice_loaders.config_files import configuration_of, read_config, to_toml
from maurice_loaders.errors import InputError
from maurice_loaders.files.text import toml_value
from maurice_mcl.config.parameters import PRESETS, RULES, Layer, configure, defaults

DOCS = Path(__file__).parents[3] / "docs" / "configuration.md"


def _run(*args, expect=0, **environment):
    return run("config", *args, expect=expect, env=environment)


def _rows():
    rows = [line.strip("|").split("|") for line in DOCS.read_text().splitlines() if line.startswith("| `")]
    return {row[0].strip().strip("`"): [cell.strip() for cell in row[1:]] for row in rows if len(row) == 5}


@pytest.mark.parametrize("preset", [None, *PRESETS])
def test_what_is_shown_reads_back_to_the_same(tmp_path, preset):
    args = [] if preset is None else ["--preset", preset]
    shown = _run(*args).stdout
    file = tmp_path / "shown.toml"
    file.write_text(shown)
    expected = configuration_of(preset, None, {}, {})
    assert configuration_of(None, file, {}, {}).values() == expected.values()
    file.write_text(_run("--config", file).stdout)
    assert configuration_of(None, file, {}, {}).values() == expected.values()


def test_every_layer_is_named_where_it_wins(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text("particles = 700\n[sensor]\nsharpness = 2\nblend = 'sum'\n")
    shown = _run("--preset", "thesis", "--config", file, MAURICE_FILTER_SENSOR__SHARPNESS="3").stdout
    for line in (
        f"particles = 700  # from {file}",
        "sharpness = 3.0  # from MAURICE_FILTER_SENSOR__SHARPNESS",
        f'blend = "sum"  # from {file}',
        'method = "nearest"  # from preset thesis',
        "below = 0.5  # from default",
    ):
        assert line in shown.splitlines()


def test_defaults_that_a_filter_does_not_use_are_only_named():
    """Neither a laser's nor another recovery's for the thesis's filter; what anyone set is shown."""
    shown = _run("--preset", "thesis").stdout
    assert "max_beams" not in shown
    assert "teleport" not in shown
    assert "# defaults of no use to this filter: guided_motion, " in shown
    assert "sensor.laser" in shown.splitlines()[-1]
    set_by_hand = _run("--preset", "thesis", "--set", "sensor.laser.max_beams=30").stdout
    assert "max_beams = 30  # from command line" in set_by_hand
    assert "max_beams" in _run("--preset", "amcl").stdout
    assert "deviations" in _run("--preset", "robust").stdout


def test_shown_origins_and_keys(tmp_path):
    plain = json.loads(_run("--json").stdout)
    assert {key: one["value"] for key, one in plain.items()} == json.loads(json.dumps(defaults()))
    named = json.loads(_run("--json", MAURICE_FILTER_PARTICLES="9").stdout)
    assert named["particles"] == {"value": 9, "origin": "MAURICE_FILTER_PARTICLES"}
    found = configure([Layer("two\nlines", {"particles": 7})])
    file = tmp_path / "shown.toml"
    file.write_text(to_toml(found, origins=True))
    assert read_config(file).values["particles"] == 7


WRONG = {
    "[sensor]\nsharpnes = 1": ": sensor.sharpnes is not known; did you mean sensor.sharpness?",
    "[sensor]\nsharpness = -3": ": sensor.sharpness: found -3, expected a number from 0 to 10000",
    "[sensor.weights]\ncolour = 1": ": sensor.weights: no channel called 'colour'; expected one of color, ",
    "[resampling]\nadaptive = 1": ": resampling.adaptive: found 1, expected true or false",
    "[resampling.kld]\nleast = 30000": ": resampling.kld.least: found 30000, expected at most ",
    "[motion]\nmodel = 'boat'": ": motion.model: found 'boat', expected one of maurice, odometry",
    "[motion]\nmodel = 'odometry'\nturn_from_tern = 1": ": robot.motion.turn_from_tern is not known",
    "particles = ": ": cannot be read as TOML: ",
    "sensor = 3": ": sensor is not known",
}


@pytest.mark.parametrize("text", WRONG)
def test_check_names_file_key_value_and_range_in_one_line(tmp_path, text):
    file = tmp_path / "wrong.toml"
    file.write_text(text)
    done = _run("--config", file, expect=1)
    assert done.stderr.startswith(f"maurice-replay: {file}{WRONG[text]}")
    assert len(done.stderr.splitlines()) == 1
    assert done.stdout == ""


def test_check_reads_the_file_alone(tmp_path):
    file = tmp_path / "good.toml"
    file.write_text("particles = 5\n")
    assert tomllib.loads(_run("--config", file).stdout)["particles"] == 5
    wrong = _run(expect=1, MAURICE_FILTER_PARTICLES="x").stderr
    expect_facts(wrong, "MAURICE_FILTER_PARTICLES: particles: found 'x', expected a whole")
    assert "found no such file" in _run("--config", tmp_path / "none.toml", expect=1).stderr


values = st.recursive(
    st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=6,
)


@given(st.dictionaries(st.text(), values, max_size=4))
def test_any_motion_table_reads_back(table):
    assert tomllib.loads(f"motion = {toml_value(table)}")["motion"] == table


def test_the_documentation_has_every_key_in_order_with_its_default():
    rows = _rows()
    assert list(rows) == list(RULES)
    for key, default in defaults().items():
        shown = "none" if default is None else f"`{toml_value(default)}`"
        assert rows[key][3] == shown, key
        assert rows[key][0], f"{key} has no meaning"


@pytest.mark.parametrize("key", [key for key, row in _rows().items() if re.match(r"[-\d]", row[2])])
def test_the_documented_range_is_the_one_that_is_checked(key):
    low, high = (float(part) for part in _rows()[key][2].split(" to "))
    whole = isinstance(defaults()[key], int)
    for bound in (low, high):
        assert RULES[key](key, int(bound) if whole else bound) == bound
    step = 1 if whole else 1e-10
    for beyond in (low - step, high + max(step, abs(high) * 1e-9) if not whole else high + 1):
        with pytest.raises(ValueError, match=key):
            RULES[key](key, int(beyond) if whole else beyond)


@pytest.mark.parametrize("key", [key for key, row in _rows().items() if row[2].startswith("`")])
def test_the_documented_words_are_those_that_are_checked(key):
    words = re.findall(r"`(\w+)`", _rows()[key][2])
    with pytest.raises(ValueError, match="expected one of") as caught:
        RULES[key](key, "no such word")
    named = str(caught.value).split("expected one of ")[1].partition(";")[0]
    assert set(named.split(", ")) == set(words)


def test_the_documented_example_and_presets_are_real(tmp_path):
    text = DOCS.read_text()
    file = tmp_path / "example.toml"
    file.write_text(re.findall(r"```toml\n(.*?)```", text, re.S)[0])
    assert configuration_of(None, file, {}, {}).parameters.particles == 1000
    named = re.findall(r"^\| `([\w-]+)` \| [^|]* \|$", text, re.M)
    assert named == list(PRESETS)
    expect_facts(text, "my.toml: sensor.sharpness: found -3", "from 0 to 10000")


def test_errors_of_every_layer_begin_with_their_origin(tmp_path):
    for preset, environment, typed, origin in (
        (None, {"MAURICE_FILTER_PARTICLE": "1"}, {}, "MAURICE_FILTER_PARTICLE"),
        (None, {}, {"particles": 0}, "command line"),
    ):
        with pytest.raises(InputError, match=f"^{origin}: "):
            configuration_of(preset, None, environment, typed)


def test_what_a_replay_leaves_out_of_amcls_parameters_is_said(tmp_path):
    file = tmp_path / "nav2.yaml"
    file.write_text(
        "amcl: {alpha1: 0.1, max_beams: 60, laser_model_type: beam, alhpa2: 3, tf_broadcast: true}"
    )
    said = _run("--amcl", file).stderr
    expect_facts(said, "mean nothing in a replay: tf_broadcast", "not AMCL's, left out: 'alhpa2'")
