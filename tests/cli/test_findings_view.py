"""Findings on a terminal."""

from dataclasses import replace

from found import UNEXPLAINED, ZERO
from kinertia.cli.findings_view import show_all
from kinertia.cli.terminal import out
from kinertia.findings.finding import finding
from kinertia.findings.where import Where


def test_verbose_shows_what_a_finding_explains_to_the_last_consequence_and_in_its_own_trial_only():
    last = finding("P246", Where(trial="walk", plate="plate 1")).muted("P214")
    elsewhere = replace(ZERO, where=replace(ZERO.where, trial="run"))
    with out.capture() as shown:
        show_all([ZERO, UNEXPLAINED, last, elsewhere])
    codes = [line.split()[:3] for line in shown.get().splitlines() if "P2" in line]
    assert codes == [
        ["WARNING", "walk", "P213"],
        ["explains", "walk", "P214"],
        ["explains", "walk", "P246"],
        ["WARNING", "run", "P213"],
    ]
