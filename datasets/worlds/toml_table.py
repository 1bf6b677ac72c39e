"""One table of a TOML file, read key by key; `done` refuses the keys that were not read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from maurice_mcl.values import Rule, choice, expected_one_of, number, text, truth

from .plan import Choice, Number, NumberRange, Rect, Word, WorldError

FARTHEST = 1e5  # no length of a building is longer, in inches
Read = TypeVar("Read")


class Table:
    """A table of the file, with the key that leads to it."""

    def __init__(self, file: Path, key: str, values: dict[str, object], inches: float = 1.0) -> None:
        self.file, self.key, self.inches = file, key, inches
        self._left = dict(values)
        self._known: set[str] = set()  # asked for so far

    def named(self, key: str) -> str:
        """Return the full key, like `room[1].rect`."""
        return f"{self.key}.{key}" if self.key else key

    def fail(self, key: str, why: str) -> NoReturn:
        """Raise the one-line error for a key of this table."""
        raise WorldError(self.file, f"{self.named(key) if key else self.key}: {why}")

    def has(self, key: str) -> bool:
        """Return whether a key is there and was not read yet."""
        self._known.add(key)
        return key in self._left

    def take(self, key: str) -> object:
        """Remove and return a value of any type; an error if it is missing."""
        self._known.add(key)
        if key not in self._left:
            self.fail(key, "is missing; add it")
        return self._left.pop(key)

    def checked(self, key: str, rule: Rule, value: Any) -> Any:
        """Return a value as a rule takes it."""
        try:
            return rule(self.named(key), value)
        except ValueError as problem:
            raise WorldError(self.file, str(problem)) from None

    def text(self, key: str, default: str | None = None) -> str:
        """Read a word."""
        value = default if default is not None and not self.has(key) else self.take(key)
        word: str = self.checked(key, text, value)
        if not word.strip():
            self.fail(key, "found an empty text, expected a word in quotes")
        return word

    def one_of(self, key: str, known: tuple[str, ...], default: str | None = None) -> str:
        """Read one of some words."""
        word: str = self.checked(key, choice(*known), self.text(key, default))
        return word

    def flag(self, key: str) -> bool:
        """Read true or false; false where the key is missing."""
        value: bool = self.checked(key, truth, self.take(key)) if self.has(key) else False
        return value

    def tables(self, key: str) -> tuple[Table, ...]:
        """Read a list of tables; none where the key is missing."""
        value = self.take(key) if self.has(key) else []
        if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
            self.fail(key, f"expected tables, written [[{key}]] or {key} = [{{...}}, ...]")
        return tuple(
            Table(self.file, f"{self.named(key)}[{k}]", item, self.inches) for k, item in enumerate(value)
        )

    def table(self, key: str) -> Table:
        """Read one table; an empty one where the key is missing."""
        return self.as_table(key, self.take(key) if self.has(key) else {})

    def as_table(self, key: str, value: object) -> Table:
        """Return a value as a table; an error if it is not one."""
        if not isinstance(value, dict):
            self.fail(key, f"found {value!r}, expected a table")
        return Table(self.file, self.named(key), value, self.inches)

    def each(self, key: str, read: Callable[..., Read], *more: Any) -> tuple[Read, ...]:
        """Read a list of tables, each as a whole."""
        return tuple(table.whole(read, *more) for table in self.tables(key))

    def whole(self, read: Callable[..., Read], *more: Any) -> Read:
        """Return what is made of this table and `more`; an error for keys that were not read."""
        value = read(self, *more)
        self.done()
        return value

    def items(self) -> list[tuple[str, object]]:
        """Return all items that have not been read yet."""
        return list(self._left.items())

    def items_of(self, key: str, count: tuple[int, ...]) -> list[object]:
        """Read a list of so many values."""
        value = self.take(key)
        if not isinstance(value, list) or len(value) not in count:
            count_in_words = " or ".join(map(str, count)) if len(count) < 4 else f"{count[0]} to {count[-1]}"
            self.fail(key, f"found {value!r}, expected a list of {count_in_words} values")
        return value

    def real(
        self, key: str, value: object, unit: float = 1.0, low: float = -FARTHEST, high: float = FARTHEST
    ) -> float:
        """Check one number, and bring it to inches or radians by `unit`."""
        if isinstance(value, str):
            self.fail(key, f"found {value!r:.60}, expected a number")
        amount: float = self.checked(key, number(low / unit, high / unit), value)
        return amount * unit

    def drawn(
        self, key: str, value: object, unit: float = 1.0, low: float = -FARTHEST, high: float = FARTHEST
    ) -> Number:
        """Check a number or `{ from = a, to = b }`."""
        if not isinstance(value, dict):
            return self.real(key, value, unit, low, high)
        inner = self.as_table(key, value)
        ends = inner.whole(lambda t: [t.real(end, t.take(end), unit, low, high) for end in ("from", "to")])
        if ends[0] > ends[1]:
            self.fail(key, f"goes from {ends[0] / unit:g} down to {ends[1] / unit:g}; put the smaller first")
        return NumberRange(ends[0], ends[1])

    def number(
        self, key: str, default: float | None = None, low: float = -FARTHEST, high: float = FARTHEST
    ) -> Number:
        """Read a plain number or a span of them."""
        if default is not None and not self.has(key):
            return default
        return self.drawn(key, self.take(key), 1.0, low, high)

    def length(self, key: str, default_in: float | None = None, low: float = 0.0) -> float:
        """Read a length, in inches."""
        if default_in is not None and not self.has(key):
            return default_in
        return self.real(key, self.take(key), self.inches, low)

    def lengths(self, key: str, count: tuple[int, ...], low: float = -FARTHEST) -> tuple[Number, ...]:
        """Read a list of lengths or spans, in inches."""
        return tuple(self.drawn(key, item, self.inches, low) for item in self.items_of(key, count))

    def rect(self, key: str) -> Rect:
        """Read [x1, y1, x2, y2], in inches."""
        x1, y1, x2, y2 = (self.real(key, item, self.inches) for item in self.items_of(key, (4,)))
        if x1 >= x2 or y1 >= y2:
            self.fail(key, "has no area; write [x1, y1, x2, y2] with x1 < x2 and y1 < y2")
        return x1, y1, x2, y2

    def word(self, key: str, value: object) -> Word:
        """Check a word or `{ any = ["a", "b"] }`."""
        if isinstance(value, str) and value:
            return value
        options = value["any"] if isinstance(value, dict) and list(value) == ["any"] else None
        if not (isinstance(options, list) and options and all(isinstance(o, str) and o for o in options)):
            self.fail(key, f'found {value!r}, expected a word in quotes or {{ any = ["one", "other"] }}')
        return Choice(tuple(options))

    def done(self) -> None:
        """Raise WorldError for keys that were not read."""
        if self._left:
            first = next(iter(self._left))
            self.fail(first, f"no such key; {expected_one_of(first, sorted(self._known))}")
