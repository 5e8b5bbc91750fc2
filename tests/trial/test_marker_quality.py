import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinertia.trial.data import Markers
from kinertia.trial.marker_quality import extent_m, still_span_s, travel, visibility

RATE_HZ, FRAMES = 50.0, 100


BODY_M = np.array([[0.1, 0.05, 0.1], [0.0, 0.9, -0.1], [0.0, 1.6, 0.0]])


def markers(path_m=(0.0, 0.0, 0.0), sway_m=0.0):
    """Three markers that are carried along a path, linear in time, and sway sideways."""
    share = np.linspace(0, 1, FRAMES)[:, None, None]
    sway = sway_m * np.sin(40 * share) * np.array([0.0, 0.0, 1.0])
    return Markers(np.arange(FRAMES) / RATE_HZ, ("HEEL", "ASIS", "HEAD"), BODY_M + share * np.array(path_m) + sway)


@given(st.lists(st.booleans(), min_size=1, max_size=40))
def test_visibility_counts_frames(seen):
    positions = np.where(np.array(seen)[:, None, None], 1.0, np.nan) * np.ones((len(seen), 1, 3))
    (marker,) = visibility(Markers(np.arange(len(seen)) / RATE_HZ, ("A",), positions))
    gaps = "".join("x" if is_seen else "." for is_seen in seen).split("x")
    assert marker.share == pytest.approx(sum(seen) / len(seen))
    if len(seen) > 1:
        assert marker.longest_gap_s == pytest.approx(max(map(len, gaps)) / RATE_HZ)


@pytest.mark.parametrize(
    ("path", "axis", "off"),
    [((2, 0, 0), "+X", 0), ((-2, 0, 0), "-X", 0), ((0, 0, 2), "+Z", 0), ((0, 0, -2), "-Z", 0), ((2, 0, -0.5), "+X", 14),
     ((-2, 0, 0.2), "-X", 6)],
)  # fmt: skip
def test_direction_of_the_walk(path, axis, off):
    moves = travel(markers(path))
    assert moves.kind == "walks"
    aside = f" ({off} degrees off)" if off else ""
    assert moves.sentence().startswith(f"walks along {axis}{aside}, ")
    assert moves.speed_m_s == pytest.approx(np.hypot(path[0], path[2]) / ((FRAMES - 1) / RATE_HZ), rel=1e-6)


def test_standing_and_moving_on_the_spot():
    assert travel(markers(sway_m=0.005)).kind == "stands still"
    assert travel(markers(sway_m=0.2)).kind == "no net travel"
    nobody = Markers(np.arange(3.0), ("A",), np.full((3, 1, 3), np.nan))
    assert travel(nobody).kind == "stands still"
    assert np.isnan(extent_m(nobody)).all()


def test_walk_is_seen_through_gaps():
    walk = markers((2, 0, 0))
    positions = walk.positions.copy()
    positions[10:40, 0] = positions[60:, 1] = positions[:5] = np.nan
    moves = travel(Markers(walk.time, walk.labels, positions))
    assert moves.kind == "walks"
    assert moves.direction_deg == pytest.approx(0.0, abs=1e-6)


TIME = np.arange(400) / 100


def moving(speed_m_s):
    """Two markers that move along X at this speed (400,) m/s."""
    along = np.cumsum(speed_m_s) / 100
    return Markers(TIME, ("A", "B"), np.stack([np.column_stack([along, 0 * along, 0 * along])] * 2, axis=1))


def test_the_longest_part_is_found():
    walks = (TIME < 0.5) | (TIME > 2.5)
    start, end = still_span_s(moving(np.where(walks, 1.0, 0.01)))
    assert start == pytest.approx(0.5, abs=0.11)
    assert end == pytest.approx(2.5, abs=0.11)


def test_there_is_none_in_a_walk_or_in_a_short_pause():
    assert still_span_s(moving(np.full(400, 1.2))) is None
    assert still_span_s(moving(np.where((TIME > 1.0) & (TIME < 1.3), 0.0, 1.2))) is None
