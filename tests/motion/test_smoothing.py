import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.interpolate import BSpline

from kinertia.motion import smoothing
from kinertia.motion.smoothing import SmoothingError, _System, smooth


def dense_smoother(time, visible, p):
    """Influence matrix and splines by brute force, with no code shared: all quintic splines with knots at
    the samples (clamped basis), penalty by quadrature, dense least squares."""
    n = len(time)
    knots = np.concatenate([[time[0]] * 5, time, [time[-1]] * 5])
    x, w = np.polynomial.legendre.leggauss(3)
    half = np.diff(time) / 2
    points = (time[:-1] + half)[:, None] + half[:, None] * x
    third = BSpline(knots, np.eye(n + 4), 5).derivative(3)(points.ravel())
    roughness = np.sqrt(p * half[:, None] * w).reshape(-1, 1) * third
    basis = BSpline(knots, np.eye(n + 4), 5)(time)
    q, r = np.linalg.qr(np.concatenate([visible[:, None] * basis, roughness]))
    coefficients = np.linalg.solve(r, (q[:n] * visible[:, None]).T)
    return basis @ coefficients, BSpline(knots, coefficients, 5)


def irregular(n, seed=0):
    """Irregular times with a mean spacing of about 0.01 s, starting away from zero."""
    return 3.0 + 0.01 * np.cumsum(np.random.default_rng(seed).uniform(0.5, 1.5, n))


def noisy_sinusoids(n=400, rate_hz=100.0, sigma=0.02, columns=8, seed=0):
    time = np.arange(n) / rate_hz
    rng = np.random.default_rng(seed)
    frequency, phase = rng.uniform(0.8, 2.0, columns), rng.uniform(0, 6, columns)
    angle = 2 * np.pi * frequency * time[:, None] + phase
    truth = [(2 * np.pi * frequency) ** d * np.sin(angle + d * np.pi / 2) for d in range(3)]
    return time, truth, truth[0] + sigma * rng.standard_normal((n, columns))


@pytest.mark.parametrize("cutoff_hz", [0.02, 1.0, 6.0, 40.0])
def test_smooth_reproduces_parabola_for_any_cutoff(cutoff_hz):
    time = irregular(200)
    spline = smooth(time, 3 + 2 * time - 5 * time**2, cutoff_hz)
    between = np.linspace(time[0], time[-1], 333)
    assert_allclose(spline(between), 3 + 2 * between - 5 * between**2, rtol=1e-9)
    assert_allclose(spline(between, 1), 2 - 10 * between, rtol=1e-8)
    assert_allclose(spline(between, 2), -10, rtol=1e-6)


def test_smooth_reproduces_parabola_with_gcv():
    time = irregular(100)
    assert_allclose(smooth(time, 1 - time**2, "gcv")(time), 1 - time**2, rtol=1e-9)
    assert_allclose(smooth(time, np.zeros(100), "gcv")(time), 0, atol=1e-300)


def test_smooth_interpolates_as_the_cutoff_grows():
    time = irregular(50)
    y = np.random.default_rng(1).standard_normal((50, 3))
    spline = smooth(time, y, 1e5)
    assert_allclose(spline(time), y, atol=1e-9)
    assert np.isnan(spline.sigma).all()


@pytest.mark.parametrize("cutoff_hz", [3.0, 10.0, 60.0])
@pytest.mark.parametrize("gap", [(), (0, 1, 2), (10, 11, 12, 20, 39), (38, 39)])
def test_fit_and_trace_equal_dense_smoother(cutoff_hz, gap):
    time = irregular(40)
    y = np.random.default_rng(2).standard_normal((40, 2))
    visible = np.ones(40, bool)
    visible[list(gap)] = False
    spline = smooth(time, np.where(visible[:, None], y, np.nan), cutoff_hz)
    influence, dense = dense_smoother(time, visible, spline.p[0])
    assert_allclose(spline(time), influence @ y, atol=1e-9)
    t = np.linspace(time[0], time[-1], 101)
    for d in range(5):
        expected = dense(t, d) @ y
        assert_allclose(spline(t, d), expected, atol=1e-7 * np.abs(expected).max())
    spacing = (time[-1] - time[0]) / 39
    system = _System.of((time - time[0]) / spacing)
    _, rss, trace = system.fit(np.where(visible[:, None], y, 0.0), visible, cutoff_hz * spacing)
    assert_allclose(trace, np.trace(influence), rtol=1e-9)
    residual = (y - influence @ y)[visible]
    assert_allclose(rss, (residual**2).sum(axis=0), rtol=1e-9)
    assert_allclose(spline.sigma, np.sqrt(rss / (visible.sum() - np.trace(influence))), rtol=1e-9)


