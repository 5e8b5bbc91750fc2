"""The mark `measured`: tests that need recordings which are no part of the repository.

Five kinds have it: those that ask for a fixture of them, those with the name of such a file as a parameter, those with
`skipif` for want of them, those marked by hand, and, where tests are chosen by it (`-m measured`), all that are
collected only where the recordings are.
A test that is skipped for want of them fails unless it has the mark, so that what runs everywhere and what runs on
measured recordings are all tests together.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from kinertia.io.samples import NAME, VARIABLE
from recordings import NEEDS_MEASURED, REQUIRED
from validation.measured_data import find, places

MARK = "measured"
OF_ANY_WALK = "sample_walk"
"""The fixture that is the measured walk where there is one, and a synthetic one elsewhere."""
SAMPLE = f"{NAME}/subject01_walk1.trc"
"""A file of that walk: of a download that failed there is a folder, without files."""
READ = (".c3d", ".mot", ".osim", ".trc")
EMPTY = "got empty parameter set"
"""What pytest calls a test on recordings of which none is here."""
_EVERYWHERE = "collected_everywhere"


class MeasuredTests:
    """Plugin that marks tests on measured recordings, and fails those that are skipped although they should run.

    Args:
        sample: whether the sample walk is a measured one.
    """

    def __init__(self, sample: bool = find(SAMPLE) is not None) -> None:
        self.fixtures = {"measured_folder", *([OF_ANY_WALK] if sample else [])}
        self.everywhere: frozenset[str] | None = None

    def pytest_sessionstart(self, session):
        """Collect once as if no recordings were there, if some are and tests are chosen by the mark."""
        config = session.config
        if hasattr(config, "workerinput"):
            everywhere = config.workerinput[_EVERYWHERE]
            self.everywhere = None if everywhere is None else frozenset(everywhere)
        elif MARK in config.option.markexpr and places():
            self.everywhere = collected_without(config.rootpath)

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node):
        node.workerinput[_EVERYWHERE] = None if self.everywhere is None else sorted(self.everywhere)

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection_modifyitems(self, items):
        for item in items:
            only_here = self.everywhere is not None and item.nodeid not in self.everywhere
            by_parameters = hasattr(item, "callspec") and any(map(of_recordings, item.callspec.params.values()))
            by_skipping = any(skip.kwargs.get("reason") == NEEDS_MEASURED for skip in item.iter_markers("skipif"))
            if only_here or by_parameters or by_skipping or not self.fixtures.isdisjoint(item.fixturenames):
                item.add_marker(MARK)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item, call):
        report = yield
        if report.skipped and (NEEDS_MEASURED in str(report.longrepr) or EMPTY in str(report.longrepr)):
            if REQUIRED:
                report.outcome = "failed"
                report.longrepr = f"skipped for want of recordings, although {VARIABLE} states where they are"
            elif EMPTY not in str(report.longrepr) and item.get_closest_marker(MARK) is None:
                report.outcome = "failed"
                report.longrepr = f"needs measured recordings, and is not marked `{MARK}`"
        return report


def of_recordings(parameter: object) -> bool:
    """Whether a parameter of a test is, or contains, the name of a measured file that is here."""
    if isinstance(parameter, tuple | list):
        return any(map(of_recordings, parameter))
    return isinstance(parameter, str) and len(parameter) < 100 and parameter.endswith(READ) and bool(find(parameter))


def collected_without(root: Path) -> frozenset[str]:
    """Names of all tests that are collected where there are no measured recordings."""
    command = [sys.executable, "-m", "pytest", "-o", "addopts=--import-mode=importlib", "-p", "no:xdist"]
    command += ["--collect-only", "-q", "-p", "no:cacheprovider"]
    nowhere = os.environ | {VARIABLE: os.devnull, "CI": ""}
    done = subprocess.run(command, cwd=root, env=nowhere, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        last = (done.stdout + done.stderr)[-2000:]
        raise pytest.UsageError(f"without measured recordings tests are not collected:\n{last}")
    return frozenset(line for line in done.stdout.splitlines() if "::" in line)
