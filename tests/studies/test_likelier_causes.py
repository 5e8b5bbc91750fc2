"""Of two causes that look alike the likelier one is found: faults in files of a synthetic walk."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, filtfilt

from kinertia.findings.overview import reported
from validation.fault_study import checked, synthetic_walk
from validation.measured_person import acting, loads_of, read_person, write_person


@pytest.fixture(scope="module")
def person(tmp_path_factory):
    """Somebody whose files are sound."""
    subject = synthetic_walk(tmp_path_factory.mktemp("walk"))
    return read_person(subject, np.random.default_rng(1))


def found(folder, person):
    """What `kinertia check` finds, by code, the worst first."""
    return {finding.code: finding for finding in reversed(reported(checked(write_person(folder, person))))}


def with_force(person, change):
    """Forces (k, p, 3) N of plates changed where somebody stands on them, at the same points."""
    force, point, torque = acting(person.plates)
    loaded = force[..., 1] > 50.0
    more = np.where(loaded[..., None], change(force, person.plates.time), force)
    return person.with_plates(loads_of(person.plates, more, point, torque))


def with_positions(person, change):
    """Other places (n, m, 3) m of the markers of the walk."""
    return person.in_walk(lambda markers: replace(markers, positions=change(markers)))


def test_nothing_is_said_of_sound_files(person, tmp_path):
    assert found(tmp_path, person) == {}


@pytest.mark.parametrize("plate", [0, 1])
@pytest.mark.parametrize(("gain", "zero_offset_n"), [(1.05, 0.0), (0.95, 0.0), (1.0, 30.0)])
def test_a_gain_or_a_zero_of_one_plate_is_no_wrong_rate(person, tmp_path, plate, gain, zero_offset_n):
    def change(force, time):
        force = force.copy()
        force[:, plate] = gain * force[:, plate] + [0.0, zero_offset_n, 0.0]
        return force

    codes = set(found(tmp_path, with_force(person, change)))
    assert "P221" in codes
    assert not any(code.startswith("T20") for code in codes)


@pytest.mark.parametrize("plate", [0, 1])
def test_a_horizontal_zero_that_drifts_is_named_with_its_plate_and_axis(person, tmp_path, plate):
    def change(force, time):
        force = force.copy()
        force[:, plate, 0] += np.linspace(0.0, 60.0, len(time))
        return force

    zero = found(tmp_path, with_force(person, change))["P212"]
    assert zero.where.plate == person.plates.names[plate]
    assert zero.where.axis == "fore-aft"


def test_markers_that_were_smoothed_too_much(person, tmp_path):
    def change(markers):
        high = butter(2, 2.0 / (markers.rate_hz / 2))
        return filtfilt(*high, markers.positions, axis=0)

    assert next(iter(reversed(found(tmp_path, with_positions(person, change))))) == "M133"


def test_markers_that_were_smoothed_as_usual(person, tmp_path):
    def change(markers):
        high = butter(2, 6.0 / (markers.rate_hz / 2))
        return filtfilt(*high, markers.positions, axis=0)

    assert found(tmp_path, with_positions(person, change)) == {}


def test_small_spikes_are_no_jumps(person, tmp_path):
    def change(markers):
        places = markers.positions.copy()
        places[7::15, markers.labels.index(person.marker_set.segments["shank_r"][0])] += 0.03
        return places

    codes = set(found(tmp_path, with_positions(person, change)))
    assert "M111" in codes
    assert "M112" not in codes


def test_labels_swapped_in_the_static_trial_come_before_another_session(person, tmp_path):
    names = person.marker_set.landmarks
    (outer,), (inner,) = names["knee_lateral_r"], names["knee_medial_r"]
    swaps = {outer: inner, inner: outer}
    swapped = person.in_static(
        lambda markers: replace(markers, labels=tuple(swaps.get(label, label) for label in markers.labels))
    )
    codes = set(found(tmp_path, swapped))
    assert codes & {"L208", "L212"}
    assert "S204" not in codes


@pytest.mark.parametrize("plates", [[0], [1], [0, 1]])
def test_the_gain_of_one_axis(person, tmp_path, plates):
    def change(force, time):
        force = force.copy()
        force[:, plates, 0] *= 2.0
        return force

    gain = found(tmp_path, with_force(person, change))["P222"]
    assert gain.where.plate == (None if len(plates) > 1 else person.plates.names[plates[0]])
    assert next(iter(gain.evidence.values())).value == pytest.approx(2.0, rel=0.2)
