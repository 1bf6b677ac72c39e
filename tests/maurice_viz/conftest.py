from collections.abc import Iterator

import pytest
import rerun as rr


@pytest.fixture(autouse=True)
def strict_rerun() -> Iterator[None]:
    """Wrong data is an error, not a warning."""
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)
