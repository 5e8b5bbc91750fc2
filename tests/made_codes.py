"""Findings that the program makes while tests run, whatever these tests are called: each code has to be among them.

Every finding is looked at when it is made: all names in its sentences are filled in. Where the whole quick tier has
run without a failure, the session fails if a code of the catalogue was never made by the program itself.
"""

import re
import sys
from pathlib import Path

import pytest

import kinertia
from kinertia.findings.finding import Finding
from kinertia.findings.rule import all_rules

PACKAGE = Path(kinertia.__file__).parent
PASSED_ON = (str(PACKAGE / "findings"), str(PACKAGE / "errors.py"), "<", __file__)
"""Where findings and errors are made of what others state."""
QUICK = "not slow"


def made_by_program() -> bool:
    """Whether the first caller that is none of those is a module of the program."""
    frame = sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(PASSED_ON):
        frame = frame.f_back
    return frame.f_code.co_filename.startswith(str(PACKAGE))


class MadeCodes:
    """Plugin that collects codes, in each worker and then of all of them."""

    def __init__(self, config: pytest.Config) -> None:
        self.codes: set[str] = set()
        self.unfilled: set[str] = set()
        option = config.option
        self.whole = (
            config.args_source is config.ArgsSource.TESTPATHS
            and option.markexpr == QUICK
            and not (option.keyword or option.collectonly or getattr(option, "lf", False) or option.deselect)
        )
        complete = Finding.__post_init__

        def looked_at(finding: Finding) -> None:
            complete(finding)
            if finding.code not in self.codes | self.unfilled and made_by_program():
                filled = not re.search(r"\{\w+(:[+%#]*)?\}", f"{finding.message} {finding.effect} {finding.remedy}")
                (self.codes if filled else self.unfilled).add(finding.code)

        Finding.__post_init__ = looked_at  # type: ignore[method-assign]

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node, error):
        self.codes.update(getattr(node, "workeroutput", {}).get("codes", ()))
        self.unfilled.update(getattr(node, "workeroutput", {}).get("unfilled", ()))

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self, session, exitstatus):
        if hasattr(session.config, "workeroutput"):
            session.config.workeroutput |= {"codes": sorted(self.codes), "unfilled": sorted(self.unfilled)}
        elif exitstatus == 0 and (self.unfilled or self.missing):
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    @property
    def missing(self) -> list[str]:
        return sorted(all_rules().keys() - self.codes - self.unfilled) if self.whole else []

    def pytest_terminal_summary(self, terminalreporter):
        for codes, what in (
            (self.missing, "made by no test"),
            (sorted(self.unfilled), "with names that are not filled in"),
        ):
            if codes:
                terminalreporter.write_line(f"findings {what}: {', '.join(codes)}")
