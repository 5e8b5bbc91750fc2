"""A foot that reaches far beyond its plate loads it for a shorter time than it stands."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.evidence.ambiguous_loads import Overhang
from kinertia.diagnostics.plates.contact_delays import fitted_rate_or_delay
from kinertia.diagnostics.plates.force_timing import force_rate
from kinertia.trial.sampled_data import within
from loads_and_feet import context_of
from recordings import here
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
    (contact,) = [load for load in context.contacts if load.plate == 0]
    span_s = (float(contact.time[0]), float(contact.time[-1]))
    context.__dict__["overhangs"] = [Overhang(0, 0, 0.15, span_s, span_s)]
    assert {whole_contact.plate for whole_contact in context.whole_contacts} == {1}
    assert (context.whole_loads.force[:, 0] == 0.0).all()
    assert (context.whole_loads.force[:, 1] == early.plates.force[:, 1]).all()
    assert list(fitted_rate_or_delay(context)) == []


def test_else_every_load_counts(early):
    context = context_of(early, FEET)
    assert len(context.whole_contacts) == 2
    assert context.whole_loads is early.plates


@pytest.mark.parametrize("files", here(["pig_c3d/subject_a_walk.c3d"]))
def test_it_is_no_other_rate_of_both(recording_of, files):
    """T202 of forces that move the body four times as fast as the markers while a foot is partly beside its plate."""
    recording = recording_of(files)
    plates, span_s = recording.plates, (3.1, 3.45)
    total, weight = plates.force[:, :, 1].sum(axis=1), 400.0
    partly = within(plates.time, *span_s) & (total > 50.0)
    factor = np.where(partly, np.maximum(weight + 4.0 * (total - weight), 20.0) / np.maximum(total, 50.0), 1.0)
    factor = factor[:, None, None]
    spoilt = replace(recording, plates=replace(plates, force=factor * plates.force, moment=factor * plates.moment))
    assert [finding.code for finding in force_rate(context_of(spoilt))] == ["T202"]
    context = context_of(spoilt)
    context.__dict__["overhangs"] = [Overhang(1, 0, 0.06, span_s, span_s)]
    assert list(force_rate(context)) == []
