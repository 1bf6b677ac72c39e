"""What the session doctor found, as text for people and as JSON."""

from __future__ import annotations

from collections.abc import Iterator

from maurice_loaders.doctor import Diagnosis


def to_json(found: Diagnosis) -> dict[str, object]:
    """Give everything as JSON, lengths in metres."""
    return {
        "session": str(found.path),
        "name": found.name,
        "odometry": found.odometry,
        "truth": found.truth,
        "pictures": found.pictures,
        "only_the_beginning": found.cut,
        "said": list(found.said),
        "checks": list(found.checks),
        "not_asked": list(found.not_asked),
        "healthy": not found.complaints,
        "complaints": [
            {
                "code": one.code,
                "what": one.what,
                "evidence": one.evidence,
                "mend": one.mend,
                "numbers": dict(one.numbers),
            }
            for one in found.complaints
        ],
    }


def to_lines(found: Diagnosis) -> Iterator[str]:
    """Write the report, a line a fact; what is wrong comes last and is numbered."""
    counts = f"{found.odometry} odometry, {found.truth} truth, {found.pictures} pictures"
    yield f"{found.name}: {counts}{', of its beginning' if found.cut else ''}"
    yield f"looked at: {', '.join(found.checks)}"
    if found.not_asked:
        yield f"could not look at: {', '.join(found.not_asked)}"
    for text in found.said:
        yield f"the reader says: {text}"
    for number, one in enumerate(found.complaints, 1):
        yield f"{number}. {one.what} [{one.code}]"
        yield f"   why: {one.evidence}"
        yield f"   mend: {one.mend}"
    yield f"found {len(found.complaints)} wrong" if found.complaints else "found nothing wrong"
