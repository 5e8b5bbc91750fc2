"""Somebody else who steps on a plate while the person stands on it."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.plates.gains import gains
from kinertia.diagnostics.plates.ground_contact import foreign_load, stray_loads
from kinertia.diagnostics.runner import explained
from kinertia.findings.finding import Severity
from kinertia.trial.sampled_data import runs, within
from loads_and_feet import context_of as feet_context_of
from loads_and_feet import doubted
from plate_findings import context_of
from recordings import LONG_WALKS, RUNS, SQUATS, WALKS
from walk_on_plates import FEET, walk

MASS_KG = {"synthetic": 72.6, "synthetic c3d": 72.6, "gait2354": 72.6, "rajagopal": 85.0}
SOUND = {name: (files, MASS_KG[name]) for name, files in WALKS.items() if name in MASS_KG}
SOUND |= {"run": (RUNS["synthetic"], 72.6), "squats": (SQUATS["synthetic"], 72.6)}


def stepped_on(recording, plate, share, mass_kg=70.0):
    """Another person steps beside the foot for a share of its longest contact, in the middle of it."""
    plates = recording.plates
    spans = runs(plates.force[:, plate, 1] > 50.0)
    first, last = max(spans, key=lambda span: span[1] - span[0])
    lasts = round(share * (last - first))
    start = first + (last - first - lasts) // 2
    load = np.zeros((lasts, 3))
    load[:, 1] = mass_kg * 9.80665 * np.sin(np.linspace(0.0, np.pi, lasts)) ** 0.5
    wrench = plates.wrench[first:last, plate].mean(axis=0)
    point = np.array([wrench[5] / wrench[1] + 0.15, 0.0, -wrench[3] / wrench[1] + 0.15])
    force, moment = plates.force.copy(), plates.moment.copy()
    force[start : start + lasts, plate] += load
    moment[start : start + lasts, plate] += np.cross(point, load)
    return replace(recording, plates=replace(plates, force=force, moment=moment)), plates.time[[start, start + lasts]]


@pytest.mark.parametrize("name", SOUND)
def test_nobody_else(recording_of, name):
    files, mass_kg = SOUND[name]
    recording = recording_of(*files)
    for stated_kg in (mass_kg, 0.8 * mass_kg, None):
        context = context_of(recording, mass_kg=stated_kg)
        assert list(foreign_load(context)) == []
        assert not context.foreign_contacts


@pytest.mark.parametrize("share", [0.4, 0.8])
def test_another_person_on_a_plate(recording_of, share):
    """The contact is left out, and no gain is accused."""
    spoilt, span_s = stepped_on(recording_of(*LONG_WALKS["synthetic"]), 0, share)
    context = context_of(spoilt, mass_kg=72.6)
    (found,) = foreign_load(context)
    assert (found.code, found.severity, found.where.plate) == ("P284", Severity.WARNING, spoilt.plates.names[0])
    assert found.where.span_s == pytest.approx(span_s, abs=0.1)
    assert found.evidence["surplus"].value == pytest.approx(0.8, abs=0.2)
    left, time = context.trial_on_plates.measured, spoilt.markers.time
    assert not left[(time > span_s[0]) & (time < span_s[1])].any()
    assert context.force_mass.mass_kg == pytest.approx(72.6, abs=4.0)
    assert spoilt.plates.names[0] not in context.whole_plate_masses
    others = [reported for reported in explained([found, *gains(context)]) if reported.muted_by is None]
    assert [finding.code for finding in others] == ["P284"]


def test_where_nothing_else_is_left_the_trial_is_blocked(recording_of):
    spoilt, _ = stepped_on(recording_of(*LONG_WALKS["synthetic"]), 0, 0.4)
    context = context_of(spoilt, mass_kg=72.6)
    context.__dict__["trial_on_plates"] = None
    (found,) = foreign_load(context)
    assert found.severity is Severity.ERROR


def beside(recording, plate, away_m, span_s, mass_kg=60.0):
    """Somebody else on a plate while the person is elsewhere, and the time of that load."""
    plates = recording.plates
    during = within(plates.time, *span_s)
    load = np.array([0.0, mass_kg * 9.80665, 0.0])
    place = recording.markers.positions[within(recording.markers.time, *span_s)].mean(axis=(0, 1)) * [1, 0, 1]
    force, moment = plates.force.copy(), plates.moment.copy()
    force[during, plate] = load
    moment[during, plate] = np.cross(place + np.array([0.0, 0.0, away_m]), load)
    return replace(recording, plates=replace(plates, force=force, moment=moment))


def test_another_person_on_a_plate_far_from_the_feet():
    """It is left out, and the person's own step on that plate stays."""
    sound = walk([("r", 0), ("l", 0), ("r", 1)])
    spoilt = beside(sound, 2, 0.9, (0.3, 0.7))
    context = feet_context_of(spoilt, FEET)
    (found,) = stray_loads(context)
    assert (found.code, found.severity, found.where.plate) == ("P285", Severity.CORRECTED, "plate 3")
    assert found.where.span_s == pytest.approx((0.3, 0.7), abs=0.02)
    assert found.evidence["distance_m"].value == pytest.approx(0.9, abs=0.2)
    np.testing.assert_array_equal(context.plates.force, sound.plates.force)
    np.testing.assert_array_equal(context.trial.loads.force, feet_context_of(sound, FEET).trial.loads.force)
    assert doubted(spoilt, FEET) == doubted(sound, FEET) == []


def test_a_foot_that_is_not_seen_may_bear_the_load():
    sound = walk([("r", 0), ("l", 0), ("r", 1)])
    spoilt = beside(sound, 2, 0.9, (0.3, 0.7))
    markers = spoilt.markers
    positions = markers.positions.copy()
    positions[within(markers.time, 0.25, 0.75), 2:] = np.nan
    hidden = replace(spoilt, markers=replace(markers, positions=positions))
    assert not feet_context_of(hidden, FEET).stray_contacts


@pytest.mark.parametrize("name", SOUND)
def test_every_load_of_a_sound_recording_is_under_a_foot(recording_of, name):
    assert not context_of(recording_of(*SOUND[name][0])).stray_contacts
