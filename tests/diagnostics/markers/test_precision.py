"""Frames that were made up, coordinates that were rounded and noisy markers are found, in no fault-free recording."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.evidence.trajectory_faults import without_copied_frames
from kinertia.diagnostics.markers.trajectories import precision
from kinertia.diagnostics.markers.unmeasured_data import frames
from kinertia.findings.finding import Severity
from marker_contexts import context_of
from recordings import RUNS, WALKS, named_here

OTHERS = {
    **{f"run, {name}": files for name, files in RUNS.items()},
    **named_here(
        {
            "synthetic squats": ("synthetic/squats.trc", None),
            "synthetic standing": ("synthetic/static.trc", None),
            "jump": ("field/laiarnold5_jump/DJ1.trc", None),
            "squats": ("subject4/squats1.trc", None),
            "OpenCap": ("subject4/walking1.trc", None),
            "standing": ("gait2354/subject01_static.trc", None),
            "coordinates of 16 bits": ("c3d_variety/subject_prefixed_labels.c3d", None),
        }
    ),
}


def found(markers, question=frames):
    return list(question(context_of(markers)))


def made_up(markers):
    return {"M122", "M123"} & {finding.code for finding in found(markers)}


@pytest.mark.parametrize("name", [*WALKS, *OTHERS])
def test_fault_free_recordings(name, recording_of):
    markers = recording_of(*{**WALKS, **OTHERS}[name]).markers
    assert found(markers) == found(markers, precision) == []
    assert without_copied_frames(markers) is markers


@pytest.fixture(params=WALKS)
def walk(request, recording_of):
    return recording_of(*WALKS[request.param]).markers


@pytest.mark.parametrize(("rate_hz", "codes"), [(44.9, ["M124"]), (45.1, [])])
def test_few_frames_a_second_are_reported(walk, rate_hz, codes):
    """Joint moments moved by up to 3.8 SDs with 33 of 100 frames a second, and nothing was said."""
    markers = replace(walk, time=np.arange(len(walk.time)) / rate_hz)
    assert [finding.code for finding in found(markers) if finding.code == "M124"] == codes


@pytest.mark.parametrize("times", [2, 3, 4])
def test_frames_that_are_held(walk, times):
    held = replace(walk, positions=walk.positions[np.arange(len(walk.time)) // times * times])
    (finding,) = found(held)
    assert (finding.code, finding.evidence["method"].value) == ("M123", "held")
    assert finding.evidence["true_rate_hz"].value == pytest.approx(walk.rate_hz / times, rel=0.05)
    assert without_copied_frames(held) is held


def copied(walk, every):
    """Every so manieth frame lost and filled with a copy."""
    places = walk.positions.copy()
    places[every::every] = places[every - 1 : -1 : every]
    return replace(walk, positions=places), len(places[every::every])


@pytest.mark.parametrize(("every", "severity"), [(10, Severity.ERROR), (40, Severity.WARNING)])
def test_few_copies_of_lost_frames_are_a_warning(walk, every, severity):
    """They become gaps, which is all that is wrong with them (D5)."""
    markers, count = copied(walk, every)
    (finding,) = found(markers)
    assert (finding.code, finding.severity, finding.evidence["frames"].value) == ("M122", severity, count)
    assert finding.evidence["first_s"].value == walk.time[every]
    cleaned = without_copied_frames(markers)
    lost = np.arange(len(walk.time)) % every == 0
    lost[0] = False
    assert np.isnan(cleaned.positions[lost]).all()
    assert np.array_equal(cleaned.positions[~lost], markers.positions[~lost], equal_nan=True)


def test_frames_that_were_put_in_are_an_error(walk):
    """Everything after them is late."""
    middle = len(walk.time) // 2
    rows = np.r_[0 : middle + 1, middle, middle, middle + 1 : len(walk.time) - 2]
    (finding,) = found(replace(walk, positions=walk.positions[rows]))
    assert (finding.code, finding.severity) == ("M122", Severity.ERROR)
    assert (finding.evidence["frames"].value, finding.evidence["inserted"].value) == (2, 2)
    assert finding.evidence["first_s"].value == walk.time[middle + 1]


def test_frames_held_at_the_ends_do_not_matter(walk):
    places = walk.positions.copy()
    places[:3], places[-3:] = places[3], places[-4]
    assert not made_up(replace(walk, positions=places))


def test_frames_that_are_drawn_between_others(walk):
    kept = np.arange(0, len(walk.time), 4)
    rows = np.arange(kept[-1] + 1)
    share = (rows % 4 / 4)[:, None, None]
    before, after = walk.positions[rows // 4 * 4], walk.positions[np.minimum(rows // 4 * 4 + 4, kept[-1])]
    (finding,) = found(replace(walk, time=walk.time[rows], positions=(1 - share) * before + share * after))
    assert (finding.code, finding.evidence["method"].value) == ("M123", "interpolated")


def test_standing_still_before_the_motion_is_not_made_up(walk):
    """Filtered markers of a person who sways slowly bend as little as straight lines do, for seconds."""
    count = int(0.85 * len(walk.time))
    sway = 0.005 * np.sin(2 * np.pi * 0.3 * (np.arange(count) - count) / walk.rate_hz)
    standing = walk.positions[0] + sway[:, None, None] * [1.0, 0.0, 0.3]
    for before in (standing, np.repeat(walk.positions[:1], count, axis=0)):
        positions = np.concatenate([before, walk.positions])
        time = walk.time[0] + np.arange(len(positions)) / walk.rate_hz
        assert not made_up(replace(walk, time=time, positions=positions))


@pytest.mark.parametrize("step_m", [0.001, 0.002, 0.005, 0.01])
def test_coordinates_that_were_rounded(walk, step_m):
    rounded = found(replace(walk, positions=np.round(walk.positions / step_m) * step_m), precision)
    steps = [finding.evidence["step_m"].value for finding in rounded if finding.code == "M131"]
    assert steps == pytest.approx([step_m] if step_m > 0.001 else [], rel=1e-3)


@pytest.mark.parametrize(("sd_m", "count"), [(0.001, 0), (0.004, 1), (0.01, 1)])
def test_noise(walk, sd_m, count):
    noise = np.random.default_rng(104).normal(0.0, sd_m, walk.positions.shape)
    noisy = found(replace(walk, positions=walk.positions + noise), precision)
    assert [finding.code for finding in noisy] == ["M132"] * count
    assert [finding.evidence["noise_m"].value for finding in noisy] == pytest.approx([sd_m] * count, rel=0.2)
