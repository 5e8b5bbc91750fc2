import numpy as np
import pytest

from kinertia.estimation.simultaneous.search.omitted_unknowns import with_left_out


@pytest.mark.parametrize("count", [1, 2])
def test_they_are_more_unknowns_of_the_estimate(count):
    """Against the whole problem: data on x + D z, priors on x and z."""
    rng = np.random.default_rng(104)
    root, prior = rng.normal(size=(6, 4)), np.diag([1.0, 4.0, 2.0, 0.5])
    directions, measured = rng.normal(size=(4, count)), rng.normal(size=6)
    data = root.T @ root
    covariance = np.linalg.inv(prior + data)
    estimate = covariance @ root.T @ measured
    moved, more = with_left_out(directions, data @ directions, directions.T @ prior @ estimate, covariance)

    rows, apart = np.hstack([root, root @ directions]), np.zeros((4, count))
    whole = np.linalg.inv(rows.T @ rows + np.block([[prior, apart], [apart.T, np.eye(count)]]))
    np.testing.assert_allclose(estimate + moved, (whole @ rows.T @ measured)[:4], atol=1e-12)
    np.testing.assert_allclose(covariance + more @ more.T, whole[:4, :4], atol=1e-12)


def test_priors_that_are_next_to_exact_leave_nothing_negative():
    """As where body segment parameters are held: what the data would say of them is lost in rounding."""
    rng = np.random.default_rng(7)
    root, directions = rng.normal(size=(6, 4)) * 1e9, rng.normal(size=(4, 2))
    data = root.T @ root
    covariance = np.linalg.inv(data) * (1.0 + 1e-9)
    moved, more = with_left_out(directions, data @ directions, np.ones(2), covariance)
    assert np.isfinite(moved).all()
    assert np.isfinite(more).all()
