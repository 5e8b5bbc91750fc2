"""Landings and jumps are judged by what holds of them: no rule asks them for pelvis, feet or loads of gait."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.body_motion import force_velocities
from kinertia.diagnostics.plates.contact_delays import forces_keep_time
from kinertia.diagnostics.registry import LOADED_CHECKS, PLACE_CHECKS
from kinertia.diagnostics.runner import asked
from kinertia.findings.finding import Severity
from kinertia.model.marker_set import MarkerSet
from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.trial.data import FootLoads, Markers, Trial
from loads_and_feet import context_of, error_of
from recordings import here

SIDES = {
    "thigh": ("THAP", "THAD", "LEPI", "MEPI"),
    "shank": ("TIAP", "TIAD", "LMAL", "MMAL"),
    "foot": ("HEEL", "TOE", "P1MT", "P5MT"),
}
LABORATORY = MarkerSet(
    "laboratory",
    {
        **{f"heel_{side}": (f"{side.upper()}HEEL",) for side in "rl"},
        **{f"metatarsal_{side}": (f"{side.upper()}TOE",) for side in "rl"},
        "asis_r": ("RASI",),
        "asis_l": ("LASI",),
        "sacrum": ("SACR",),
    },
    {
        "pelvis": ("RASI", "LASI", "SACR"),
        "torso": ("C7", "RSH", "LSH"),
        **{f"{part}_{s}": tuple(s.upper() + label for label in labels) for part, labels in SIDES.items() for s in "rl"},
    },
    {},
)
LANDINGS = here(["field/lasem/sldj01.c3d", "field/lasem/sldj03.c3d"])
DROP_JUMP = ("subject4/DJ1.trc", "subject4/DJ1_grf.mot")


@pytest.mark.parametrize("name", LANDINGS)
def test_drop_landings_of_another_laboratory(recording_of, name):
    """The trunk bends by so much that the pelvis shows 147 N that would accelerate nothing."""
    context = RecordingContext(recording_of(name), LABORATORY)
    assert not context.has_strides
    found = asked((*PLACE_CHECKS, *LOADED_CHECKS), context)
    assert [finding.code for finding in found if finding.severity > Severity.CORRECTED] == []
    assert context.velocities[0].mass_kg == pytest.approx(58.8, rel=0.08)


@pytest.mark.measured
@pytest.mark.parametrize("delay_s", [0.0, 0.08])
def test_forces_of_a_drop_jump_that_are_late(recording_of, delay_s):
    recording = recording_of(*DROP_JUMP)
    late = replace(recording, plates=replace(recording.plates, time=recording.plates.time + delay_s))
    assert forces_keep_time(context_of(late)) is (delay_s == 0.0)
    found = error_of(late)
    assert (found is None) is (delay_s == 0.0)
    assert found is None or found.code in ("T211", "T212")


def test_the_mass_of_a_body_that_lands():
    """It falls at 2 m/s, and is thrown up at 1.5 m/s: more than its weight is on the plate on average."""
    time = np.arange(0.0, 0.6, 0.01)
    at = np.arange(0.0, 0.595, 0.001)
    velocity, acceleration = np.polynomial.Polynomial([-2.0, 3.5 / 0.59]), 3.5 / 0.59
    places = np.zeros((len(time), 2, 3))
    places[:, :, 1] = (1.0 + velocity.integ()(time))[:, None]
    force = np.zeros((len(at), 2, 3))
    force[:, 0, 1] = 60.0 * (GRAVITY_M_S2 + acceleration)
    markers = Markers(time, ("P", "T"), places)
    trial = Trial("landing", markers, FootLoads(at, force, 0.0 * force), np.ones(len(time), dtype=bool))
    (part,) = force_velocities(trial, {"P": "pelvis", "T": "torso"})
    assert part.mass_kg == pytest.approx(60.0, rel=0.02)
