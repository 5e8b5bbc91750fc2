"""Forces at a wrong rate are told from late ones within two steps; files at a wrong rate by how fast the body falls."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.plates.force_timing import force_rate
from kinertia.findings.finding import Severity
from kinertia.trial.data import Markers
from plate_findings import context_of
from recordings import LONG_WALKS, WALKS

SOUND = {**WALKS, "synthetic, long": LONG_WALKS["synthetic"]}
RATES = {
    "synthetic": [1.02, 1.03],
    "synthetic c3d": [0.98, 1.02],
    "synthetic, long": [1.02, 1.03],
    "gait2354": [0.98, 1.02],
    "rajagopal": [0.97, 1.02],
}


@pytest.fixture(params=SOUND)
def walk(request, recording_of):
    return recording_of(*SOUND[request.param])


def found(recording, rate=1.0, delay_s=0.0, gain=(1.0, 1.0)):
    """With forces whose time goes at this rate, which are later, and whose plates have other gains."""
    plates = recording.plates
    time = plates.time[0] + rate * (plates.time - plates.time[0]) + delay_s
    factor = np.array(gain)[:, None]
    wrong = replace(plates, time=time, force=factor * plates.force, moment=factor * plates.moment)
    return [*force_rate(context_of(replace(recording, plates=wrong)))]


@pytest.mark.parametrize(
    ("delay_s", "gain"), [(0.0, (1, 1)), (0.02, (1, 1)), (-0.02, (1, 1)), (0, (1.1, 1)), (0, (1, 1.1))]
)
def test_forces_at_their_rate(walk, delay_s, gain):
    assert found(walk, delay_s=delay_s, gain=gain) == []


@pytest.mark.parametrize("name", [name for name in RATES if name in SOUND])
def test_forces_at_another_rate(recording_of, name):
    for rate in RATES[name]:
        (finding,) = found(recording_of(*SOUND[name]), rate)
        assert (finding.code, finding.severity) == ("T201", Severity.WARNING)
        assert finding.evidence["ratio"].value == pytest.approx(rate, abs=0.011)
        begin, end = finding.evidence["delay_s"].value
        assert (end > begin) == (rate > 1)


def test_windows_that_are_too_short_say_nothing(recording_of):
    """A single support and what is around it."""
    whole = recording_of(*WALKS["synthetic"])
    assert found(whole, 1.02) != []
    short = [replace(whole, markers=whole.markers.cut(1.2, 2.05))]
    short += [recording_of(*WALKS[name]) for name in ("plug-in gait a",) if name in WALKS]
    for walk in short:
        assert found(walk, 1.02) == []


@pytest.mark.parametrize("name", [name for name in ("synthetic", "rajagopal") if name in WALKS])
def test_velocities_at_the_ends_of_a_recording_say_nothing(recording_of, name):
    """Of a sound walk cut to 1.1 s, rates seemed to differ by up to 2.9 %."""
    whole = recording_of(*WALKS[name])
    start_s, end_s = whole.markers.time[[0, -1]]
    for start, end in ((0.67, 0.62), (0.69, 0.66), (0.71, 0.62), (0.75, 0.62)):
        markers = whole.markers.cut(start_s + start, end_s - end)
        plates = whole.plates
        here = (plates.time >= markers.time[0]) & (plates.time <= markers.time[-1])
        cut = replace(plates, time=plates.time[here], force=plates.force[here], moment=plates.moment[here])
        assert found(replace(whole, markers=markers, plates=cut)) == []


TOO_SHORT_AT_TWICE = ("plug-in gait a", "plug-in gait b")


@pytest.mark.parametrize(
    ("name", "factor"),
    [(name, factor) for name in WALKS for factor in (2.0, 0.5) if factor > 1 or name not in TOO_SHORT_AT_TWICE],
)
def test_a_file_at_another_rate(recording_of, name, factor):
    """Markers and forces of one file, which has one time base."""
    walk = recording_of(*WALKS[name])

    def stretched(time):
        return time[0] + factor * (time - time[0])

    markers, plates = walk.markers, replace(walk.plates, time=stretched(walk.plates.time))
    slow = replace(walk, markers=Markers(stretched(markers.time), markers.labels, markers.positions), plates=plates)
    (finding,) = [finding for finding in force_rate(context_of(slow)) if finding.code == "T202"]
    assert finding.evidence["rate_factor"].value == pytest.approx(1 / factor, rel=0.2)
