"""A check as JUnit XML, which build servers read: a suite for each drive, a case for each demand."""

from __future__ import annotations

import re
from collections.abc import Sequence
from xml.etree import ElementTree as ET

from .drive import DriveCheck

NOT_XML = re.compile("[^\\t\\n\\r\\x20-\\ud7ff\\ue000-\\ufffd\\U00010000-\\U0010ffff]")


def junit_xml(drives: Sequence[DriveCheck]) -> str:
    """Return JUnit XML: a suite for each drive, a case for each demand and for each change."""
    suites = ET.Element("testsuites", name="maurice-replay check")
    for drive in drives:
        cases = [(demand.kind, demand.title, demand.passed, demand.text) for demand in drive.demands]
        changes = zip(drive.changes, drive.change_texts, strict=True)
        cases += [
            (f"{change.kind} worse", f"{change.title}, against the baseline", change.passed, text)
            for change, text in changes
        ]
        suite = ET.SubElement(suites, "testsuite", name=_plain(drive.session))
        suite.set("time", f"{drive.took_s:.3f}")
        properties = ET.SubElement(suite, "properties")
        for name, value in (("seeds", len(drive.runs)), ("updates", len(drive.steps)), ("file", drive.path)):
            ET.SubElement(properties, "property", name=name, value=_plain(str(value)))
        for kind, title, passed, text in cases:
            case = ET.SubElement(suite, "testcase", name=_plain(title), time="0")
            case.set("classname", _plain(f"maurice-replay.{drive.session}"))
            if not passed:
                failure = ET.SubElement(case, "failure", message=_plain(text), type=kind)
                failure.text = _plain("" if drive.failure is None else drive.failure.text)
        _count(suite, [suite])
    _count(suites, list(suites))
    suites.set("time", f"{sum(drive.took_s for drive in drives):.3f}")
    ET.indent(suites)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(suites, encoding="unicode")}\n'


def _count(into: ET.Element, suites: Sequence[ET.Element]) -> None:
    """Write how many cases there are and how many failed."""
    into.set("tests", str(sum(len(suite.findall("testcase")) for suite in suites)))
    into.set("failures", str(sum(len(suite.findall("testcase/failure")) for suite in suites)))
    into.set("errors", "0")
    into.set("skipped", "0")


def _plain(text: str) -> str:
    """Return a text without the characters that XML cannot hold."""
    return NOT_XML.sub("?", text)
