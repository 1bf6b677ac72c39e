"""Calls side by side give what calls one by one give, and take few items ahead."""

from __future__ import annotations

import os
import time

import pytest

from maurice_mcl.sensor.ahead import ITEMS_AHEAD, on_all_cores


@pytest.mark.parametrize("count", [0, 1, 50])
def test_results_are_in_order(count):
    def slow_first(number):
        time.sleep(0.02 if number % 7 == 0 else 0)
        return 3 * number

    assert list(on_all_cores(slow_first, range(count))) == [3 * number for number in range(count)]


def test_few_items_are_taken_ahead():
    taken = []
    results = on_all_cores(abs, (taken.append(number) or number for number in range(1000)))
    for done in range(1, 10):
        next(results)
        assert len(taken) <= done + ITEMS_AHEAD * (os.cpu_count() or 1)
    results.close()
    assert len(taken) < 1000


@pytest.mark.parametrize("where", ["call", "items"])
def test_an_error_is_raised_where_it_happened(where):
    def items():
        yield from range(5)
        if where == "items":
            raise KeyError(5)
        yield 5

    def call(number):
        return number if number < 5 else {}[number]

    with pytest.raises(KeyError, match="5"):
        list(on_all_cores(call, items()))
