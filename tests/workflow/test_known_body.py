"""What a laboratory knows of a body moves the prior as a measurement does, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from kinertia.errors import PriorError
from kinertia.estimation.learnt_prior import LearntPrior
from kinertia.estimation.prepared import Prepared
from kinertia.estimation.prior import literature_prior
from kinertia.estimation.simultaneous.instruments.priors import GAIT27_UNCERTAINTY
from kinertia.io.subject.body_files import BspTable
from kinertia.model.bsp import PARAMETERS
from kinertia.settings import KnownSegment, PriorSettings
from kinertia.synthetic.walk import walking_subject
from kinertia.workflow.estimate import named_by_source
from kinertia.workflow.known_body import KnownBody


@pytest.fixture
def ready():
    """As much of a prepared person as is looked at."""
    literature = walking_subject().literature
    prior = literature_prior(literature)
    return Prepared(None, None, None, literature, prior, None, None, (), (), (), ())


def sources(ready):
    """What the prior also uses."""
    return [finding.evidence["source"].value for finding in ready.findings if finding.code == "S408"]


def informed(ready, settings=None, earlier=None, **segments):
    body = KnownBody(settings or PriorSettings(), earlier, segments)
    return body.measured_on(body.leaned_on(ready)[0])


def test_warnings_name_the_prior_where_more_is_known(ready):
    ready = replace(ready, uncertainty=GAIT27_UNCERTAINTY)
    assert named_by_source(ready).source == "the literature"
    known = informed(ready, thigh_r=KnownSegment(mass_kg="9 +- 0.3"))
    assert named_by_source(known).source == "the prior"
    alike = informed(ready, PriorSettings(sides_correlation=0.5))
    assert named_by_source(alike).source == "the literature", "the mean is the same"


def test_a_measured_mass_weighs_by_how_well_it_is_known(ready):
    before = ready.prior
    row = before.mean.segments.index("thigh_r")
    expected, sd = before.mean.mass_kg[row], before.sd[row, 0]
    after = informed(ready, thigh_r=KnownSegment(mass_kg=f"{expected + sd} +- {sd}", source="DXA"))
    assert after.prior.mean.mass_kg[row] == pytest.approx(expected + sd / 2)
    assert after.prior.sd[row, 0] == pytest.approx(sd / np.sqrt(2.0))
    (source,) = sources(after)
    assert "thigh_r mass" in source
    assert "DXA" in source
    assert [finding.code for finding in after.findings] == ["S408"]
    left = before.mean.segments.index("thigh_l")
    moved = after.prior.mean.mass_kg[left] - before.mean.mass_kg[left]
    assert moved == pytest.approx(0.9 * sd / 2)


def test_several_measurements_are_those_of_the_information_form(ready):
    """Inverse covariances add up."""
    known = KnownSegment(mass_kg="9 +- 0.3", com_y_mm="-180 +- 5", ixx_kgm2="0.15 +- 0.02")
    after = informed(ready, thigh_r=known, torso=KnownSegment(mass_kg="30 +- 1"))
    before, segments = ready.prior, ready.prior.mean.segments
    at = [10 * segments.index("thigh_r") + PARAMETERS.index(name) for name in ("mass", "com_y", "ixx")]
    at.append(10 * segments.index("torso"))
    information, right = (
        np.linalg.inv(before.covariance),
        np.linalg.solve(before.covariance, before.mean.table().ravel()),
    )
    for k, value, sd in zip(at, (9.0, -0.18, 0.15, 30.0), (0.3, 0.005, 0.02, 1.0), strict=True):
        information[k, k] += 1.0 / sd**2
        right[k] += value / sd**2
    covariance = np.linalg.inv(information)
    np.testing.assert_allclose(after.prior.covariance, covariance, atol=1e-9 * np.abs(covariance).max())
    np.testing.assert_allclose(after.prior.mean.table().ravel(), covariance @ right, atol=1e-9)


def test_a_value_far_from_the_tables_is_warned_about(ready):
    """Grams for kilograms."""
    after = informed(ready, foot_r=KnownSegment(mass_kg="900 +- 10"))
    (found,) = [finding for finding in after.findings if finding.code == "S402"]
    assert (found.severity.name, found.where.part, found.evidence["stated"].value) == ("WARNING", "foot_r mass", 900.0)
    expected = ready.prior.mean.mass_kg[ready.prior.mean.segments.index("foot_r")]
    assert found.evidence["expected"].value == pytest.approx(expected)
    assert found.evidence["distance_sd"].value > 80.0


def test_an_earlier_estimate_takes_the_place_of_the_literature(ready):
    prior = ready.prior
    order = tuple(reversed(prior.mean.segments))
    rows = [prior.mean.segments.index(name) for name in order]
    earlier = BspTable("bsp.csv", order, 1.1 * prior.mean.table()[rows], 0.5 * prior.sd[rows])
    after = informed(ready, earlier=earlier)
    np.testing.assert_allclose(after.prior.mean.table(), 1.1 * prior.mean.table())
    np.testing.assert_allclose(after.prior.covariance, 0.25 * prior.covariance)
    other = replace(earlier, segments=("femur_r", *order[1:]))
    with pytest.raises(PriorError, match=f"has no {order[0]}.*femur_r.*another model"):
        informed(ready, earlier=other)


def test_what_an_earlier_estimate_held_is_as_it_was(ready):
    prior, held = ready.prior, np.arange(12)[:, None] == 4
    sd = np.where(held, 0.0, 0.5 * prior.sd)
    after = informed(ready, earlier=BspTable("bsp.csv", prior.mean.segments, 1.1 * prior.mean.table(), sd)).prior
    np.testing.assert_allclose(after.sd, np.where(held, 1.0, 0.5) * prior.sd)
    np.testing.assert_allclose(after.mean.table(), np.where(held, 1.0, 1.1) * prior.mean.table())


def test_a_group_is_of_the_built_in_model(ready):
    """Nothing is learnt from fits with OpenSim models, so that no other group could help."""
    size = len(ready.prior.covariance)
    group = LearntPrior(ready.prior.mean.segments, np.zeros(size), np.ones(size), np.eye(size), 12)
    with pytest.raises(PriorError, match="is for the built-in model; OpenSim models have other segments"):
        KnownBody(PriorSettings(), group=group).leaned_on(replace(ready, file=object()))


def test_sides_and_masses(ready):
    alone = informed(ready, PriorSettings(sides_correlation=0.0))
    right, left = (10 * ready.prior.mean.segments.index(f"shank_{side}") for side in "rl")
    assert not alone.prior.covariance[right : right + 10, left : left + 10].any()
    np.testing.assert_allclose(alone.prior.sd, ready.prior.sd)
    kept = informed(ready, PriorSettings(masses_kept=True))
    np.testing.assert_allclose(kept.prior.mean.mass_kg, ready.prior.mean.mass_kg)
    assert (kept.prior.sd[:, 0] < 2e-3 * ready.prior.sd[:, 0]).all()


def test_an_unknown_segment_is_told_with_those_that_there_are(ready):
    with pytest.raises(PriorError, match=r"\[segment.femur_r\].*no such segment; it has pelvis, "):
        informed(ready, femur_r=KnownSegment(mass_kg="9 +- 1"))


@pytest.mark.parametrize("key", ["mass_kg", "ixx_kgm2"])
def test_masses_and_moments_of_inertia_are_above_zero(key):
    with pytest.raises(ValidationError, match="must be above zero"):
        KnownSegment(**{key: "-8.9 +- 0.4"})
    assert KnownSegment(com_y_mm="-189 +- 4").com_y_mm == (-189.0, 4.0)
