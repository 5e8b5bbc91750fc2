"""A static trial whose axes are not those of the walk."""

import numpy as np
import pytest

from generic_static import recording, standing_positions
from kinertia.settings import Subject
from kinertia.workflow.person import Person
from kinertia.workflow.upright_static import with_upright_static
from refusals import codes

OTHER_AXES = {
    "+Z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "-Y": np.diag([1.0, -1.0, -1.0]),
}


@pytest.mark.parametrize("up", OTHER_AXES)
def test_it_is_put_upright_by_its_landmarks(up):
    positions = standing_positions()
    static = recording({label: OTHER_AXES[up] @ at for label, at in positions.items()})
    upright = with_upright_static(Person(Subject(), [], static)).static
    assert codes(upright.findings) == ["F133"]
    assert upright.vertical == up
    np.testing.assert_allclose(upright.markers.positions[0], list(positions.values()), atol=1e-12)


def test_one_that_is_upright_stays():
    person = Person(Subject(), [], recording(standing_positions()))
    assert with_upright_static(person) is person
