"""One plate that is late against the other is told from a delay of both, and from another gain."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.timing.plate_delay import plate_delay
from plate_findings import context_of
from recordings import WALKS

CLEAR = ("synthetic", "synthetic c3d", "gait2354", "rajagopal")
"""Walks in which two plates share the load for long enough."""


@pytest.fixture(params=[name for name in CLEAR if name in WALKS])
def walk(request, recording_of):
    return recording_of(*WALKS[request.param])


def changed(walk, delays_s=(0.0, 0.0), gains=(1.0, 1.0)):
    """Forces of the two plates late by so much, and of another gain."""
    plates = walk.plates
    force, moment = plates.force.copy(), plates.moment.copy()
    for p, (delay_s, gain) in enumerate(zip(delays_s, gains, strict=True)):
        shift = round(delay_s / (plates.time[1] - plates.time[0]))
        rows = np.clip(np.arange(len(plates.time)) - shift, 0, None)
        force[:, p], moment[:, p] = gain * plates.force[rows, p], gain * plates.moment[rows, p]
    return context_of(replace(walk, plates=replace(plates, force=force, moment=moment)))


@pytest.mark.parametrize("late", [0, 1])
def test_a_late_plate(walk, late):
    delays_s = (0.025, 0.0) if late == 0 else (0.0, 0.025)
    (found,) = plate_delay(changed(walk, delays_s))
    assert found.code == "T216"
    names = walk.plates.names
    assert [found.evidence[name].value for name in ("plate", "other")] == [names[late], names[1 - late]]
    assert found.evidence["difference_s"].value == pytest.approx(0.025, abs=0.008)


@pytest.mark.parametrize(
    "fault",
    [{}, {"delays_s": (0.005, 0.0)}, {"delays_s": (0.025, 0.025)}, {"gains": (1.1, 1.0)}, {"gains": (1.0, 0.9)}],
    ids=["fault-free", "a little late", "both late", "gain of the first", "gain of the second"],
)
def test_no_late_plate(walk, fault):
    assert [*plate_delay(changed(walk, **fault))] == []
