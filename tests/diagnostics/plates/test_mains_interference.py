"""Mains interference is found with its frequency, plate and axis; fault-free forces have none."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.plates.mains_interference import mains_interference
from kinertia.findings.finding import Severity
from plate_findings import plates_alone
from recordings import LONG_WALKS, RUNS, SQUATS, WALKS, named_here

OTHERS = {
    "long walk, synthetic": LONG_WALKS["synthetic"],
    **{f"run, {name}": files for name, files in RUNS.items()},
    **{f"squats at 100 Hz, {name}": files for name, files in SQUATS.items()},
    **named_here(
        {
            "drop jump": ("field/laiarnold5_jump/DJ1.trc", "field/laiarnold5_jump/DJ1_forces.mot"),
            "100 samples a second": ("subject4/walking1.trc", "subject4/walking1_grf.mot"),
            "BTS": ("c3d_variety/bts.c3d", None),
            "AMTI": ("c3d_variety/ist.c3d", None),
        }
    ),
}


@pytest.mark.parametrize("name", [*WALKS, *OTHERS])
def test_fault_free_forces(name, recording_of):
    assert [*mains_interference(plates_alone(recording_of(*{**WALKS, **OTHERS}[name]).plates))] == []


@pytest.mark.parametrize("name", WALKS)
@pytest.mark.parametrize("mains_hz", [50.0, 60.0])
@pytest.mark.parametrize("axis", [0, 1])
def test_interference(name, mains_hz, axis, recording_of):
    plates = recording_of(*WALKS[name]).plates
    hum = np.sin(2 * np.pi * mains_hz * plates.time + 1.0)
    for size, severity in ((8.0, Severity.WARNING), (25.0, Severity.ERROR)):
        force = plates.force.copy()
        loaded = force[:, 0, 1] > 0
        force[loaded, 0, axis] += size * hum[loaded]
        context = plates_alone(replace(plates, force=force))
        (found,) = mains_interference(context)
        assert (found.code, found.severity) == ("P107", severity)
        assert found.where == context.at(plate=plates.names[0], **context.along(axis))
        assert found.evidence["amplitude_n"].value == pytest.approx(size, rel=0.15)
        assert found.evidence["frequency_hz"].value == mains_hz


def test_interference_that_the_unloaded_plate_shows_is_filtered(recording_of):
    """Its noise says from which force on the plate is loaded, and how far forces are low-passed."""
    plates = recording_of(*WALKS["synthetic"]).plates
    hum = np.outer(25.0 * np.sin(2 * np.pi * 50.0 * plates.time), [0.0, 1.0, 0.0])
    force = plates.force + (plates.force[..., 1:2] > 0) * hum[:, None]
    for noise_n, severity in ((18.0, Severity.WARNING), (1.0, Severity.ERROR)):
        known = replace(plates, force=force, noise_n=(noise_n,) * len(plates.names))
        assert {one.severity for one in mains_interference(plates_alone(known))} == {severity}
