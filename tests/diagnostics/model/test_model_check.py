from dataclasses import replace

import numpy as np
import pytest

import upright_model as upright
from kinertia.diagnostics.model.model_check import check_model
from kinertia.diagnostics.result.verdict import stands_against
from kinertia.errors import SubjectError
from kinertia.io.marker_set_file import choose_marker_set, read_marker_set
from kinertia.io.osim.exporter import export_osim
from kinertia.io.osim.reader import read_osim
from kinertia.io.recording import read_recording
from kinertia.model.anatomy import model_segments
from kinertia.model.anthropometry import SEGMENTS, literature_bsp
from kinertia.model.bsp import PARAMETERS, BodySegmentParameters
from kinertia.model.gait27 import build_gait27
from recordings import here

PERSON = (upright.MASS_KG, upright.HEIGHT_M, upright.SEX)


def check(bsp=None, arms=True, person=PERSON):
    return check_model(upright.skeleton(arms), upright.bsp(arms) if bsp is None else bsp, *person)


def changed(body, **values):
    """The model with some parameters of one body replaced."""
    bsp = upright.bsp()
    table = bsp.table()
    for name, value in values.items():
        table[bsp.segments.index(body), PARAMETERS.index(name)] = value
    return BodySegmentParameters.from_table(bsp.segments, table)


def sentences(model_check, level):
    return " | ".join(verdict.sentence for verdict in model_check.verdicts if verdict.level == level)


def test_dumas_own_model_has_nothing_against_it():
    model_check = check()
    assert {verdict.level for verdict in model_check.verdicts} == {"pass"}, model_check.verdicts
    assert model_check.left_out == ()
    rows = model_check.rows()
    assert [row[:2] for row in rows[:3]] == [("pelvis", "model"), ("", "de Leva"), ("", "Dumas")]
    for model, dumas in zip(rows[::3], rows[2::3], strict=True):
        assert model[2:] == dumas[2:]
    assert not any(row[0].endswith("_l") for row in rows)  # the right side stands for both
    assert dict(model_check.facts())["without mass"] == "toes_r, toes_l, hand_r, hand_l"


def test_what_is_not_known_of_the_person_is_left_out_and_said():
    model_check = check(person=(None, None, None))
    assert model_check.literature == {}
    assert "it needs --height and --sex" in model_check.left_out[0]
    assert "give --mass" in model_check.left_out[1]
    assert [row[0] for row in model_check.rows()] == list(upright.bsp().segments)
    assert "it needs --sex" in check(person=(75.0, 1.77, None)).left_out[0]
    own = check(person=(None, 1.77, "male"))
    assert own.literature
    assert own.rows()[0][2:] == check().rows()[0][2:]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"ixx": 0.5}, "femur_r: triangle inequality iyy + izz > ixx violated by"),
        ({"iyy": -0.01}, "femur_r: iyy is -0.01 kg m2, not positive"),
        ({"ixy": 0.15}, "femur_r: ixy, ixz, iyz are too large"),
        ({"mass": 0.0}, "femur_r: mass is 0 kg, not positive"),
    ],
)
def test_physically_impossible_is_against(change, words):
    model_check = check(changed("femur_r", **change))
    assert f"physically impossible: {words}" in sentences(model_check, "fail")


def test_without_thickness_is_only_okay():
    model_check = check(changed("talus_r", ixx=0.0001, iyy=0.0002, izz=0.0001, ixy=0, ixz=0, iyz=0))
    assert "without thickness" in sentences(model_check, "caution")
    assert "talus_r" in sentences(model_check, "caution")
    assert not stands_against(model_check.verdicts)


def test_unit_inertia():
    model_check = check(changed("talus_l", ixx=1, iyy=1, izz=1, ixy=0, ixz=0, iyz=0))
    assert "talus_l: " in sentences(model_check, "fail")
    assert "would have to be 2.1 m wide" in sentences(model_check, "fail")
    assert "three equal moments of inertia, as placeholders have: talus_l (1 kg m2)" in sentences(
        model_check, "caution"
    )


def test_mass_without_inertia(recwarn):
    """Of bodies that count it is against the model; and no ratio is made of two zeros."""
    bsp = upright.bsp()
    table = bsp.table()
    table[:, 4:] = 0.0
    model_check = check(BodySegmentParameters.from_table(bsp.segments, table))
    assert "mass without any moment of inertia: pelvis, torso, femur_r" in sentences(model_check, "fail")
    assert "physically possible" not in sentences(model_check, "pass")
    assert "without thickness" not in sentences(model_check, "caution")
    assert "nan" not in " ".join(verdict.sentence for verdict in model_check.verdicts)
    assert not recwarn.list


