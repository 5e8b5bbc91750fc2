"""Wrong axes and signs are found where one foot alone meets a plate; fault-free forces point to the body."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinertia.diagnostics.plates.force_directions import force_directions
from kinertia.diagnostics.plates.forces_of_steps import forces_of_steps
from plate_findings import context_of, with_force
from recordings import QUICK_WALKS, RUNS, SQUATS, WALKS, slow_beside

FAULT_FREE = {**WALKS, **RUNS, **SQUATS}


@pytest.fixture(params=slow_beside(QUICK_WALKS, WALKS))
def walk(request, recording_of):
    """Two steps on two plates."""
    return recording_of(*WALKS[request.param])


def of_one_foot(recording, turn):
    """One plate measures, with turned or mirrored forces."""
    kept = (np.arange(recording.plates.force.shape[1]) == 0)[:, None]
    return context_of(with_force(recording, lambda force: (force * kept) @ turn.T))


@pytest.mark.parametrize("name", slow_beside(QUICK_WALKS, FAULT_FREE))
def test_fault_free_forces_point_to_the_body(recording_of, name):
    assert [*forces_of_steps(context_of(recording_of(*FAULT_FREE[name])))] == []


def test_one_step_without_faults(walk):
    assert [*force_directions(of_one_foot(walk, np.eye(3)))] == []


def test_the_sign_of_one_axis_of_one_step(walk):
    """That along the walk; across it feet may be nearly below the body."""
    found = {}
    for axis in (0, 2):
        signs = np.ones(3)
        signs[axis] = -1.0
        context = of_one_foot(walk, np.diag(signs))
        found[axis] = [*force_directions(context)]
        assert all(
            (finding.code, finding.where) == ("P232", context.at(**context.along(axis))) for finding in found[axis]
        )
        assert all(finding.evidence["correlation"].value < -0.3 for finding in found[axis])
    assert any(found.values())


@pytest.mark.parametrize("angle_deg", [90, -90, 180])
def test_rotated_forces_of_one_step(walk, angle_deg):
    turn = Rotation.from_euler("y", angle_deg, degrees=True).as_matrix()
    (found,) = [*force_directions(of_one_foot(walk, turn))]
    assert found.code == "P231"
    assert np.degrees(found.evidence["angle_rad"].value) == pytest.approx(angle_deg)
    assert found.evidence["correlation_undone"].value > 0.5
