"""Forces that were low-passed below 10 Hz are reported, with zeros between contacts, too; fault-free ones never are."""

from dataclasses import replace

import pytest
from scipy.signal import butter, sosfiltfilt

from kinertia.diagnostics.plates.signals import low_passed
from kinertia.findings.finding import Severity
from plate_findings import plates_alone
from recordings import RUNS, WALKS, named_here

MEASURED = {**WALKS, **{f"run, {name}": files for name, files in RUNS.items()}}
CHILDREN = named_here(
    {
        f"{child}, {way}": (f"field/biomechzoo/{child}/{way}.c3d", None)
        for child in ("HC002D", "HC030A", "HC036A", "HC038A")
        for way in ("straight", "turn")
    }
)
OTHERS = named_here(
    {
        "unipd": ("field/unipd/walking1.c3d", None),
        "sydney": ("field/sydney/S4-AMGait03.c3d", None),
        "fmc": ("field/fmc/MH0222_BP06.c3d", None),
        "rbwh": ("field/rbwh/bfnd w1.c3d", None),
        "sample26": ("field/sample26/Walking_Hybrid_1_1.c3d", None),
        "treadmill": ("field/opensim_core/walking2.c3d", None),
        "cgm24": ("field/cgm24/Walking01.c3d", None),
        "maartens": ("field/maartens/exampleOverground.c3d", None),
        "stairs": ("field/stairs/walk.c3d", None),
        "wisco, filtered": ("field/jam/overground_17.trc", "field/jam/overground_17_grf.mot"),
        "subject4": ("subject4/walking1.trc", "subject4/walking1_grf.mot"),
        "subject4, jump": ("subject4/DJ1.trc", "subject4/DJ1_grf.mot"),
        "laiarnold6": ("field/laiarnold6_walk/walking1.trc", "field/laiarnold6_walk/walking1_forces.mot"),
        "run at 2 m/s": ("field/hamner_treadmill_run/run200.trc", "field/hamner_treadmill_run/run200_grf.mot"),
        "landing": ("field/lasem/sldj01.c3d", None),
    }
)
SOUND = {**MEASURED, **CHILDREN, **OTHERS}
FILTERED = named_here({"lasem": ("field/lasem/walk01.c3d", None)})


def filtered(recording, cutoff_hz):
    """By a zero-phase Butterworth filter with this cutoff (-3 dB); what is small is zero, as in processed files."""
    plates = recording.plates
    rate_hz = (len(plates.time) - 1) / (plates.time[-1] - plates.time[0])
    force = sosfiltfilt(butter(2, cutoff_hz / 0.802, fs=rate_hz, output="sos"), plates.force, axis=0)
    return replace(plates, force=force * (force[..., 1:2] > 10.0))


@pytest.mark.parametrize("name", SOUND)
def test_fault_free_forces(recording_of, name):
    assert [*low_passed(plates_alone(recording_of(*SOUND[name]).plates))] == []


@pytest.mark.parametrize("name", [*WALKS, *CHILDREN])
@pytest.mark.parametrize("cutoff_hz", [6.0, 15.0])
def test_forces_low_passed_too_strongly(recording_of, name, cutoff_hz):
    """At 10 Hz, ankle moments of truths err by 2 N m at a SD of 1; at 15 Hz those of walks change by 0.5 SD or less."""
    found = [*low_passed(plates_alone(filtered(recording_of(*MEASURED.get(name) or CHILDREN[name]), cutoff_hz)))]
    if cutoff_hz > 10.0 and name not in ("gait2354", "rajagopal"):
        assert found == []
    if cutoff_hz < 10.0:
        assert [(finding.code, finding.severity) for finding in found] == [("P108", Severity.WARNING)]
        assert 3.0 < found[0].evidence["cutoff_hz"].value < found[0].evidence["cutoff_hz"].limit


@pytest.mark.parametrize("name", FILTERED)
def test_a_filter_that_unloaded_plates_show(recording_of, name):
    """From 57 to 18 ms before the load begins, the plates read 12 N less than nothing: 12.4 Hz forth and back."""
    (finding,) = low_passed(plates_alone(recording_of(*FILTERED[name]).plates))
    assert finding.evidence["cutoff_hz"].value == pytest.approx(9.9, rel=0.1)
