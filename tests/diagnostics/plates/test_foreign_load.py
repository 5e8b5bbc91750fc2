"""Somebody else who steps on a plate while the person stands on it."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.plates.foreign_load import foreign_load
from kinertia.diagnostics.plates.gains import gains
from kinertia.diagnostics.runner import explained
from kinertia.findings.finding import Severity
from kinertia.trial.sampled_time import runs
from plate_findings import context_of
from recordings import LONG_WALKS, RUNS, SQUATS, WALKS

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
    walk, span_s = stepped_on(recording_of(*LONG_WALKS["synthetic"]), 0, share)
    context = context_of(walk, mass_kg=72.6)
    (found,) = foreign_load(context)
    assert (found.code, found.severity, found.where.plate) == ("P284", Severity.WARNING, walk.plates.names[0])
    assert found.where.span_s == pytest.approx(span_s, abs=0.1)
    assert found.evidence["surplus"].value == pytest.approx(0.8, abs=0.2)
    left, time = context.trial_on_plates.measured, walk.markers.time
    assert not left[(time > span_s[0]) & (time < span_s[1])].any()
    assert context.force_mass.mass_kg == pytest.approx(72.6, abs=4.0)
    assert walk.plates.names[0] not in context.whole_plate_masses
    others = [one for one in explained([found, *gains(context)]) if one.muted_by is None]
    assert [one.code for one in others] == ["P284"]


def test_where_nothing_else_is_left_the_trial_is_blocked(recording_of):
    walk, _ = stepped_on(recording_of(*LONG_WALKS["synthetic"]), 0, 0.4)
    context = context_of(walk, mass_kg=72.6)
    context.__dict__["trial_on_plates"] = None
    (found,) = foreign_load(context)
    assert found.severity is Severity.ERROR
