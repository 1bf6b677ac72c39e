"""A sensor of another package: the example of docs/sensors.md, installed, used, and kept by saved runs."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import maurice_viz as mv
from helpers.commands import failure, maurice, process, run
from helpers.small_session import write_small_session, write_small_survey
from maurice_loaders import InputError, open_run
from maurice_mcl.config.build import make_localizer
from maurice_mcl.config.parameters import Layer, configure
from maurice_mcl.examples import tiny_library, tiny_session
from maurice_mcl.filter.localizer import run as run_filter
from maurice_mcl.sensor.outside import load_sensor, package_of

ROOT = Path(__file__).parents[3]
EXAMPLE = ROOT / "docs" / "examples" / "beacon"
FILTER = ["-o", "none", "--particles", "100"]


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """The small drive with ranges, as the page makes it."""
    folder = tmp_path_factory.mktemp("beacon")
    write_small_survey(folder)
    words = [sys.executable, "-m", "beacon", write_small_session(folder), folder / "beacon.log"]
    subprocess.run(words, cwd=EXAMPLE, check=True, capture_output=True)
    return folder / "beacon.log"


@pytest.fixture
def site(tmp_path):
    """A folder that the package is installed into, as setuptools lays it out: needs no network."""
    pytest.importorskip("setuptools")
    source, site = tmp_path / "source", tmp_path / "site"
    shutil.copytree(EXAMPLE, source)
    site.mkdir()
    script = "import setuptools; setuptools.setup()"
    python = [sys.executable, "-W", "ignore", "-c", script]
    words = [*python, "-q", "egg_info", "-e", str(site), "build_py", "-d", str(site)]
    subprocess.run(words, cwd=source, check=True, capture_output=True)
    return site


@pytest.fixture
def module(tmp_path, monkeypatch):
    """Return a function that writes a module, which can be imported, and its name."""
    monkeypatch.syspath_prepend(str(tmp_path / "modules"))
    (tmp_path / "modules").mkdir()

    def write(name, *changes):
        text = (EXAMPLE / "beacon.py").read_text()
        for old, new in changes:
            assert text.count(old)
            text = text.replace(old, new)
        (tmp_path / "modules" / f"{name}.py").write_text(text)
        return name

    yield write
    for name in [name for name in sys.modules if name.startswith("own_")]:
        del sys.modules[name]


def test_it_is_installed_used_by_name_saved_verified_and_refused_where_it_is_missing(drive, site, tmp_path):
    installed, saved = {"PYTHONPATH": str(site)}, tmp_path / "run"
    process(drive, "--sensor", "beacon", *FILTER, "--save-run", saved, **installed)
    manifest = open_run(saved).manifest
    assert dict(manifest.sensors) == {"beacon": "maurice-beacon"}
    assert manifest.versions["maurice-beacon"] == "1.0"
    assert open_run(saved).configuration.parameters.sensor.weights["beacon"] == 1.0
    assert "the same, all" in process("verify", saved, **installed).stdout
    assert failure("verify", saved).endswith("not installed here: pip install maurice-beacon==1.0")
    (metadata,) = site.glob("*.egg-info/PKG-INFO")
    metadata.write_text(metadata.read_text().replace("Version: 1.0", "Version: 1.1"))
    assert "maurice-beacon was 1.0, is 1.1" in process("verify", saved, **installed).stdout


def test_saved_runs_what_if_check_and_the_python_api_carry_it(drive, module, tmp_path):
    spelled, saved = f"{module('own_beacon')}:Beacon", tmp_path / "run"
    scores = mv.replay(drive, filter=mv.Filter(sensors=[spelled], particles=100), save_run=saved)
    without = mv.replay(drive, filter=mv.Filter(particles=100))
    assert scores.runs[0].score.error_mean_m != without.runs[0].score.error_mean_m
    assert mv.verify(saved)[0].same
    outside = ["--set", f"sensor.outside={spelled}"]
    maurice("what-if", saved, "--from", "1", "--set", "resampling.scheme=residual", "-o", "none")
    maurice("what-if", saved, "--from", "1", "--preset", "thesis", "-o", "none")
    maurice("diagnose", saved)
    maurice("explain", saved, "--step", "2")
    assert run("check", drive, *outside, "--max-error", "100m", "--particles", "100").exit_code == 0
    features = ["--feature", "color", "--feature", "edges"]
    out, _ = maurice("compare", drive, "--sensor", spelled, *features, *FILTER)
    assert "color" in out
    assert "edges" in out


def test_which_file_of_a_users_is_run_is_said(drive, module, tmp_path):
    name = module("own_home")
    _, err = maurice(drive, "--sensor", f"{name}:Beacon", *FILTER)
    assert f"sensor {name}:Beacon is run from {tmp_path / 'modules' / name}.py\n" in err


def test_a_run_by_it_alone_is_verified_branched_and_explained_in_units(drive, module, tmp_path):
    spelled, saved = f"{module('own_alone')}:Beacon", tmp_path / "run"
    alone = {"sensor.weights": {"beacon": 1}}
    mv.replay(drive, filter=mv.Filter(sensors=[spelled], settings=alone, particles=100), save_run=saved)
    assert open_run(saved).manifest.channels == ()
    assert mv.verify(saved)[0].same
    maurice("what-if", saved, "--from", "1", "--set", "resampling.scheme=residual", "-o", "none")
    out, _ = maurice("explain", saved, "--step", "2")
    assert "the beacon is" in out
    assert "{}" not in out


def test_it_has_weight_1_unless_the_weights_name_it(module):
    spelled = f"{module('own_weights')}:Beacon"
    outside = Layer("file", {"sensor.outside": spelled})
    assert configure([outside]).parameters.sensor.weights["beacon"] == 1.0
    named = Layer("file", {"sensor.weights": {"color": 1, "beacon": 0.5}})
    assert dict(configure([named, outside]).parameters.sensor.weights) == {"color": 1, "beacon": 0.5}
    assert list(make_localizer(tiny_library(), sensors=[spelled]).sensor.sensors) == ["beacon"]


@pytest.mark.parametrize(
    ("changes", "wanted"),
    [
        ([("class Beacon:", "class Other:")], "found no Beacon in the module"),
        ([("def propose", "def suggest")], "has no propose"),
        ([('name = "beacon"', 'name = "color"')], "its name is 'color'"),
        ([('name = "beacon"', "name = 3")], "its name is 3"),
        ([('name = "beacon"', "label = 3")], "its name is None"),
        ([("import sys", "import sys_that_is_not_there")], "no module named 'sys_that_is_not_there'"),
        ([("PLACE_M = (1.0, 0.5)", "PLACE_M = 1 / 0")], "ZeroDivisionError"),
        ([("PLACE_M = (1.0, 0.5)", "sys.exit(0)")], "its module raised SystemExit: 0"),
        (
            [("class Beacon:", "class Beacon:\n    def __init__(self): sys.exit()\n")],
            "raised SystemExit",
        ),
        ([("class Beacon:", "class Beacon:\n    def __init__(self, port): pass\n")], "TypeError"),
    ],
)
def test_what_is_no_sensor_is_refused_in_one_line(module, drive, changes, wanted, request):
    name = module(f"own_{abs(hash(request.node.name))}", *changes)
    line = failure(drive, "--sensor", f"{name}:Beacon", *FILTER)
    assert wanted in line


@pytest.mark.parametrize(
    ("change", "wanted"),
    [
        (("-WORST_NATS).astype", "-np.inf).sum().astype"), "log_likelihood gave float32 ()"),
        (("-0.5 * deviations**2", "np.nan * deviations"), "log_likelihood gave no finite numbers"),
        (('readings.get("range")', 'readings["rage"]'), "read raised KeyError"),
        (('readings.get("range")', "readings.get(sys.exit(0))"), "read raised SystemExit"),
    ],
)
def test_one_that_fails_during_a_run_ends_it_in_one_line(module, drive, change, wanted, request):
    name = module(f"own_{abs(hash(request.node.name))}", change)
    *_, line = run(drive, "--sensor", f"{name}:Beacon", *FILTER, expect=1).stderr.splitlines()
    assert wanted in line


@pytest.mark.parametrize("spelled", ["beacon", "no_such_module:Beacon", "os:system", "pathlib:Path", "a b:c"])
def test_a_name_that_is_no_sensor_is_refused_before_anything_is_called(spelled):
    with pytest.raises(InputError, match=f"sensor '?{spelled}"):
        load_sensor(spelled)
    assert package_of("beacon") == ("beacon", "not there")


def test_the_page_quotes_the_example():
    page, source = ((path).read_text() for path in (ROOT / "docs" / "sensors.md", EXAMPLE / "beacon.py"))
    page = page.split("## A sensor of your own")[1]
    code = page.split("```python\n")[1].split("```")[0]
    assert code.strip() in source
    points = page.split("```toml\n")[1].split("```")[0]
    assert points.strip() in (EXAMPLE / "pyproject.toml").read_text()


def test_a_reading_shows_in_the_units_of_the_session(module):
    sensor = load_sensor(f"{module('own_shown')}:Beacon")
    shown = sensor.shown(1.5, {}).text(lambda length_m: f"{length_m * 100:.0f} cm")
    assert shown == "the beacon is 150 cm away"
    localizer = make_localizer(tiny_library(), sensors=[sensor])
    assert len(list(run_filter(localizer, tiny_session()))) == 6
