"""Zeros of loaded plates, forces that no plate measures and tilted verticals; one fault is one finding."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinertia.diagnostics.plates.zeros import zeros_under_load
from kinertia.trial.data import Markers, UnloadedReading
from kinertia.trial.plate_loading import with_unloaded_levels, without_unloaded_level
from plate_findings import codes, context_of, found_in, with_force
from recordings import LONG_WALKS, WALKS, here


@pytest.fixture(params=WALKS)
def walk(request, recording_of):
    return recording_of(*WALKS[request.param])


def pushed(walk, newton, axis):
    """Both plates read so much more while they are loaded."""
    return with_force(walk, lambda force: force + (force[..., 1:2] > 0) * newton * np.eye(3)[axis])


def with_levels(walk, *levels):
    """The walk whose unloaded plates read these (3,) N."""
    unloaded = tuple(UnloadedReading(level, 0.0, 800.0, 0.0) for level in levels)
    return replace(walk, plates=replace(walk.plates, unloaded=unloaded))


@pytest.mark.parametrize("axis", [0, 2])
@pytest.mark.parametrize("newton", [-50.0, 50.0])
def test_forces_that_accelerate_nothing(walk, axis, newton):
    context = context_of(pushed(walk, newton, axis))
    (found,) = [*zeros_under_load(context)]
    assert (found.code, found.where) == ("P214", context.at(**context.along(axis)))
    assert np.sign(found.evidence["force_n"].value) == np.sign(newton)


@pytest.mark.parametrize("degrees", [5.0, -4.0])
def test_plates_that_are_not_level(walk, degrees):
    """Weight along a horizontal axis looks like its zero."""
    turn = Rotation.from_euler("z", degrees, degrees=True).as_matrix()
    (found,) = [*zeros_under_load(context_of(with_force(walk, lambda force: force @ turn.T)))]
    assert found.code == "P214"
    assert np.degrees(found.evidence["tilt_rad"].value) == pytest.approx(-degrees, abs=1.0)


def test_what_unloaded_plates_read_decides_which_cause_comes_first(walk):
    """D3: nobody is asked what is known."""
    wrong = pushed(walk, 30.0, 0)

    def first(*levels):
        (found,) = [*zeros_under_load(context_of(with_levels(wrong, *levels)))]
        assert found.evidence["unloaded_n"].value == tuple(level[0] for level in levels)
        return found.causes[0]

    assert "P213" in first((30.0, 0.0, 0.0), (30.0, 0.0, 0.0))
    for other in (0.0, -30.0):
        assert "P213" not in first((other, 0.0, 0.0), (other, 0.0, 0.0))


@pytest.mark.parametrize("axis", [0, 2])
def test_one_zero_is_one_finding(recording_of, axis):
    """D12: P212 or P214 of the loaded plate, and P213 of the unloaded one, are one fault; once it is taken off it is
    none.
    """
    walk = recording_of(*LONG_WALKS["synthetic"])
    plates, zero = walk.plates, 30.0 * np.eye(3)[axis]
    rng = np.random.default_rng(100)
    force, moment = plates.force.copy(), plates.moment.copy()
    force[:, 0] += zero
    moment[:, 0] += np.cross(
        plates.moment[:, 0].sum(axis=0)[[2, 1, 0]] / plates.force[:, 0, 1].sum() * [1, 0, -1], zero
    )
    force += rng.normal(0.0, 1.0, force.shape)
    moment += rng.normal(0.0, 0.1, moment.shape)
    readings = [without_unloaded_level(plates.time, force[:, p], moment[:, p]) for p in range(2)]
    read = (
        np.stack([reading.force for reading in readings], axis=1),
        np.stack([reading.moment for reading in readings], axis=1),
    )
    corrected = replace(plates, force=read[0], moment=read[1], unloaded=tuple(reading.unloaded for reading in readings))
    assert codes(found_in(context_of(replace(walk, plates=corrected)))) == ["P216"]
    context = context_of(replace(walk, plates=with_unloaded_levels(corrected)))
    found = found_in(context)
    assert codes(found) == ["P213"]
    (zero_found,) = [finding for finding in found if finding.is_open]
    assert zero_found.where == context.at(plate=plates.names[0], **context.along(axis))
    assert zero_found.evidence["level_n"].value == pytest.approx(30.0, abs=1.0)
    assert {finding.code for finding in found if finding.muted_by == "P213"} & {"P212", "P214"}


CHILDREN = here(
    [(f"field/biomechzoo/HC0{name}/{way}.c3d", None) for name in ("02D", "36A", "40A") for way in ("straight", "turn")]
)


@pytest.mark.parametrize("files", CHILDREN)
def test_fault_free_children(recording_of, files):
    """D14 would accuse plates under three of 25 to 33 kg: their limits here are an adult's."""
    recording = recording_of(*files)
    assert [*zeros_under_load(context_of(recording, mass_kg=recording.mass_kg))] == []


def test_windows_that_are_too_short_say_nothing(recording_of):
    walk = recording_of(*WALKS["synthetic"])
    markers: Markers = walk.markers.cut(1.2, 1.5)
    assert [*zeros_under_load(context_of(replace(walk, markers=markers)))] == []
