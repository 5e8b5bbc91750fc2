from dataclasses import replace

import numpy as np
import pytest

import upright_model as upright
from kinertia.diagnostics.model.mass_table import check_model
from kinertia.errors import SubjectError
from kinertia.io.marker_set_file import choose_marker_set, read_marker_set
from kinertia.io.opensim.reader import read_osim
from kinertia.io.opensim.writer import export_osim
from kinertia.io.recording import read_recording
from kinertia.model.anatomy import model_segments
from kinertia.model.anthropometry import SEGMENTS, literature_bsp
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.gait27 import build_gait27
from recordings import here

PERSON = (upright.MASS_KG, upright.HEIGHT_M, upright.SEX)


def check(bsp=None, arms=True, person=PERSON):
    return check_model(upright.skeleton(arms), upright.bsp(arms) if bsp is None else bsp, *person)


def test_segments_beside_the_tables():
    model_check = check()
    assert model_check.symmetric
    rows = model_check.rows()
    assert [row[:2] for row in rows[:3]] == [("pelvis", "model"), ("", "de Leva"), ("", "Dumas")]
    for model, dumas in zip(rows[::3], rows[2::3], strict=True):
        assert model[2:] == dumas[2:]
    assert not any(row[0].endswith("_l") for row in rows)  # the right side stands for both
    assert dict(model_check.facts())["without mass"] == "toes_r, toes_l, hand_r, hand_l"


def test_bodies_where_the_person_is_not_known():
    model_check = check(person=(None, None, None))
    assert model_check.literature == {}
    assert [row[0] for row in model_check.rows()] == list(upright.bsp().segments)
    assert check(person=(75.0, 1.77, None)).literature == {}
    overruled = check(person=(None, 1.77, "male"))
    assert overruled.literature
    assert overruled.rows()[0][2:] == check().rows()[0][2:]


def test_left_and_right_are_shown_where_they_differ():
    bsp = upright.bsp()
    table = bsp.table()
    table[bsp.segments.index("tibia_r"), 0] *= 1.05
    model_check = check(BodySegmentParameters.from_table(bsp.segments, table))
    assert not model_check.symmetric
    assert any(row[0] == "shank_l" for row in model_check.rows())


def test_without_arms_the_torso_weighs_torso_and_arms():
    bsp = upright.bsp(arms=False)
    whole = upright.bsp()
    mass = np.array(bsp.mass_kg)
    mass[bsp.segments.index("torso")] += whole.total_mass_kg - bsp.total_mass_kg
    model_check = check(replace(bsp, mass_kg=mass), arms=False)
    (torso,) = [k for k, row in enumerate(model_check.rows()) if row[0] == "torso"]
    assert model_check.rows()[torso + 2][3:] == ("-",) * 6


def test_a_person_who_cannot_be():
    with pytest.raises(SubjectError, match=r"S102 .*centimetres"):
        check(person=(75.0, 177.0, "male"))
    with pytest.raises(SubjectError, match="S102"):
        check(person=(75.0, 1.77, "x"))


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
    built = build_gait27(static, choose_marker_set(static.markers.labels), *person[1:], hips).geometry
    model = read_osim(harringtons_model if name == "synthetic" else file_of(name))
    segments = model_segments(model.skeleton, model.bsp, *person[1:])
    bodies = [literature_bsp(*person, geometry, source).table() for geometry in (segments.geometry, built)]
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


def test_small_moments_have_digits():
    bsp = upright.bsp()
    table = bsp.table()
    table[bsp.segments.index("talus_r"), 4:7] = 3.21e-5, 4.32e-5, 0.00061
    model_check = check(BodySegmentParameters.from_table(bsp.segments, table), person=(None, None, None))
    (row,) = (row for row in model_check.rows() if row[0] == "talus_r")
    assert row[6:9] == ("3.2e-05", "4.3e-05", "0.00061")
