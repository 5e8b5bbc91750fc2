from types import SimpleNamespace

import pytest

from kinertia.estimation.forces_used import forces_before, forces_used, full_bandwidth
from kinertia.settings import Settings

RMS = "of 21.3 N (RMS over the trial)"
CASES = [
    ({}, None, 0.4, "as measured", "as measured"),
    ({}, None, 21.3, f"as measured, less impacts {RMS}", "as measured"),
    ({"force_cutoff_hz": "none"}, None, 21.3, f"as measured, impacts {RMS} included", "as measured"),
    ({}, 31.25, 0.0, "low-passed at 31.2 Hz", "low-passed at 31.2 Hz"),
    ({"force_cutoff_hz": 8.0}, 8.0, 0.0, "low-passed at 8 Hz", "as measured"),
    ({"method": "two-level"}, 7.5, 0.0, "low-passed at 7.5 Hz", "low-passed at 7.5 Hz"),
]


def reactions(cutoff_hz, impact_n):
    return SimpleNamespace(cutoff_hz=cutoff_hz, impact_n=impact_n)


@pytest.mark.parametrize(("given", "cutoff_hz", "impact_n", "which", "before"), CASES)
def test_which_forces(given, cutoff_hz, impact_n, which, before):
    settings = Settings(**given)
    used = forces_used(reactions(cutoff_hz, impact_n), settings, 12.0)
    assert used.which == which
    assert "=" not in used.which
    assert forces_before(reactions(cutoff_hz, impact_n), settings) == before
    assert ("Bisseling" in used.why) == (impact_n > 0.5)
    assert ('force_cutoff_hz = "none"' in used.why) == ("less" in which)


@pytest.mark.parametrize(
    ("given", "reason"),
    [({}, "noisy when unloaded"), ({"force_cutoff_hz": 9.0}, "force_cutoff_hz"), ({"method": "two-level"}, "motion")],
)
def test_why_they_are_low_passed(given, reason):
    assert reason in forces_used(reactions(9.0, 0.0), Settings(**given), 12.0).why


def test_full_bandwidth_is_what_the_forces_have():
    assert full_bandwidth(reactions(None, 0.0)) == "forces at full bandwidth"
    assert full_bandwidth(reactions(31.25, 0.0)) == "forces up to 31.2 Hz"
