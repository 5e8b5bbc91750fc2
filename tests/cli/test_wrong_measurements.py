"""Sound files of wrong measurements: `kinertia fit` refuses them, and `kinertia check` says the same."""

import json
import re

import numpy as np
import pytest

from command_line import run
from kinertia.io.sto import read_sto, write_sto
from spoilt_lab import blocking_codes, changed_markers, complaint, expect_found, refused


@pytest.mark.parametrize(("one", "other"), [("R.ASIS", "L.ASIS"), ("R.Heel", "L.Heel")])
def test_markers_swapped_for_the_whole_trial(lab, one, other):
    changed_markers(lab / "walk.trc", exchange(one, other))
    expect_found(refused(lab), "L202", {"trial": "walk", "markers": [one, other]})


def test_markers_of_shanks_swapped_for_the_whole_trial(lab):
    """Of a cluster it is known on which segment each would fit."""
    changed_markers(lab / "walk.trc", exchange("R.Shank.Front", "L.Shank.Front"))
    refusal = refused(lab)
    expect_found(refusal, "L213", {"trial": "walk"})
    assert {one["evidence"]["better_segment"]["value"] for one in refusal.blocking} == {"right shank", "left shank"}
    markers = {label for found in refusal.blocking for label in found["where"]["markers"]}
    assert {"R.Shank.Front", "L.Shank.Front"} <= markers
    assert all(found["evidence"]["change_m"]["value"] > 0.2 for found in refusal.blocking)
    assert all(found["evidence"]["better_change_m"]["value"] < 0.002 for found in refusal.blocking)


def exchange(one, other):
    def swap(positions, index):
        positions[:, [index(one), index(other)]] = positions[:, [index(other), index(one)]]

    return swap


@pytest.mark.parametrize(
    ("one", "other", "joint"),
    [("R.Knee.Lat", "R.Knee.Med", "right knee"), ("L.Ankle.Lat", "L.Ankle.Med", "left ankle")],
)
def test_outer_and_inner_labels_swapped_in_the_static_trial(lab, one, other, joint):
    changed_markers(lab / "static.trc", exchange(one, other))
    expect_found(refused(lab), "L208", {"trial": "static", "markers": [one, other]}, joint=joint)
    assert_checked(lab, "L208")


def test_mirrored_axes(lab):
    for name in ("walk.trc", "static.trc"):
        changed_markers(lab / name, lambda positions, _: np.multiply(positions, [1, 1, -1], out=positions))
    refusal = refused(lab)
    expect_found(refusal, "L201")
    assert [found["where"]["trial"] for found in refusal.blocking] == ["static", "walk"]
    assert_checked(lab, "L201")


def test_static_trial_of_another_person(lab):
    changed_markers(lab / "static.trc", lambda positions, _: np.multiply(positions, 1.1, out=positions))
    expect_found(refused(lab), "S203", {"trial": "walk"}, ratio=1.0 / 1.1, reference="static trial")
    assert_checked(lab, "S203")


def test_spikes(lab):
    """Those around plate contact: 9 of 14."""

    def spike(positions, index):
        positions[5::20, index("R.Heel"), 1] += 0.3

    changed_markers(lab / "walk.trc", spike)
    expect_found(refused(lab), "M111", {"trial": "walk", "markers": ["R.Heel"]}, distance_m=0.3, frames=9)
    assert_checked(lab, "M111")


def changed_forces(path, change):
    table = read_sto(path)
    change(table)
    write_sto(path, table, False, "changed")


@pytest.mark.parametrize(
    ("columns", "factor", "code", "where", "evidence"),
    [
        ("_vx", -1.0, "P232", {"axis": "fore-aft", "file_axis": "X"}, {"correlation": -0.94}),
        ("_vz", -1.0, "P232", {"axis": "mediolateral", "file_axis": "Z"}, {"correlation": -0.99}),
        ("_v[xz]", -1.0, "P231", {"axis": None}, {"angle_rad": np.pi}),
    ],
)
def test_forces_that_do_not_belong_to_the_motion(lab, columns, factor, code, where, evidence):
    scale_forces(lab / "walk.mot", columns, factor)
    expect_found(refused(lab), code, {"trial": "walk", **where}, **evidence)
    assert_checked(lab, code)


def test_torques_in_newton_millimetres(lab):
    scale_forces(lab / "walk.mot", "torque", 1000.0)
    refusal = refused(lab)
    expect_found(refusal, "P203", {"trial": "walk"})
    arms = {found["where"]["plate"]: found["evidence"]["lever_arm_m"]["value"] for found in refusal.blocking}
    assert set(arms) == {"right", "left"}
    assert min(arms.values()) > 3.0
    assert_checked(lab, "P203")


def scale_forces(path, columns, factor):
    def change(table):
        table.loc[:, [name for name in table.columns if re.search(columns, name)]] *= factor

    changed_forces(path, change)


def assert_checked(lab, code):
    """`kinertia check` says it, too, and nothing else that is an error."""
    files = (lab / "walk.trc", lab / "walk.mot", lab / "static.trc", "--loads", lab / "walk.xml")
    outcome = run("check", *files, "--json")
    assert outcome.status == 1
    assert blocking_codes(json.loads(outcome.out)["findings"]) == [code]


@pytest.mark.slow
def test_a_declared_load_is_not_refused_and_told_apart_from_the_body(lab):
    """The plates carry 72.6 kg: a scale that said 64 kg has not weighed 8.6."""
    subject = lab / "subject.toml"
    subject.write_text(
        '[subject]\nsex = "male"\nmass_kg = 64.0\nheight_m = 1.803\n[model]\nstatic = "static.trc"\n'
        '[[trial]]\nmarkers = "walk.trc"\nforces = "walk.mot"\nloads = "walk.xml"\n'
    )
    refusal = complaint(lab, subject)
    expect_found(refusal, "S111", {"trial": "walk"}, mass_by_force_kg=72.4, stated_kg=64.0, action="[[]{2}attached")
    with subject.open("a") as file:
        file.write('[[attached]]\nname = "rucksack"\nsegment = "torso"\nmass_kg = "unknown"\non_scale = false\n')
        file.write("com_mm = [-150, 300, 0]\n")
    outcome = run("fit", subject, "-o", lab.parent / "out", "--table")
    assert outcome.status in (0, 1), outcome.err
    carried = re.search(r"total mass \(kg\): stated 64\.0, .*, ([\d.]+) of it not body", outcome.out)
    assert carried is not None
    assert abs(float(carried[1]) - 8.6) < 2.5