def test_natural_boundary_conditions_and_parabola_beyond():
    time = irregular(60)
    spline = smooth(time, np.sin(20 * time), 20.0)
    ends = time[[0, -1]]
    size = np.abs(spline(time, 3)).max(), np.abs(spline(time, 4)).max()
    assert np.abs(spline(ends, 3)).max() < 1e-6 * size[0]
    assert np.abs(spline(ends, 4)).max() < 1e-6 * size[1]
    h = 0.03
    s, v, a = (spline(time[-1], d) for d in range(3))
    assert_allclose(spline(time[-1] + h), s + v * h + a * h**2 / 2, rtol=1e-9)
    assert_allclose(spline(time[-1] + h, 1), v + a * h, rtol=1e-9)
    assert_allclose(spline(time[-1] + h, 2), a)
    assert spline(time[-1] + h, 3) == spline(time[0] - h, 4) == 0


def test_derivatives_are_derivatives():
    time, _, y = noisy_sinusoids(columns=2)
    spline = smooth(time, y, 8.0)
    t, h = np.linspace(0.503, 3.403, 30), 1e-5
    for d in range(4):
        slope = (spline(t + h, d) - spline(t - h, d)) / (2 * h)
        assert_allclose(slope, spline(t, d + 1), atol=1e-4 * np.abs(spline(t, d + 1)).max())


@pytest.mark.parametrize(("rate_hz", "fc"), [(100.0, 6.0), (100.0, 20.0), (2000.0, 6.0), (2000.0, 1.0)])
def test_cutoff_is_the_half_gain_of_a_sixth_order_law(rate_hz, fc):
    time = np.arange(round(16 * rate_hz / min(fc, 6.0))) / rate_hz
    middle = slice(len(time) * 2 // 5, len(time) * 3 // 5)
    for ratio in (0.5, 1.0, 1.25):
        wave = np.exp(2j * np.pi * ratio * fc * time)
        spline = smooth(time, np.stack([wave.real, wave.imag], axis=1), fc)
        gain = np.linalg.norm(spline(time)[middle], axis=1)
        assert_allclose(gain, 1 / (1 + ratio**6), rtol=5e-3)
        assert_allclose(spline.p, 1 / ((2 * np.pi * fc) ** 6) * rate_hz)


def test_gcv_attains_the_minimum_of_the_dense_gcv():
    time, _, y = noisy_sinusoids(n=80, rate_hz=50.0, columns=3)
    spline = smooth(time, y, "gcv")
    visible = np.ones(80, bool)

    def dense_gcv(p, column):
        influence, _ = dense_smoother(time, visible, p)
        residual = y[:, column] - influence @ y[:, column]
        return 80 * (residual @ residual) / (80 - np.trace(influence)) ** 2

    for column in range(3):
        attained = dense_gcv(spline.p[column], column)
        around = [dense_gcv(spline.p[column] * factor, column) for factor in np.geomspace(1e-4, 1e4, 33)]
        assert attained <= min(around) * (1 + 1e-6)


def test_gcv_finds_noise_and_derivatives():
    sigma = 0.02
    time, truth, y = noisy_sinusoids(sigma=sigma)
    spline = smooth(time, y, "gcv")
    assert_allclose(spline.sigma, sigma, rtol=0.12)
    inner = slice(20, -20)
    for d, tolerance in enumerate((0.02, 0.04, 0.12)):
        error = (spline(time, d) - truth[d])[inner]
        assert np.all(error.std(axis=0) < tolerance * truth[d].std(axis=0))


def test_gcv_with_gaps_uses_each_columns_own_samples():
    time, _, y = noisy_sinusoids(columns=4)
    broken = y.copy()
    broken[100:112, 1] = np.nan
    broken[:5, 2] = np.nan
    spline, whole = smooth(time, broken, "gcv"), smooth(time, y, "gcv")
    for attribute in ("p", "cutoff_hz", "sigma"):
        assert_allclose(getattr(spline, attribute)[[0, 3]], getattr(whole, attribute)[[0, 3]], rtol=1e-9)
    kept = smooth(time[~np.isnan(broken[:, 1])], y[~np.isnan(broken[:, 1]), 1], "gcv")
    assert_allclose(spline(time)[:, 1], kept(time), atol=1e-3)
    assert_allclose(spline.p[1], kept.p, rtol=0.01)
    assert np.isfinite(spline(time, 2)).all()


def test_gap_at_a_fixed_p_equals_fit_of_the_visible_samples():
    time, _, y = noisy_sinusoids(n=100, columns=1)
    visible = np.ones(100, bool)
    visible[40:50] = visible[:3] = False
    spline = smooth(time, np.where(visible[:, None], y, np.nan), 7.0)
    part = time[visible]
    same_p = (spline.p[0] * (part[-1] - part[0]) / (len(part) - 1)) ** (-1 / 6) / (2 * np.pi)
    assert_allclose(spline(time, 2), smooth(part, y[visible], same_p)(time, 2), atol=1e-6)


def test_single_column_has_scalar_attributes():
    time, _, y = noisy_sinusoids(columns=1)
    single, many = smooth(time, y[:, 0], "gcv"), smooth(time, y, "gcv")
    assert single.p.shape == single.cutoff_hz.shape == single.sigma.shape == ()
    assert single(0.5).shape == ()
    assert single(time[:7]).shape == (7,)
    assert single(time[:6].reshape(2, 3)).shape == (2, 3)
    assert many(time[:6].reshape(2, 3)).shape == (2, 3, 1)
    assert many(-0.01).shape == (1,)
    assert_allclose(single(time, 2), many(time, 2)[:, 0])


def test_smooth_leaves_its_input_alone():
    time, _, y = noisy_sinusoids(columns=2)
    y[5, 0] = np.nan
    before = y.copy()
    smooth(time, y, "gcv")
    np.testing.assert_array_equal(y, before)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), a=st.floats(-10, 10), b=st.floats(-10, 10), cutoff=st.floats(1, 45))
