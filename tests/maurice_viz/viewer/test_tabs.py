"""Arranging a viewer: which tab is in front, which view fills the window."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from helpers import viz_fakes as fakes
from helpers import viz_recordings as recordings
from maurice_loaders.errors import InputError
from maurice_viz.viewer.open_viewers import LayoutError, with_layout
from maurice_viz.viewer.snapshot import expect_whole_frames, maximized

VIEWS = {"Belief: particles (in)": "b", "Edges": "e", "Edges difference": "d", "Camera (px)": "c"}


def container(kind: str, contents: str | list[str], **more: str) -> dict[str, Any]:
    return {"ContainerBlueprint": {"container_kind": kind, "contents": contents, **more}}


def blueprint() -> dict[str, Any]:
    return {
        "/container/root": container("Tabs", "container/tabs", active_tab="container/tabs"),
        "/container/tabs": container("Tabs", ["container/one", "container/two"], active_tab="container/one"),
        "/container/one": container("Horizontal", ["view/b"], display_name="overview"),
        "/container/two": container("Vertical", ["view/e"], display_name="traces"),
        "/viewport": {"ViewportBlueprint": {"root_container": "root"}},
    }


def test_a_layout_comes_to_the_front():
    before = blueprint()
    after = with_layout(before, "traces")
    assert before == blueprint()
    assert after["/container/tabs"]["ContainerBlueprint"].pop("active_tab") == "container/two"
    del before["/container/tabs"]["ContainerBlueprint"]["active_tab"]
    assert after == before
    rewritten = blueprint()
    for fields in (rewritten[f"/container/{name}"]["ContainerBlueprint"] for name in ("root", "tabs")):
        contents = fields["contents"]
        fields["contents"] = f"/{contents}" if isinstance(contents, str) else [f"/{c}" for c in contents]
    after = with_layout(rewritten, "traces")
    assert after["/container/tabs"]["ContainerBlueprint"]["active_tab"] == "/container/two"
    with pytest.raises(LayoutError, match="'map'; it has overview, traces"):
        with_layout(blueprint(), "map")


def test_the_tab_of_a_run_comes_to_the_front_in_a_layout():
    before = blueprint() | {
        "/container/two": container("Tabs", ["container/a", "container/b"], display_name="traces"),
        "/container/a": container("Horizontal", ["view/e"], display_name="thesis"),
        "/container/b": container("Horizontal", ["view/d"], display_name="robust"),
    }
    after = with_layout(before, "traces", "robust")
    assert after["/container/tabs"]["ContainerBlueprint"]["active_tab"] == "container/two"
    assert after["/container/two"]["ContainerBlueprint"]["active_tab"] == "container/b"
    with pytest.raises(LayoutError, match="'none' in the layout traces; it has thesis, robust"):
        with_layout(before, "traces", "none")
    with pytest.raises(LayoutError, match="it has all runs in one"):
        with_layout(before, "overview", "robust")


@pytest.mark.parametrize(
    ("name", "view"), [("belief", "b"), ("Edges", "e"), ("edges d", "d"), ("CAMERA (PX)", "c")]
)
def test_a_view_is_found_by_its_title_or_how_that_begins(name, view):
    before = blueprint()
    after = maximized(copy.deepcopy(before), VIEWS, name)
    assert after["/viewport"]["ViewportBlueprint"].pop("maximized") == view
    assert after == before


@pytest.mark.parametrize(("name", "message"), [("map", "no views"), ("e", "2 views"), ("", "4 views")])
def test_no_view_or_several_are_refused_with_their_titles(name, message):
    with pytest.raises(LayoutError, match=message) as problem:
        maximized(blueprint(), VIEWS, name)
    assert "'Edges'" in str(problem.value)


def test_a_recording_that_ends_inside_of_a_frame_is_refused_at_once(tmp_path):
    path = tmp_path / "a.rrd"
    recordings.draw(path, fakes.make_session(fakes.make_library(), 2), ["color"])
    expect_whole_frames(path)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(InputError, match=r"was cut off; `rerun rrd optimize a.rrd -o repaired.rrd`"):
        expect_whole_frames(path)


@pytest.mark.parametrize("content", [b"no recording", b"", None])
def test_what_is_no_recording_is_refused_at_once(content, tmp_path):
    path = tmp_path / "a.rrd"
    if content is None:  # cut off before it says of what it is
        recordings.draw(path, fakes.make_session(fakes.make_library(), 2), ["color"])
        content = path.read_bytes()[:1000]
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"found no Rerun recording|was cut off"):
        expect_whole_frames(path)
