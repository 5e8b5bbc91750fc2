"""A plate with a wrong gain is shown by what other plates say of the same body."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.evidence.ambiguous_loads import Overhang
from kinertia.diagnostics.plates.gains import gains
from kinertia.trial.ground_contact import centre_of_pressure
from plate_findings import context_of, with_force
from recordings import LONG_WALKS, WALKS

LONG = ("synthetic", "synthetic c3d", "gait2354", "rajagopal", "plug-in gait b")
SOUND = {name: WALKS[name] for name in LONG if name in WALKS} | {"synthetic, long": LONG_WALKS["synthetic"]}


@pytest.fixture(params=SOUND)
def walk(request, recording_of):
    return recording_of(*SOUND[request.param])


def test_fault_free_plates(walk):
    assert [*gains(context_of(walk))] == []


def light_beyond(context):
    """Whether a foot reaches beyond the plate that reads less, which P282 says and explains."""
    return min(context.plate_masses, key=context.plate_masses.get) in context.plates_reached_beyond


def test_single_support_that_the_end_of_a_recording_cuts_is_not_weighed(recording_of):
    """The velocity of the body's centre is uncertain there: a sound plate seemed to weigh 9 % more than the other."""
    walk = recording_of(*WALKS["synthetic"])
    vertical, time = walk.plates.force[..., 1], walk.plates.time
    weighed = context_of(walk).plate_masses
    for p, name in enumerate(walk.plates.names):
        alone = time[(vertical[:, p] > 50.0) & (vertical[:, 1 - p] < 10.0)]
        cut = replace(walk, markers=walk.markers.cut(float(np.median(alone)), float(walk.markers.time[-1])))
        assert name in weighed
        assert name not in context_of(cut).plate_masses


@pytest.mark.parametrize("gain", [0.87, 1.15])
def test_a_wrong_gain(walk, gain):
    factors = np.array([1.0, gain])[:, None]
    plates = walk.plates
    wrong = replace(plates, force=plates.force * factors, moment=plates.moment * factors)
    context = context_of(replace(walk, plates=wrong))
    if light_beyond(context):
        assert [*gains(context)] == []
        return
    (found,) = gains(context)
    assert (found.code, found.where.axis) == ("P221", "vertical")
    apart = found.evidence["mass_kg"].value / found.evidence["other_kg"].value
    assert found.evidence["gain"].value == pytest.approx(apart - 1)
    assert apart == pytest.approx(max(gain, 1 / gain), abs=0.04)
    heavy, light = (found.evidence[name].value for name in ("plate", "other"))
    assert (heavy, light) == (plates.names if gain < 1 else plates.names[::-1])


def test_a_light_plate_that_a_foot_reaches_beyond_is_not_accused(recording_of):
    """A wrong stated mass then shows on the other plate."""
    walk = recording_of(*WALKS["synthetic"])
    factors = np.array([1.0, 0.8])[:, None]
    light = replace(walk.plates, force=walk.plates.force * factors, moment=walk.plates.moment * factors)
    context = context_of(replace(walk, plates=light))
    assert [finding.code for finding in gains(context)] == ["P221"]
    for plate, found in ((0, ["P221"]), (1, [])):
        context.__dict__["overhangs"] = [Overhang(plate, plate, 0.15, (0.5, 1.0), (0.5, 1.0))]
        assert [finding.code for finding in gains(context)] == found


@pytest.mark.parametrize("gain", [0.96, 1.05])
def test_a_gain_that_the_vertical_velocity_shows(recording_of, gain):
    walk = recording_of(*LONG_WALKS["synthetic"])
    factors = np.array([1.0, gain])[:, None]
    plates = walk.plates
    wrong = replace(plates, force=plates.force * factors, moment=plates.moment * factors)
    (found,) = gains(context_of(replace(walk, plates=wrong)))
    assert (found.code, found.evidence["method"].value) == ("P221", "vertical velocity")
    apart = found.evidence["mass_kg"].value / found.evidence["other_kg"].value
    assert apart == pytest.approx(max(gain, 1 / gain), abs=0.02)
    heavy = plates.names[0] if gain < 1 else plates.names[1]
    assert found.evidence["plate"].value == heavy


@pytest.mark.parametrize("foot", [0, 1])
def test_a_crutch_beside_one_foot_looks_like_a_light_plate(walk, foot):
    """It carries a tenth of the weight whenever that foot stands: no plate tells it from a gain."""
    plates = walk.plates
    loaded = (plates.force[:, foot, 1] > 0.0)[:, None]
    support = np.zeros_like(plates.force)
    support[:, foot] = 0.1 * float(plates.force[..., 1].max()) * loaded * np.array([0.0, 1.0, 0.0])
    support[:, foot] = np.minimum(support[:, foot], np.maximum(plates.force[:, foot], 0.0))
    point = centre_of_pressure(plates.wrench)
    moment = plates.moment - np.cross(point, support)
    context = context_of(replace(walk, plates=replace(plates, force=plates.force - support, moment=moment)))
    found = [(finding.code, finding.evidence["other"].value) for finding in gains(context)]
    assert found == ([] if light_beyond(context) else [("P221", plates.names[foot])])


@pytest.mark.parametrize("plate", [0, 1])
def test_one_axis_of_one_plate_that_reads_twice(recording_of, plate):
    walk = recording_of(*LONG_WALKS["synthetic"])
    factors = np.ones((2, 3))
    factors[plate, 0] = 2.0
    context = context_of(with_force(walk, lambda force: force * factors))
    (found,) = gains(context)
    assert found.code == "P222"
    assert found.where.axis == context.along(0)["axis"]
    assert found.where.plate == walk.plates.names[plate]
    assert found.evidence["factor"].value == pytest.approx(2.0, abs=0.3)


@pytest.mark.parametrize("name", [name for name in WALKS if name == "gait2354"])
@pytest.mark.parametrize("plate", [0, 1, None])
def test_an_axis_that_reads_half(recording_of, plate, name):
    """A zero offset of the forces hides nothing of it."""
    recording = recording_of(*WALKS[name])
    factors = np.ones((len(recording.plates.names), 3))
    factors[slice(None) if plate is None else plate, 0] = 0.5
    context = context_of(
        with_force(recording, lambda force: force * factors + [3.0, 0.0, 0.0] * (force[..., 1:2] > 20.0))
    )
    (found,) = gains(context)
    assert (found.code, found.where.axis) == ("P222", context.along(0)["axis"])
    assert found.where.plate == (None if plate is None else recording.plates.names[plate])
    assert found.evidence["factor"].value == pytest.approx(0.5, abs=0.15)


@pytest.mark.parametrize("plate", [0, 1])
def test_zeros_of_both_plates_are_no_gain_of_one(recording_of, plate):
    """Plates that read -10 and -7 N too much, and feet that brake and push off alike: one plate "read 0.55 times"."""
    walk = recording_of(*LONG_WALKS["synthetic"])
    zeros_n = np.array([[-16.0, 0.0, 0.0], [-9.0, 0.0, 0.0]])[:: 1 - 2 * plate]
    wrong = with_force(walk, lambda force: force + zeros_n * (force[..., 1:2] > 20.0))
    assert [finding for finding in gains(context_of(wrong)) if finding.code == "P222"] == []
