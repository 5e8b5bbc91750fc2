import numpy as np
import pytest

from kinertia.errors import MarkerSetError
from kinertia.trial.data import FootLoads, Markers, PlateLoads, Trial
from kinertia.trial.sampled_data import runs, windows


def markers(n=11, labels=("a", "b")):
    positions = np.random.default_rng(0).standard_normal((n, len(labels), 3))
    return Markers(np.arange(n) / 100, tuple(labels), positions)


def trial(measured):
    m = markers(len(measured))
    loads = FootLoads(m.time, *np.random.default_rng(1).standard_normal((2, len(measured), 2, 3)))
    return Trial("walk", m, loads, np.array(measured, bool))


def about_vertical(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def test_rate():
    assert markers().rate_hz == 100.0
    assert np.isnan(markers(1).rate_hz)


def test_cut_keeps_both_ends():
    cut = markers().cut(0.02, 0.05)
    np.testing.assert_allclose(cut.time, [0.02, 0.03, 0.04, 0.05])
    assert cut.positions.shape == (4, 2, 3)


def test_select_keeps_order():
    m = markers()
    chosen = m.select(["b", "a"])
    assert chosen.labels == ("b", "a")
    np.testing.assert_array_equal(chosen.positions[:, 0], m.positions[:, 1])


def test_select_names_nearest_labels():
    with pytest.raises(MarkerSetError, match=r"'RHEEL' \(nearest: RHEE") as caught:
        markers(labels=("RHEE", "LTOE")).select(["RHEEL"])
    assert caught.value.missing == ("RHEEL",)
    assert caught.value.nearest["RHEEL"] == ["RHEE"]
    assert (caught.value.finding.code, caught.value.finding.where.markers) == ("L104", ("RHEEL",))


def test_shapes_and_labels_are_checked():
    with pytest.raises(ValueError, match="positions must have shape"):
        Markers(np.zeros(2), ("a",), np.zeros((3, 1, 3)))
    with pytest.raises(ValueError, match="differ"):
        markers(labels=("a", "a"))
    with pytest.raises(ValueError, match="declared feet"):
        PlateLoads(np.zeros(2), ("p",), np.zeros((2, 1, 3)), np.zeros((2, 1, 3)), ())
    with pytest.raises(ValueError, match="measured"):
        Trial("walk", markers(3), FootLoads(np.zeros(1), np.zeros((1, 2, 3)), np.zeros((1, 2, 3))), np.ones(4, bool))


def test_windows_longest_first():
    spans = trial([0, 1, 1, 0, 1, 1, 1, 0, 1]).windows()
    np.testing.assert_allclose(spans, [(0.04, 0.06), (0.01, 0.02), (0.08, 0.08)])
    assert trial([0, 0]).windows() == []
    assert windows(np.arange(3.0), np.ones(3, bool)) == [(0.0, 2.0)]


def test_runs():
    assert runs(np.array([1, 1, 0, 1], bool)) == [(0, 1), (3, 3)]
    assert runs(np.zeros(0, bool)) == []


def test_rotated_turns_markers_and_loads_alike():
    t = trial([1] * 5)
    turn = about_vertical(0.7)
    turned = t.rotated(turn)
    np.testing.assert_allclose(turned.markers.positions[2, 1], turn @ t.markers.positions[2, 1])
    np.testing.assert_allclose(turned.loads.force[3, 1], turn @ t.loads.force[3, 1])
    np.testing.assert_allclose(turned.loads.moment[3, 0], turn @ t.loads.moment[3, 0])
    back = turned.rotated(turn.T)
    np.testing.assert_allclose(back.markers.positions, t.markers.positions, atol=1e-12)


@pytest.mark.parametrize("bad", [np.diag([1.0, -1, -1]), 2 * np.eye(3), np.diag([1.0, 1, -1])])
def test_rotated_takes_turns_about_the_vertical_only(bad):
    with pytest.raises(ValueError, match="vertical"):
        trial([1]).rotated(bad)
