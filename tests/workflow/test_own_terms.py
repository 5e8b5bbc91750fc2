"""A cost term of one's own, written after the page about the architecture: a thigh that was weighed."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.errors import SettingsError
from kinertia.estimation.simultaneous.inputs import BSP
from kinertia.estimation.simultaneous.terms.cost_term import CostTerm
from kinertia.settings import Settings, Subject
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.estimate import estimate
from kinertia.workflow.person import Person
from kinertia.workflow.prepare import prepare

HEAVIER, SD_KG = 1.1, 0.02


class WeighedThigh(CostTerm):
    """The mass of the right thigh is a tenth above the tables', and known to 20 g."""

    def __init__(self, model):
        super().__init__(model)
        mean = self.given.prior.mean
        thigh = mean.segments.index("thigh_r")
        self._at = self.layout[BSP].start + 10 * thigh  # the logarithm of the mass
        self._stated = HEAVIER * mean.mass_kg[thigh]

    def add_information(self, into, static):
        into[self._at, self._at] += (np.exp(static[self._at]) / SD_KG) ** 2

    def add_pull(self, rhs, static):
        mass = np.exp(static[self._at])
        gap = (mass - self._stated) / SD_KG
        rhs[self._at] -= gap * mass / SD_KG
        return gap**2


@pytest.fixture(scope="module")
def ready(recording_of):
    walk, static = (recording_of(f"synthetic/{kind}.c3d") for kind in ("walk", "static"))
    return prepare(Person(Subject(name="A", sex="male"), [TrialInput(walk, (1.2, 1.7), 0.25)], static))


def thighs(fit):
    rows = [fit.estimate.segments.index(f"thigh_{side}") for side in "rl"]
    return fit.estimate.mass_kg[rows], fit.posterior.sd[rows, 0], fit.literature.mass_kg[rows]


def test_it_takes_part_in_the_estimate(ready):
    (before, _), (sd_before, _), (table, _) = thighs(estimate(ready))
    (after, left), (sd_after, left_sd), _ = thighs(estimate(ready, terms=[WeighedThigh]))
    assert abs(before - HEAVIER * table) > 10 * SD_KG
    assert after == pytest.approx(HEAVIER * table, abs=2 * SD_KG)
    assert sd_after < 1.05 * SD_KG < 0.2 * sd_before
    assert left_sd > 2 * SD_KG, "only the right one was weighed"
    assert left > before, "right and left are correlated in the prior"


def test_the_studys_method_has_no_terms(ready):
    with pytest.raises(SettingsError) as caught:
        estimate(replace(ready, settings=Settings(method="two-level")), terms=[WeighedThigh])
    assert caught.value.finding.evidence["entry"].value == "method"