def test_smoothing_is_linear_in_the_data(seed, a, b, cutoff):
    rng = np.random.default_rng(seed)
    time, x, y = irregular(40, seed), rng.standard_normal(40), rng.standard_normal(40)
    combined = smooth(time, a * x + b * y, cutoff)(time)
    assert_allclose(combined, a * smooth(time, x, cutoff)(time) + b * smooth(time, y, cutoff)(time), atol=1e-8)


@settings(max_examples=30, deadline=None)
@given(shift=st.floats(-100, 100), factor=st.floats(0.01, 100), cutoff=st.floats(1, 45))
def test_smoothing_does_not_depend_on_origin_or_unit_of_time(shift, factor, cutoff):
    time = np.arange(40) / 100
    y = np.random.default_rng(4).standard_normal(40)
    spline, moved = smooth(time, y, cutoff), smooth(time + shift, y, cutoff)
    assert_allclose(moved(time + shift), spline(time), atol=1e-7)
    scaled = smooth(time * factor, y, cutoff / factor)
    assert_allclose(scaled(time * factor, 2) * factor**2, spline(time, 2), rtol=1e-5, atol=1e-3)
    assert_allclose(scaled.p, spline.p * factor**5, rtol=1e-9)


def test_agrees_with_opensim():
    osim = pytest.importorskip("opensim")
    time, _, y = noisy_sinusoids(n=200, columns=2)
    table = osim.TimeSeriesTable()
    table.setColumnLabels(["a", "b"])
    for t, row in zip(time, y, strict=True):
        table.appendRow(float(t), osim.RowVector([float(v) for v in row]))
    theirs = osim.GCVSplineSet(table, ["a", "b"], 5, -1.0)
    ours = smooth(time, y, "gcv")
    at = np.linspace(0.1, 1.8, 50)
    for column in range(2):
        function = theirs.get(column)
        for d, tolerance in enumerate((1e-4, 1e-3, 5e-3)):
            order = [0] * d  # OpenSim's own StdVectorInt may be taken for ezc3d's
            points = [osim.Vector(1, float(t)) for t in at]
            values = [function.calcDerivative(order, x) if d else function.calcValue(x) for x in points]
            expected = ours(at, d)[:, column]
            assert_allclose(values, expected, atol=tolerance * np.abs(expected).max())


