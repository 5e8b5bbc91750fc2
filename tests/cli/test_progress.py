"""The progress of a command: a bar on a terminal, lines in a log, nothing when quiet."""

import io
import re
import time

import pytest
from rich.console import Console

from kinertia.cli import common


@pytest.mark.slow
def test_progress_is_plain_lines_in_a_log(fit_of):
    assert fit_of("synthetic").outcome.err.splitlines() == ["reading", "calibration", "inverse kinematics", "estimate"]


def test_progress_is_a_bar_with_the_time_left_of_the_stage_on_a_terminal(monkeypatch):
    screen = io.StringIO()
    monkeypatch.setattr(common.err, "console", Console(file=screen, force_terminal=True, width=80))
    with common.shown_progress() as progress:
        progress("reading", 0.9)
        progress("estimate", 0.0)
        for share in (0.2, 0.4, 0.6):
            time.sleep(0.15)
            progress("estimate", share)
        time.sleep(0.15)
    assert "\r" in screen.getvalue()
    shown = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", screen.getvalue())
    assert re.search(r"estimate \S+ +0:00:0[01] 0:00:0[01] left", shown)
    assert not re.search(r"reading \S+ +\S+ +\S* ?left", shown)


def test_quiet_progress(monkeypatch):
    screen = io.StringIO()
    monkeypatch.setattr(common.err, "console", Console(file=screen, force_terminal=True, width=80))
    monkeypatch.setattr(common.out, "quiet", True)
    with common.shown_progress() as progress:
        progress("reading", 0.9)
    assert screen.getvalue() == ""
