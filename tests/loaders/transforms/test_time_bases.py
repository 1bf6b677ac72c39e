"""Units of time stamps."""

import pytest

from maurice_loaders.time_alignment import TimeSpan, apart, detect_unit, seconds


@pytest.mark.parametrize(
    ("stamps", "unit"),
    [
        (["1403636601113555456", "1403636621163555584"], "ns"),
        (["1560004885.446172", "1560004885.479529"], "s"),
        (["1560004885446", "1560004885479"], "ms"),
        (["1560004885446172", "1560004885479529"], "us"),
        (["81605000000", "81625000000", "81640000000"], "ns"),  # since the start of the sensor
        (["0.000000e+00", "1.036224e-01"], "s"),
        (["0", "1", "2", "3"], "s"),
        (["0", "100", "200"], "ms"),
        (["0", "33333", "66666"], "us"),
        (["0", "33333333", "66666666"], "ns"),
        (["0.0", "60.5", "120.25"], "s"),  # a picture a minute
        (["7"], "s"),
    ],
)
def test_the_unit_is_told(stamps: list[str], unit: str) -> None:
    assert detect_unit(stamps) == unit


def test_nanoseconds_keep_what_a_float_can_hold() -> None:
    assert seconds("1403636601113555456", "ns") == 1403636601.113555456
    assert seconds("1.5e3", "ms") == 1.5


def test_spans_that_meet_and_that_do_not() -> None:
    one, other = TimeSpan(), TimeSpan()
    for t_s in (10.0, 12.0):
        one.add(t_s)
    for t_s in (12.5, 14.0):
        other.add(t_s)
    assert not one.overlaps(other)
    assert one.overlaps(other, 1.0)
    assert apart("pictures", one, "truth", other).endswith("their beginnings are -2.500 s apart")
