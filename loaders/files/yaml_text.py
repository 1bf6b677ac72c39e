"""YAML files of robots, read with bounds: a map's, AMCL's parameters, a bag's metadata."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from .text import read_bounded

if TYPE_CHECKING:
    from ruamel.yaml import YAML

MERGE = "tag:yaml.org,2002:merge"
MOST_MERGED = 100_000  # entries that `<<` may bring; references to references could bring any number


class Section(dict[Any, Any]):
    """A mapping of a document. Of a key given twice the last value counts, as to ROS."""

    repeated: tuple[Any, ...] = ()  # keys given twice


def read_yaml(file: Path, wanted: str, most_bytes: int) -> Any:
    """Return the first document of a YAML file: `Section`, list, text, number, bool or None. InputError.

    References are shared, not copied, so that few bytes never become many.
    """
    from ruamel.yaml import YAML  # a replay without a map.yaml does without
    from ruamel.yaml.error import YAMLError

    data = read_bounded(file, wanted, most_bytes)
    try:
        yaml = YAML(typ="safe", pure=True)
        node = next(iter(yaml.compose_all(data.decode("utf-8-sig"))), None)
        return None if node is None else _Values(yaml).of(node)
    except RecursionError:
        raise InputError(file, f"found YAML nested too deeply, expected {wanted}") from None
    except (YAMLError, ValueError) as problem:
        mark, what = getattr(problem, "problem_mark", None), getattr(problem, "problem", None) or problem
        where = "" if mark is None else f"line {mark.line + 1}: "
        fault = f"found no YAML, {where}{' '.join(str(what).split())[:120]}"
        raise InputError(file, f"{fault}; expected {wanted}") from None


class _Values:
    """Makes plain values of nodes, each once."""

    def __init__(self, yaml: YAML) -> None:
        self._scalars, self._known, self._merged = yaml.constructor, dict[int, Any](), 0

    def of(self, node: Any) -> Any:
        """Return the value of a node. ValueError for references that bring too much, or to themselves."""
        if id(node) in self._known:
            return self._known[id(node)]
        value: Any
        if node.id == "scalar":
            value = self._scalar(node)
        elif node.id == "mapping":
            value = self._known[id(node)] = Section()
            self._fill(value, node)
        else:
            value = self._known[id(node)] = []
            value += map(self.of, node.value)
        self._known[id(node)] = value
        return value

    def _scalar(self, node: Any) -> Any:
        from ruamel.yaml.constructor import ConstructorError

        try:
            return self._scalars.construct_object(node)
        except ConstructorError:  # a tag of somebody's own, such as !degrees
            return node.value

    def _fill(self, section: Section, node: Any) -> None:
        inherited, repeated = dict[Any, Any](), []
        for name, content in node.value:
            if name.tag == MERGE:
                parents = content.value if content.id == "sequence" else [content]
                for parent in map(self.of, reversed(parents)):
                    inherited |= parent if isinstance(parent, Section) else {}
                    self._merged += len(inherited)
                if self._merged > MOST_MERGED:
                    raise ValueError("its references bring more than 100,000 entries")
                continue
            key = self.of(name) if name.id == "scalar" else str(name.start_mark)
            repeated += [key] * (key in section)
            section[key] = self.of(content)
        for key, value in inherited.items():
            section.setdefault(key, value)
        section.repeated = tuple(dict.fromkeys(repeated))