def test_memory_grows_with_n_not_with_its_square():
    n = 20_000
    time = np.arange(n) / 1000
    y = np.sin(time)
    tracemalloc.start()
    smooth(time, y, 6.0)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2000 * n < 8 * n**2 / 50


@pytest.mark.slow
def test_a_minute_at_a_thousand_hertz():
    n = 60_000
    time = np.arange(n) / 1000
    y = np.sin(time) + 0.1 * np.random.default_rng(0).standard_normal(n)
    spline = smooth(time, y, "gcv")
    assert_allclose(spline.sigma, 0.1, rtol=0.02)
    assert np.abs(spline(time) - np.sin(time)).std() < 0.01


def test_too_few_samples():
    y = np.ones((20, 2))
    y[5:, 1] = np.nan
    with pytest.raises(SmoothingError, match="column 1 has 5 visible samples") as caught:
        smooth(np.arange(20.0), y, "gcv")
    assert (caught.value.column, caught.value.n_visible) == (1, 5)
    assert smooth(np.arange(6.0), np.arange(6.0) ** 2, 0.1)(2.5) == pytest.approx(6.25)


@pytest.mark.parametrize(
    ("time", "values", "smoothing", "message"),
    [
        (np.arange(9.0), np.ones(8), 6.0, r"\(9,\) and \(8,\)"),
        (np.ones((9, 1)), np.ones(9), 6.0, "time must be"),
        (np.arange(9.0), np.ones((9, 2, 3)), 6.0, "values"),
        (np.arange(9.0)[::-1], np.ones(9), 6.0, "increasing"),
        (np.array([0, 1, 2, 2, 3, 4, 5.0]), np.ones(7), 6.0, "increasing"),
        (np.arange(9.0), np.full(9, np.inf), 6.0, "finite"),
        (np.arange(9.0), np.ones(9), 0.0, "positive cutoff"),
        (np.arange(9.0), np.ones(9), "GCV", "positive cutoff"),
    ],
)
def test_wrong_arguments(time, values, smoothing, message):
    with pytest.raises(ValueError, match=message):
        smooth(time, values, smoothing)


def test_wrong_derivative():
    with pytest.raises(ValueError, match="0 to 4"):
        smooth(np.arange(9.0), np.ones(9), 0.1)(1.0, 5)


@pytest.mark.parametrize("cutoff", [8.0, 120.0])
@pytest.mark.parametrize("ragged", [0.0, 0.3])
def test_long_records_in_pieces_are_as_in_one(monkeypatch, cutoff, ragged):
    rng = np.random.default_rng(5)
    time = (np.arange(9000) + ragged * rng.uniform(-1.0, 1.0, 9000)) / 250.0
    values = rng.standard_normal((len(time), 2)).cumsum(axis=0)
    whole = smooth(time, values, cutoff)
    monkeypatch.setattr(smoothing, "_ROWS_AT_ONCE", 1000)
    parts = smooth(time, values, cutoff)
    assert_allclose(parts.sigma, whole.sigma, rtol=1e-9)
    for derivative, rounding in ((0, 1e-10), (2, 1e-7)):
        expected = whole(time, derivative)
        assert_allclose(parts(time, derivative), expected, atol=rounding * np.abs(expected).max())


def test_splines_through_long_records_are_as_in_one(monkeypatch):
    rng = np.random.default_rng(6)
    time = np.arange(3000) + 0.3 * rng.uniform(-1.0, 1.0, 3000)
    values = rng.standard_normal((len(time), 2))
    whole = smoothing._natural(time, values)
    monkeypatch.setattr(smoothing, "_ROWS_AT_ONCE", 700)
    parts = smoothing._natural(time, values)
    assert_allclose(parts.t, whole.t)
    assert_allclose(parts.c, whole.c, atol=1e-12 * np.abs(whole.c).max())
