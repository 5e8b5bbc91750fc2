"""Yeadon's body in the built-in model's segments, against the package that made the solids."""

import numpy as np
import pytest

from kinertia.errors import PriorError
from kinertia.model.bsp import combine
from kinertia.model.stadium_body import DENSITY_KG_M3, KINDS, measures, stadium_bsp
from stadium_people import stadium_people

yeadon = pytest.importorskip("yeadon", reason="needs yeadon (pip install -e '.[test]')")
NAMES = tuple(stadium_people())
CUT_M = 0.08


def package_person(name):
    """The person as the package makes one of all 95 measurements."""
    values = stadium_people()[name].both
    assert len(values) == 95
    return yeadon.Human(dict(values))


def own_person(name):
    return stadium_people()[name].measures_m


def in_package_axes(bsp, kind, upright=True):
    """Mass, centre and tensor of a segment, x to the left, y backwards, z up; of the foot as it points."""
    row = bsp.segments.index(kind)
    right, up, back = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]), np.array([-1.0, 0.0, 0.0])
    axes = np.array([-right, back, up] if upright else [-right, -up, back])
    return bsp.mass_kg[row], axes @ bsp.com_m[row], axes @ bsp.inertia_kgm2[row] @ axes.T


@pytest.mark.filterwarnings("ignore:Stadium")
@pytest.mark.parametrize("name", NAMES)
def test_every_segment_is_the_packages_own(name):
    human, bsp = package_person(name), stadium_bsp(own_person(name), CUT_M)
    for kind, segment in (("upper_arm_r", human.A1), ("forearm_r", human.B2), ("thigh_r", human.K1)):
        mass, com, inertia = in_package_axes(bsp, kind)
        assert mass == pytest.approx(segment.mass, abs=1e-9)
        np.testing.assert_allclose(com, segment.rel_center_of_mass.ravel(), atol=1e-9)
        np.testing.assert_allclose(inertia, segment.rel_inertia, atol=1e-9)
    ankle = float(human.J2.solids[1].pos[2, 0])
    knee = float(human.J2.pos[2, 0])
    for kind, solids, top in (("shank_r", ["j3", "j4"], knee), ("foot_r", ["j5", "j6", "j7", "j8"], ankle)):
        expected, place, tensor = human.combine_inertia(solids)
        mass, com, inertia = in_package_axes(bsp, kind, upright=kind != "foot_r")
        assert mass == pytest.approx(expected, abs=1e-9)
        np.testing.assert_allclose(com, [0.0, 0.0, place[2, 0] - top], atol=1e-9)
        np.testing.assert_allclose(inertia, tensor, atol=1e-9)
    whole = bsp.mass_kg @ [2.0 if kind.endswith("_r") else 1.0 for kind in KINDS]
    assert whole == pytest.approx(human.mass, abs=1e-9)


@pytest.mark.filterwarnings("ignore:Stadium")
@pytest.mark.parametrize("name", NAMES)
def test_pelvis_and_torso_are_the_packages_trunk_wherever_it_is_cut(name):
    human = package_person(name)
    mass, place, tensor = human.combine_inertia(["P", "T", "C"])
    for cut_m in (0.03, CUT_M, 0.1234, human.meas["Ls2L"]):
        bsp = stadium_bsp(own_person(name), cut_m)
        parts = [in_package_axes(bsp, kind) for kind in ("pelvis", "torso")]
        masses, centres, tensors = (np.array(column) for column in zip(*parts, strict=True))
        centres[1, 2] += cut_m
        whole = combine(masses, centres, tensors)
        assert whole[0] == pytest.approx(mass, abs=1e-9)
        np.testing.assert_allclose(whole[1], place.ravel(), atol=1e-9)
        np.testing.assert_allclose(whole[2], tensor, atol=1e-9)
    pelvis = in_package_axes(bsp, "pelvis")
    assert pelvis[0] == pytest.approx(human.P.mass, abs=1e-9), "cut where the package ends its pelvis"
    np.testing.assert_allclose(pelvis[2], human.P.rel_inertia, atol=1e-9)


def test_densities_are_ours_whatever_becomes_of_the_packages(monkeypatch):
    """The package rescales the densities of all its people when one was weighed."""
    before = stadium_bsp(own_person("Dan"), CUT_M)
    doubled = {name: 2.0 * value for name, value in yeadon.Human.segmental_densities["Dempster"].items()}
    monkeypatch.setitem(yeadon.Human.segmental_densities, "Dempster", doubled)
    np.testing.assert_allclose(stadium_bsp(own_person("Dan"), CUT_M).table(), before.table(), rtol=1e-12)
    heavy = stadium_bsp(own_person("Dan"), CUT_M, {**DENSITY_KG_M3, "thigh": 2.0 * DENSITY_KG_M3["thigh"]})
    changed = heavy.table() / np.where(before.table() == 0.0, 1.0, before.table())
    row = KINDS.index("thigh_r")
    np.testing.assert_allclose(changed[row, [0, 2, 4, 5, 6]], [2.0, 1.0, 2.0, 2.0, 2.0])
    assert np.all(np.isclose(np.delete(changed, row, axis=0), 1.0) | (np.delete(changed, row, axis=0) == 0.0))


def test_a_body_that_cannot_be_is_refused():
    with pytest.raises(PriorError) as caught:
        stadium_bsp(own_person("Dan"), 0.9)
    assert (caught.value.finding.code, caught.value.finding.evidence["value_m"].value) == ("S403", 0.9)
    shuffled = own_person("Dan").copy()
    shuffled[[measure.name for measure in measures()].index("leg_calf_length")] = 0.2
    with pytest.raises(PriorError) as caught:
        stadium_bsp(shuffled, CUT_M)
    assert caught.value.finding.code == "S403"
    assert caught.value.finding.where.part == "the level after 'knee joint centre'"
    assert caught.value.finding.evidence["value_m"].value < 0.0
