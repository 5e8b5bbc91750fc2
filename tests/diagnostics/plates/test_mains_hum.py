"""A hum of the mains is named with its frequency, plate and axis; sound forces have none."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.plates.mains_hum import hum_doubts, hum_trouble
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
def test_sound_forces(name, recording_of):
    plates = recording_of(*{**WALKS, **OTHERS}[name]).plates
    assert hum_trouble(plates) == ""
    assert hum_doubts(plates) == []


@pytest.mark.parametrize("name", WALKS)
@pytest.mark.parametrize("mains_hz", [50.0, 60.0])
@pytest.mark.parametrize("axis", [0, 1])
def test_hum(name, mains_hz, axis, recording_of):
    plates = recording_of(*WALKS[name]).plates
    hum = np.sin(2 * np.pi * mains_hz * plates.time + 1.0)
    for size, refused in ((8.0, False), (25.0, True)):
        force = plates.force.copy()
        loaded = force[:, 0, 1] > 0
        force[loaded, 0, axis] += size * hum[loaded]
        (sentence,) = hum_doubts(replace(plates, force=force))
        assert f"N at {mains_hz:g} Hz ({plates.names[0]}, along {'XYZ'[axis]})" in sentence
        assert float(sentence.partition("with ")[2].partition(" N")[0]) == pytest.approx(size, rel=0.15)
        assert bool(hum_trouble(replace(plates, force=force))) == refused