def test_mass_centres_in_millimetres_are_against():
    bsp = upright.bsp()
    model_check = check(replace(bsp, com_m=1000.0 * bsp.com_m))
    assert "the distance of the mass centre of body 'torso' from its joints" in sentences(model_check, "fail")
    assert "most likely mm or cm in place of m" in sentences(model_check, "fail")


def test_no_inertia_of_a_light_body_is_only_okay():
    none = dict.fromkeys(PARAMETERS[4:], 0.0)
    model_check = check(changed("talus_r", mass=0.1, **none))
    assert "mass without any moment of inertia: talus_r; light" in sentences(model_check, "caution")
    assert not stands_against(model_check.verdicts)


def test_inertia_too_small_for_the_mass():
    bsp = upright.bsp()
    torso = bsp.table()[bsp.segments.index("torso"), 4:] * 0.1
    cautions = sentences(check(changed("torso", **dict(zip(PARAMETERS[4:], torso, strict=True)))), "caution")
    assert "these bodies would have to be denser than water" in cautions
    assert "torso (" in cautions


@pytest.mark.parametrize(("values", "said"), [((0.0014, 0.0039, 0.0041), True), ((0.00141, 0.0039, 0.0041), False)])
def test_rounded_inertia(values, said):
    model_check = check(
        changed("talus_r", **dict(zip(("ixx", "iyy", "izz"), values, strict=True)), ixy=0, ixz=0, iyz=0)
    )
    assert ("rounded to two digits or less: talus_r" in sentences(model_check, "caution")) == said


@pytest.mark.parametrize(("mass_kg", "level"), [(75.5, "pass"), (78.0, "caution"), (60.0, "fail")])
def test_total_mass(mass_kg, level):
    assert f"the person {mass_kg:.1f} kg" in sentences(check(person=(mass_kg, 1.77, "male")), level)


def test_left_and_right():
    bsp = upright.bsp()
    mass = bsp.mass_kg[bsp.segments.index("tibia_r")]
    model_check = check(changed("tibia_r", mass=1.05 * mass, com_z=0.02))
    assert "left and right differ: tibia (mass by 5 %, centre of mass by" in sentences(model_check, "caution")
    assert not model_check.symmetric
    assert any(row[0] == "shank_l" for row in model_check.rows())


def test_segments_unlike_the_literature():
    bsp = upright.bsp()
    table = bsp.table()
    for side in "rl":
        i = bsp.segments.index(f"femur_{side}")
        table[i, [0, *range(4, 10)]] *= 2.5
    model_check = check(BodySegmentParameters.from_table(bsp.segments, table))
    cautions = sentences(model_check, "caution")
    assert "unlike the literature: thigh_r, thigh_l: mass " in cautions
    assert "shank" not in cautions


def test_torso_with_the_arms_inertia():
    """Rajagopal's torso, on this model; without arms as bodies it may."""
    bsp = changed("torso", mass=26.8266, ixx=1.4745, iyy=0.7555, izz=1.4314, ixy=0, ixz=0, iyz=0)
    assert "the torso still seems to include the arms' inertia" in sentences(check(bsp), "caution")
    kept = [name for name in bsp.segments if not name.startswith(("humerus", "ulna", "hand"))]
    bare = BodySegmentParameters.from_table(kept, [bsp.table()[bsp.segments.index(name)] for name in kept])
    assert "arms' inertia" not in sentences(check(bare, arms=False), "caution")


def test_without_arms_the_torso_weighs_torso_and_arms():
    bsp = upright.bsp(arms=False)
    whole = upright.bsp()
    mass = np.array(bsp.mass_kg)
    mass[bsp.segments.index("torso")] += whole.total_mass_kg - bsp.total_mass_kg
    model_check = check(replace(bsp, mass_kg=mass), arms=False)
    assert {verdict.level for verdict in model_check.verdicts} == {"pass"}
    assert "no arms" in model_check.left_out[-1]
    (torso,) = [k for k, row in enumerate(model_check.rows()) if row[0] == "torso"]
    assert model_check.rows()[torso + 2][3:] == ("-",) * 6


def test_a_person_who_cannot_be():
    with pytest.raises(SubjectError, match="centimetres"):
        check(person=(75.0, 177.0, "male"))
    with pytest.raises(SubjectError, match="sex"):
        check(person=(75.0, 1.77, "x"))


