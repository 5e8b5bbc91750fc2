"""Vertical moments about a plate's middle in the place of free moments are found; free moments never are."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.plates.free_moments import free_moments
from kinertia.trial.ground_contact import FIRM_LOAD_N, centre_of_pressure
from plate_findings import plates_alone
from recordings import LONG_WALKS, RUNS, SQUATS, WALKS, named_here

OTHERS = {
    "long walk, synthetic": LONG_WALKS["synthetic"],
    **{f"run, {name}": files for name, files in RUNS.items()},
    **{f"squats, {name}": files for name, files in SQUATS.items()},
    **named_here(
        {
            "OpenCap": ("subject4/walking1.trc", "subject4/walking1_grf.mot"),
            "drop jump": ("field/laiarnold5_jump/DJ1.trc", "field/laiarnold5_jump/DJ1_forces.mot"),
            "treadmill": ("field/hamner_treadmill_run/run200.trc", "field/hamner_treadmill_run/run200_grf.mot"),
            "AMTI": ("c3d_variety/subject_prefixed_labels.c3d", None),
        }
    ),
}
LIKEWISE = ("OpenCap", "long walk, synthetic", "run, synthetic", "run, rajagopal")
MISTAKEN = {**WALKS, **{name: OTHERS[name] for name in LIKEWISE if name in OTHERS}}
ASIDE_M = dict.fromkeys(("synthetic", "synthetic c3d", "run, synthetic"), 0.15)
"""Synthetic plates have their middle where the foot stands, about which horizontal forces turn little."""


def moved_points(plates):
    """P261 by a fixed point: files may have no free moments, which is another finding."""
    return [finding for finding in free_moments(plates_alone(replace(plates, torques=None))) if finding.code == "P261"]


@pytest.mark.parametrize("name", [*WALKS, *OTHERS])
def test_free_moments(name, recording_of):
    assert moved_points(recording_of(*{**WALKS, **OTHERS}[name]).plates) == []


@pytest.mark.parametrize("name", MISTAKEN)
def test_moments_about_the_middle(name, recording_of):
    plates = recording_of(*MISTAKEN[name]).plates
    point = centre_of_pressure(plates.wrench)
    loaded = plates.force[..., 1] > FIRM_LOAD_N
    used = np.flatnonzero(loaded.sum(axis=0) > 20)
    moment, middles = plates.moment.copy(), {}
    for p in used:
        on_it = point[loaded[:, p], p].mean(axis=0)
        middle = on_it if plates.corners is None else plates.corners[p].mean(axis=0)
        middles[plates.names[p]] = middle = middle + np.array([0.0, 0.0, ASIDE_M.get(name, 0.0)])
        extra = np.cross(point[:, p] - middle, plates.force[:, p])[:, 1]
        moment[:, p, 1] += np.where(loaded[:, p], extra, 0.0)
    found = moved_points(replace(plates, moment=moment))
    assert {finding.where.plate for finding in found} <= set(middles)
    assert found
    for finding in found:
        assert finding.evidence["left_rms_nm"].value < finding.evidence["left_rms_nm"].limit


def test_moments_of_one_export_are_about_points_alike(recording_of):
    """One belt of a treadmill had moments of 14 N m about its middle, the other of 7, which were "corrected"."""
    recording = recording_of(*WALKS["synthetic"])
    plates = recording.plates
    moment = plates.moment.copy()
    for p, aside_m in enumerate((0.5, 0.12)):
        loaded = plates.force[:, p, 1] > FIRM_LOAD_N
        moment[:, p, 1] += np.where(loaded, np.cross([0.0, 0.0, aside_m], plates.force[:, p])[:, 1], 0.0)
    both = moved_points(replace(plates, moment=moment))
    assert [finding.where.plate for finding in both] == list(plates.names)
    alone = moment.copy()
    alone[:, 0] = plates.moment[:, 0]
    assert moved_points(replace(plates, moment=alone)) == []
