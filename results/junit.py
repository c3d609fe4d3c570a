"""Verdicts as JUnit XML, which CI services show as tests."""

from __future__ import annotations

import re
from collections.abc import Sequence
from xml.etree import ElementTree as ET

from conespot.results.check import Verdict

#: what XML 1.0 (section 2.2) does not let a document hold, not even escaped
_NO_CHARACTER = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def junit(name: str, verdicts: Sequence[Verdict]) -> bytes:
    """A test suite with a test case a verdict: a miss is a failure, what cannot be judged an error."""
    counts = {
        "tests": str(len(verdicts)),
        "failures": str(sum(not v.holds and not v.unclear for v in verdicts)),
        "errors": str(sum(bool(v.unclear) for v in verdicts)),
        "time": "0",
    }
    root = ET.Element("testsuites", counts)
    suite = ET.SubElement(root, "testsuite", {"name": _clean(name), "skipped": "0", **counts})
    for v in verdicts:
        title = f"{v.title} ({v.expectation.source})" if v.expectation.source else v.title
        case = ET.SubElement(suite, "testcase", {"classname": _clean(name), "name": _clean(title), "time": "0"})
        if not v.holds:
            said = {"message": _clean(v.sentence), "type": v.word}
            ET.SubElement(case, "error" if v.unclear else "failure", said).text = _clean(v.sentence)
    ET.indent(root)
    return ET.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"


def _clean(text: str) -> str:
    return _NO_CHARACTER.sub("?", text)
