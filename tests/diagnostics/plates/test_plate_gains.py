"""A plate with a wrong gain is told by what other plates say of the same body."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.evidence.caused_velocity import caused_velocities
from kinertia.diagnostics.plates.plate_gains import gain_doubts
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.trial.centre_of_pressure import centre_of_pressure
from kinertia.trial.plate_assignment import build_trial
from recordings import LONG_WALKS, WALKS

LONG = ("synthetic", "synthetic c3d", "gait2354", "rajagopal", "plug-in gait b")
SOUND = {name: WALKS[name] for name in LONG if name in WALKS} | {"synthetic, long": LONG_WALKS["synthetic"]}


@pytest.fixture(params=SOUND)
def walk(request, recording_of):
    return recording_of(*SOUND[request.param])


def told(walk):
    marker_set = choose_marker_set(walk.markers.labels)
    present = set(walk.markers.labels)
    feet = {side: [one for one in labels if one in present] for side, labels in marker_set.foot_labels().items()}
    owners = {label: name for name, labels in marker_set.segments.items() for label in labels}
    trial = build_trial(walk, feet)
    return gain_doubts(walk, trial, owners, caused_velocities(trial, owners))


def test_sound_plates(walk):
    assert told(walk) == []


@pytest.mark.parametrize("gain", [0.87, 1.15])
def test_a_wrong_gain(walk, gain):
    factors = np.array([1.0, gain])[:, None]
    plates = walk.plates
    wrong = replace(plates, force=plates.force * factors, moment=plates.moment * factors)
    (sentence,) = told(replace(walk, plates=wrong))
    apart = float(sentence.partition(" by the other (")[2].partition(" %")[0]) / 100
    assert 1 + apart == pytest.approx(max(gain, 1 / gain), abs=0.04)


@pytest.mark.parametrize("foot", [0, 1])
def test_a_crutch_beside_one_foot_is_named_beside_the_gain(walk, foot):
    """It carries a tenth of the weight whenever that foot stands: no plate tells it from a gain."""
    plates = walk.plates
    loaded = (plates.force[:, foot, 1] > 0.0)[:, None]
    support = np.zeros_like(plates.force)
    support[:, foot] = 0.1 * float(plates.force[..., 1].max()) * loaded * np.array([0.0, 1.0, 0.0])
    support[:, foot] = np.minimum(support[:, foot], np.maximum(plates.force[:, foot], 0.0))
    point = centre_of_pressure(np.concatenate((plates.force, plates.moment), axis=2))
    moment = plates.moment - np.cross(point, support)
    said = told(replace(walk, plates=replace(plates, force=plates.force - support, moment=moment)))
    assert len(said) == 1
    assert f"on no plate over {plates.names[foot]} (a handrail, a crutch)" in said[0]
