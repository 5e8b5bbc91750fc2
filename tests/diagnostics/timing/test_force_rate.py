"""Forces at a wrong rate are told from a late clock within two steps; sound ones and late ones are not doubted."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.evidence.caused_velocity import caused_velocities
from kinertia.diagnostics.timing.force_rate import rate_doubts
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.trial.plate_assignment import build_trial
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


def doubts(recording, rate=1.0, late_s=0.0, gain=(1.0, 1.0)):
    """With forces whose time goes at this rate, which are later, and whose plates have other gains."""
    plates = recording.plates
    time = plates.time[0] + rate * (plates.time - plates.time[0]) + late_s
    factor = np.array(gain)[:, None]
    wrong = replace(plates, time=time, force=factor * plates.force, moment=factor * plates.moment)
    marker_set = choose_marker_set(recording.markers.labels)
    present = set(recording.markers.labels)
    feet = {side: [one for one in own if one in present] for side, own in marker_set.foot_labels().items()}
    owners = {label: name for name, labels in marker_set.segments.items() for label in labels}
    trial = build_trial(replace(recording, plates=wrong), feet)
    return rate_doubts(trial, caused_velocities(trial, owners))


@pytest.mark.parametrize(
    ("late_s", "gain"), [(0.0, (1, 1)), (0.02, (1, 1)), (-0.02, (1, 1)), (0, (1.1, 1)), (0, (1, 1.1))]
)
def test_forces_at_their_rate(walk, late_s, gain):
    assert doubts(walk, late_s=late_s, gain=gain) == []


@pytest.mark.parametrize("name", [name for name in RATES if name in SOUND])
def test_forces_at_another_rate(recording_of, name):
    for rate in RATES[name]:
        (doubt,) = doubts(recording_of(*SOUND[name]), rate)
        assert doubt.startswith("markers and forces do not run at the same speed")
        assert float(doubt.partition("of about ")[2].partition(":")[0]) == pytest.approx(rate, abs=0.011)


def test_windows_that_are_too_short_say_nothing(recording_of):
    """A single support and what is around it."""
    whole = recording_of(*WALKS["synthetic"])
    assert doubts(whole, 1.02) != []
    short = [replace(whole, markers=whole.markers.cut(1.2, 2.05))]
    short += [recording_of(*WALKS[name]) for name in ("plug-in gait a",) if name in WALKS]
    for walk in short:
        assert doubts(walk, 1.02) == []
