"""Frames that were made up, coordinates that were rounded and noisy markers are named; sound recordings never are."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.markers.marker_resolution import made_up_frames_trouble, noisy_doubts, rounded_trouble
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


def all_of(markers):
    return [made_up_frames_trouble(markers), rounded_trouble(markers), *noisy_doubts(markers)]


@pytest.mark.parametrize("name", [*WALKS, *OTHERS])
def test_sound_recordings(name, recording_of):
    assert not any(all_of(recording_of(*{**WALKS, **OTHERS}[name]).markers))


@pytest.fixture(params=WALKS)
def walk(request, recording_of):
    return recording_of(*WALKS[request.param]).markers


@pytest.mark.parametrize("times", [2, 3, 4])
def test_frames_that_are_held(walk, times):
    held = replace(walk, positions=walk.positions[np.arange(len(walk.time)) // times * times])
    trouble = made_up_frames_trouble(held)
    assert "repeats the one before it" in trouble
    assert f"at about {walk.rate_hz / times:.0f} Hz" in trouble


def test_every_tenth_frame_repeats_the_one_before_it(walk):
    places = walk.positions.copy()
    places[10::10] = places[9:-1:10]
    count = len(places[10::10])
    trouble = made_up_frames_trouble(replace(walk, positions=places))
    said = f"{count} of {len(places)} marker frames repeat the one before them, in all markers at once, the first at "
    assert trouble.startswith(f"{said}{walk.time[10]:.3f} s")


def test_frames_that_were_put_in(walk):
    middle = len(walk.time) // 2
    rows = np.r_[0 : middle + 1, middle, middle, middle + 1 : len(walk.time) - 2]
    trouble = made_up_frames_trouble(replace(walk, positions=walk.positions[rows]))
    assert trouble.startswith(f"2 of {len(rows)} marker frames repeat")
    assert f"the first at {walk.time[middle + 1]:.3f} s" in trouble


def test_frames_held_at_the_ends_are_no_trouble(walk):
    places = walk.positions.copy()
    places[:3], places[-3:] = places[3], places[-4]
    assert made_up_frames_trouble(replace(walk, positions=places)) == ""


def test_frames_that_are_drawn_between_others(walk):
    kept = np.arange(0, len(walk.time), 4)
    rows = np.arange(kept[-1] + 1)
    share = (rows % 4 / 4)[:, None, None]
    before, after = walk.positions[rows // 4 * 4], walk.positions[np.minimum(rows // 4 * 4 + 4, kept[-1])]
    drawn = replace(walk, time=walk.time[rows], positions=(1 - share) * before + share * after)
    assert "straight line between others" in made_up_frames_trouble(drawn)


def test_standing_still_before_the_motion_is_not_made_up(walk):
    """Filtered markers of a person who sways slowly bend as little as straight lines do, for seconds."""
    frames = int(0.85 * len(walk.time))
    sway = 0.005 * np.sin(2 * np.pi * 0.3 * (np.arange(frames) - frames) / walk.rate_hz)
    standing = walk.positions[0] + sway[:, None, None] * [1.0, 0.0, 0.3]
    positions = np.concatenate([standing, walk.positions])
    time = walk.time[0] + np.arange(len(positions)) / walk.rate_hz
    assert made_up_frames_trouble(replace(walk, time=time, positions=positions)) == ""
    frozen = np.concatenate([np.repeat(walk.positions[:1], frames, axis=0), walk.positions])
    assert made_up_frames_trouble(replace(walk, time=time, positions=frozen)) == ""


@pytest.mark.parametrize("step_m", [0.002, 0.005, 0.01])
def test_coordinates_that_were_rounded(walk, step_m):
    trouble = rounded_trouble(replace(walk, positions=np.round(walk.positions / step_m) * step_m))
    assert f"multiples of {1e3 * step_m:.3g} mm" in trouble


def test_coordinates_in_whole_millimetres(walk):
    assert rounded_trouble(replace(walk, positions=np.round(walk.positions, 3))) == ""


@pytest.mark.parametrize(("sd_m", "said"), [(0.001, 0), (0.004, 1), (0.01, 1)])
def test_noise(walk, sd_m, said):
    noise = np.random.default_rng(4).normal(0.0, sd_m, walk.positions.shape)
    doubts = noisy_doubts(replace(walk, positions=walk.positions + noise))
    assert len(doubts) == said
    if said:
        assert float(doubts[0].partition("by ")[2].partition(" mm")[0]) == pytest.approx(1e3 * sd_m, rel=0.2)
