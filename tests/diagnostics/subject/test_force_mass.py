"""A person whose mass is known walks (synthetic): what do forces and markers alone say of it?"""

import re
from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.subject.force_mass import check_force_masses, check_masses, force_mass, unit_hint
from kinertia.errors import TrialError
from kinertia.estimation.carried_mass import CarriedMass
from kinertia.synthetic.walk import walk, walking_subject
from kinertia.trial.data import FootLoads, Trial


@pytest.fixture(scope="module")
def made():
    return walk(walking_subject(), 1.2)


def trial(made, force=lambda time, force: force, name="walk") -> Trial:
    loads = np.array(made.foot_loads)
    loads[..., :3] = force(made.time[:, None, None], loads[..., :3])
    return Trial(
        name, made.markers, FootLoads(made.time, loads[..., :3], loads[..., 3:]), np.ones(len(made.time), bool)
    )


def test_it_is_the_mass_of_the_body(made):
    mass = force_mass(made.skeleton, trial(made))
    assert mass.mass_kg == pytest.approx(made.bsp.total_mass_kg, abs=2 * mass.sd_kg)
    assert 0.005 < mass.sd_kg / mass.mass_kg < 0.03
    np.testing.assert_allclose(mass.carried, mass.mass_kg, rtol=0.15)


def test_no_motion_of_ours_is_asked(made):
    """Markers of which no pose makes sense say the same as long as their centre moves as it does."""
    turned = replace(made.markers, positions=made.markers.positions[:, :, [2, 1, 0]])
    fine, odd = (force_mass(made.skeleton, replace(trial(made), markers=one)) for one in (made.markers, turned))
    assert odd.mass_kg == pytest.approx(fine.mass_kg, rel=1e-9)


def test_gaps_change_little(made):
    positions = made.markers.positions.copy()
    positions[::7] = np.nan
    mass = force_mass(made.skeleton, replace(trial(made), markers=replace(made.markers, positions=positions)))
    assert mass.mass_kg == pytest.approx(force_mass(made.skeleton, trial(made)).mass_kg, rel=0.01)


def said(made, force) -> str:
    with pytest.raises(TrialError, match="the vertical force corresponds to") as caught:
        check_force_masses(made.skeleton, CarriedMass.of(made.bsp.total_mass_kg, ()), [trial(made, force)])
    return str(caught.value)


def test_each_cause_is_told_by_its_evidence_and_none_is_accused_without(made):
    check_force_masses(made.skeleton, CarriedMass.of(made.bsp.total_mass_kg, ()), [trial(made)])
    gain = said(made, lambda time, force: 0.75 * force)
    chair = said(made, lambda time, force: force - np.array([0.0, 100.0, 0.0]))
    for text in (gain, chair):
        assert "missing nearly all the time" in text
        assert "correct the mass, or the gain" in text
        assert "a chair, a handrail, a walker, crutches" in text
        assert "gain and zero" in text
    hand = said(made, lambda time, force: force * np.where((time > 0.5) & (time < 0.9), 0.4, 1.0))
    assert "from 0.5" in hand
    assert "not measured was stood, sat or leant on" in hand
    assert "gain" not in hand
    heavy = said(made, lambda time, force: 1.3 * force)
    assert "units of the plates" in heavy
    assert "chair" not in heavy


def test_a_chair_is_told_though_the_mean_force_hardly_shows_it(made):
    carried = CarriedMass.of(made.bsp.total_mass_kg, ())
    middle = made.time[0] + np.ptp(made.time) / 2

    def sitting(for_s):
        seat = np.clip(1.5 * for_s / 2 - np.abs(made.time - middle), 0, for_s / 2) / (for_s / 2)
        return trial(made, lambda time, force: force * (1.0 - 0.6 * seat[:, None, None]))

    sat = force_mass(made.skeleton, sitting(0.35))
    said = sat.lost_for_a_while(carried)
    begins, ends = (float(word) for word in re.search(r"from (\S+) to (\S+) s", said).groups())
    assert begins < middle < ends
    assert ends - begins == pytest.approx(0.35, abs=0.15)
    assert "something that is not measured was stood, sat or leant on" in said
    assert force_mass(made.skeleton, trial(made)).lost_for_a_while(carried) == ""
    gain = trial(made, lambda time, force: 0.7 * force)
    assert force_mass(made.skeleton, gain).lost_for_a_while(carried) == "", "all the time is not for a while"


def test_trials_of_different_masses_are_not_pooled(made):
    light, heavy = (
        force_mass(made.skeleton, trial(made, lambda time, force, k=k: k * force, name))
        for name, k in (("a", 0.93), ("b", 1.09))
    )
    check_masses(CarriedMass.of(made.bsp.total_mass_kg, ()), [light])
    check_masses(CarriedMass.of(made.bsp.total_mass_kg, ()), [heavy])
    with pytest.raises(TrialError, match=r"trial 'b'.*kg, in 'a' .*kg; pool only trials of one person"):
        check_masses(CarriedMass.of(made.bsp.total_mass_kg, ()), [light, heavy])


def test_too_short_a_window_says_nothing(made):
    short = replace(trial(made), measured=np.arange(len(made.time)) < 8)
    assert force_mass(made.skeleton, short) is None


@pytest.mark.parametrize(
    ("by_force", "stated", "words"),
    [
        (72.6 / 9.81, 72.6, "the forces look to be in kg"),
        (72.0, 72.6 / 0.4536, "the stated mass looks to be in pounds"),
        (0.0726, 72.6, "in kN"),
        (72.6 * 0.2248, 72.6, "in pounds-force"),
        (66.0, 72.6, ""),
        (50.0, 72.6, ""),
        (100.0, 72.6, ""),
    ],
)
def test_units_are_told_from_people(by_force, stated, words):
    assert words in unit_hint(by_force, stated)
    assert bool(unit_hint(by_force, stated)) == bool(words)
