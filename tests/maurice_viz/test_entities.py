import pytest

from maurice_viz.entities import Phase, RunPaths, phase_number


def test_phases_of_a_step_follow_each_other_and_steps_do_not_overlap() -> None:
    numbers = [phase_number(step, slot) for step in (1, 2) for slot in Phase]
    assert numbers == list(range(6, 18))


def test_paths_stand_under_the_label() -> None:
    assert RunPaths("color").particles == "/color/belief/particles"
    assert RunPaths("color").histogram("edges", "sample") == "/color/histogram/edges/sample"


@pytest.mark.parametrize("label", ["", "world", "session", "a/b"])
def test_labels_that_would_collide_are_refused(label: str) -> None:
    with pytest.raises(ValueError, match="label"):
        RunPaths(label)
