"""A foot that reaches far beyond its plate loads it for a shorter time than it stands."""

from dataclasses import replace

import pytest

from kinertia.diagnostics.evidence.plate_edges import Overhang
from kinertia.diagnostics.timing.rate_and_delay import fitted_rate_or_delay
from loads_and_feet import context_of
from walk_on_plates import FEET, walk


@pytest.fixture
def early():
    """A walk over two plates, of which the first reads nothing of the second half of the contact."""
    recording = walk([("r", 0), ("l", 0)])
    plates = recording.plates
    force, moment = plates.force.copy(), plates.moment.copy()
    late = plates.time > 0.45
    force[late, 0], moment[late, 0] = 0.0, 0.0
    return replace(recording, plates=replace(plates, force=force, moment=moment))


def test_it_is_no_other_rate(early):
    context = context_of(early, FEET)
    (contact,) = [one for one in context.contacts if one.plate == 0]
    span_s = (float(contact.time[0]), float(contact.time[-1]))
    context.__dict__["overhangs"] = [Overhang(0, 0, 0.15, span_s, span_s)]
    assert {one.plate for one in context.whole_contacts} == {1}
    assert (context.whole_loads.force[:, 0] == 0.0).all()
    assert (context.whole_loads.force[:, 1] == early.plates.force[:, 1]).all()
    assert list(fitted_rate_or_delay(context)) == []


def test_else_every_load_counts(early):
    context = context_of(early, FEET)
    assert len(context.whole_contacts) == 2
    assert context.whole_loads is early.plates