KNOWN = {
    "synthetic/scaled.osim": ((70.0, 1.803, "male"), False, "the bodies weigh 72.6 kg together"),
    "gait2354/subject01_scaled.osim": ((72.6, 1.803, "male"), False, "three equal moments of inertia"),
    "gait2354/gait2354_simbody.osim": ((), False, "rounded to two digits or less: calcn_r"),
    "rajagopal_walk/Rajagopal2016.osim": ((), True, "rounded to two digits or less: calcn_r"),
    "rajagopal_walk/scaled.osim": ((85.0, 1.83, "male"), True, "ixx 2.3426 kg m2 (literature 1.2"),
    "subject4/addbiomechanics_scaled.osim": ((60.0, 1.7, "female"), True, "the bodies weigh 62.6 kg together"),
}


@pytest.mark.parametrize("name", here(KNOWN))
def test_models_in_use(file_of, name):
    """None is impossible; those with arms carry them twice, which is known of them."""
    person, arms_twice, words = KNOWN[name]
    model = read_osim(file_of(name))
    model_check = check_model(model.skeleton, model.bsp, *person)
    assert not stands_against(model_check.verdicts)
    assert words in sentences(model_check, "caution")
    assert ("still seems to include the arms' inertia" in sentences(model_check, "caution")) == arms_twice


SCALED = {  # the static trial; how far the pelvis may be off, whose hips the model's scaling places otherwise
    "synthetic": ("synthetic/static.trc", (72.6, 1.803, "male"), 0.1),
    "gait2354/subject01_scaled.osim": ("gait2354/subject01_static.trc", (72.6, 1.80, "male"), 0.1),
    "rajagopal_walk/scaled.osim": ("rajagopal_walk/static_walk_1.trc", (85.0, 1.83, "male"), 0.3),
}


@pytest.fixture
def harringtons_model(file_of, tmp_path):
    """File of a synthetic person's model with the hips where a model's are taken to be: by Harrington, not Bell."""
    static, (mass_kg, *rest), _ = SCALED["synthetic"]
    model = build_gait27(read_recording(file_of(static)), read_marker_set("cleveland-clinic"), *rest, "harrington")
    export_osim(tmp_path / "scaled.osim", model.skeleton, literature_bsp(mass_kg, *rest, model.geometry))
    return tmp_path / "scaled.osim"


@pytest.mark.parametrize("source", ["deleva", "dumas"])
@pytest.mark.parametrize("name", ["synthetic", *here([name for name in SCALED if name != "synthetic"])])
def test_literature_for_the_trunk_is_the_one_of_a_fit(file_of, harringtons_model, name, source):
    """As `kinertia fit` has it by the markers of the static trial, whatever the model's lumbar joint."""
    trial, person, off = SCALED[name]
    static = read_recording(file_of(trial))
    hips = "harrington" if name == "synthetic" else "bell"
    own = build_gait27(static, choose_marker_set(static.markers.labels), *person[1:], hips).geometry
    model = read_osim(harringtons_model if name == "synthetic" else file_of(name))
    segments = model_segments(model.skeleton, model.bsp, *person[1:])
    bodies = [literature_bsp(*person, geometry, source).table() for geometry in (segments.geometry, own)]
    pelvis, torso = SEGMENTS.index("pelvis"), SEGMENTS.index("torso")
    assert bodies[0][pelvis, 4:7] == pytest.approx(bodies[1][pelvis, 4:7], rel=off)
    assert bodies[0][torso, 4:7] == pytest.approx(bodies[1][torso, 4:7], rel=0.1)


def test_pelvis_and_torso_do_not_hang_on_where_the_lumbar_joint_is():
    """Bodies that stay in place under a joint 7 cm higher are compared as before."""
    bsp, up = upright.bsp(), 0.07
    table = bsp.table()
    table[bsp.segments.index("torso"), 2] -= up
    moved = check_model(
        upright.skeleton(lumbar_up_m=up), BodySegmentParameters.from_table(bsp.segments, table), *PERSON
    )
    assert moved.rows()[:6] == check().rows()[:6]


def test_model_without_markers():
    bare = replace(upright.skeleton(), markers=())
    model_check = check_model(bare, upright.bsp(), *PERSON)
    assert "no markers in the model: kinertia fit refuses it" in sentences(model_check, "caution")
    assert not stands_against(model_check.verdicts)


def test_small_moments_have_digits():
    model_check = check(changed("talus_r", ixx=3.21e-5, iyy=4.32e-5, izz=0.00061), person=(None, None, None))
    (row,) = (row for row in model_check.rows() if row[0] == "talus_r")
    assert row[6:9] == ("3.2e-05", "4.3e-05", "0.00061")
