"""A viewer's blueprint as a value: which tab is in front, which view fills the window.

Blueprints are dictionaries as `ViewerClient.get_blueprint` returns them: path, then archetype, then field.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

CONTAINER, VIEWPORT = "ContainerBlueprint", "ViewportBlueprint"

Blueprint = dict[str, Any]


class LayoutError(ValueError):
    """No layout or view of that name, or several; the message lists the known ones."""


def with_layout(blueprint: Blueprint, name: str) -> Blueprint:
    """Bring the tab of that name to the front. Raises LayoutError where the recording lacks it."""
    changed = copy.deepcopy(blueprint)
    containers = {
        path: fields[CONTAINER] for path, fields in changed.items() if path.startswith("/container/")
    }
    root = containers.get(f"/container/{changed['/viewport'][VIEWPORT].get('root_container')}", {})
    tabs = _tabs_under(root, containers)
    if name not in tabs:
        raise LayoutError(f"found no layout {name!r}; it has {', '.join(tabs) or 'none by name'}")
    holder, member = tabs[name]
    holder["active_tab"] = member
    return changed


def _tabs_under(holder: dict[str, Any], containers: Mapping[str, Any]) -> dict[str, tuple[Any, str]]:
    """Return each named tab with its container; an unnamed tab is searched."""
    found: dict[str, tuple[Any, str]] = {}
    contents = holder.get("contents", [])
    for member in [contents] if isinstance(contents, str) else contents:
        inner = containers.get("/" + member.removeprefix("/"), {})  # the viewer writes it either way
        if inner.get("display_name"):
            found[inner["display_name"]] = (holder, member)
        elif inner.get("container_kind") == "Tabs":
            found |= _tabs_under(inner, containers)
    return found


def maximized(blueprint: Blueprint, views: Mapping[str, str], name: str) -> Blueprint:
    """Let one view fill the window: `views` are ids by title, `name` a title or the beginning of exactly one.

    Case does not matter. Raises LayoutError for anything else.
    """
    sought = name.casefold()
    same = [title for title in views if title.casefold() == sought]
    fitting = same or [title for title in views if title.casefold().startswith(sought)]
    if len(fitting) != 1:
        which = ", ".join(repr(title) for title in sorted(fitting or views))
        found = f"found {len(fitting) or 'no'} views that begin with {name!r}"
        raise LayoutError(f"{found}; {'these are' if fitting else 'there are'} {which}")
    changed = copy.deepcopy(blueprint)
    changed["/viewport"][VIEWPORT]["maximized"] = views[fitting[0]]
    return changed
