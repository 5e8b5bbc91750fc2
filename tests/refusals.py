"""That something is refused, with which code, where, and with what evidence."""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import pytest

from kinertia.errors import FileError, KinertiaError
from kinertia.findings.finding import Finding, Severity

ANY = object()
MOST_WORDS = 25
"""Of a message."""


@contextmanager
def refused(
    code: str, line: Any = ANY, /, error: type[KinertiaError] = FileError, **evidence: Any
) -> Iterator[pytest.ExceptionInfo[KinertiaError]]:
    """The block raises an error of this code, in this line; numbers of its evidence are these, texts contain these."""
    with pytest.raises(error) as caught:
        yield caught
    found = caught.value.finding
    assert found is not None, caught.value
    assert found.code == code, caught.value
    assert found.severity is Severity.ERROR
    if line is not ANY:
        assert (caught.value.line, found.where.line) == (line, line)
    expect_evidence(found, **evidence)
    expect_filled(found)


def expect_evidence(found: Finding, /, **evidence: Any) -> None:
    """Numbers of the evidence are these, texts contain these."""
    for name, expected in evidence.items():
        value = found.evidence[name].value
        if isinstance(expected, str):
            assert expected in str(value), (name, value)
        else:
            assert value == pytest.approx(expected), name


def expect_filled(found: Finding) -> None:
    """Every name in its sentences is filled in, and the message is short, whatever it is filled with."""
    assert not re.findall(r"\{\w+(?::[+%#]*)?\}", f"{found.message} {found.effect} {found.remedy}"), found.message
    assert len(found.message.split()) <= MOST_WORDS, found.message


def codes(findings: Sequence[Finding]) -> list[str]:
    """Their codes, in order."""
    return [finding.code for finding in findings]


def only(findings: Sequence[Finding], code: str, /, **evidence: Any) -> Finding:
    """The one finding of this code, with this evidence."""
    (found,) = [finding for finding in findings if finding.code == code]
    expect_evidence(found, **evidence)
    expect_filled(found)
    return found
