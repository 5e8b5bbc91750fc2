"""Sound files of wrong measurements: `kinertia fit` refuses them, and `kinertia check` says the same."""

import re

import numpy as np
import pytest

from command_line import run
from kinertia.io.sto import read_sto, write_sto
from spoilt_lab import changed_markers, complaint, expect, refused


@pytest.mark.parametrize(
    ("one", "other"), [("R.ASIS", "L.ASIS"), ("R.Heel", "L.Heel"), ("R.Shank.Front", "L.Shank.Front")]
)
def test_markers_swapped_for_the_whole_trial(lab, one, other):
    def swap(positions, index):
        positions[:, [index(one), index(other)]] = positions[:, [index(other), index(one)]]

    changed_markers(lab / "walk.trc", swap)
    expect(refused(lab), "trial 'walk'", re.escape(one), re.escape(other), "labels")


@pytest.mark.parametrize(
    ("one", "other", "words"),
    [
        ("R.Knee.Lat", "R.Knee.Med", "outer marker of the right knee is on its inner side"),
        ("L.Ankle.Lat", "L.Ankle.Med", "outer marker of the left ankle is on its inner side"),
    ],
)
def test_outer_and_inner_labels_swapped_in_the_static_trial(lab, one, other, words):
    def swap(positions, index):
        positions[:, [index(one), index(other)]] = positions[:, [index(other), index(one)]]

    changed_markers(lab / "static.trc", swap)
    expect(refused(lab), "trial 'static'", words, re.escape(one), re.escape(other), "labels look swapped|look swapped")
    assert_checked(lab, words)


def test_mirrored_axes(lab):
    for name in ("walk.trc", "static.trc"):
        changed_markers(lab / name, lambda positions, _: np.multiply(positions, [1, 1, -1], out=positions))
    expect(refused(lab), "all left and right labels are swapped, or an axis of the laboratory is mirrored", "export")


def test_static_trial_of_another_person(lab):
    changed_markers(lab / "static.trc", lambda positions, _: np.multiply(positions, 1.1, out=positions))
    expect(refused(lab), "trial 'walk'", "9 % shorter than in the static trial", "another person")
    assert_checked(lab, "another person")


def test_spikes(lab):
    def spike(positions, index):
        positions[5::20, index("R.Heel"), 1] += 0.3

    changed_markers(lab / "walk.trc", spike)
    expect(refused(lab), "trial 'walk'", "spikes", r"R\.Heel", r"30\d mm", "delete")
    assert_checked(lab, "spikes")


def changed_forces(path, change):
    table = read_sto(path)
    change(table)
    write_sto(path, table, False, "changed")


@pytest.mark.parametrize(
    ("columns", "factor", "words"),
    [
        ("_vx", -1.0, "the horizontal force along X has the wrong sign"),
        ("_vz", -1.0, "the horizontal force along Z has the wrong sign"),
        ("_v[xz]", -1.0, "the forces are turned by 180 degrees about the vertical"),
        ("torque", 1000.0, "they are in N mm"),
    ],
)
def test_forces_that_do_not_belong_to_the_motion(lab, columns, factor, words):
    def change(table):
        table.loc[:, [name for name in table.columns if re.search(columns, name)]] *= factor

    changed_forces(lab / "walk.mot", change)
    expect(refused(lab), "trial 'walk'", words, "export")
    assert_checked(lab, words)


def assert_checked(lab, words):
    """`kinertia check` says it, too."""
    outcome = run("check", lab / "walk.trc", lab / "walk.mot", lab / "static.trc", "--loads", lab / "walk.xml")
    assert outcome.status == 1
    assert words in " ".join(outcome.out.split())


@pytest.mark.slow
def test_a_declared_load_is_not_refused_and_told_apart_from_the_body(lab):
    """The plates carry 72.6 kg: a scale that said 64 kg has not weighed 8.6."""
    subject = lab / "subject.toml"
    subject.write_text(
        '[subject]\nsex = "male"\nmass_kg = 64.0\nheight_m = 1.803\n[model]\nstatic = "static.trc"\n'
        '[[trial]]\nmarkers = "walk.trc"\nforces = "walk.mot"\nloads = "walk.xml"\n'
    )
    assert "was worn or carried that the scale did not weigh, give it as [[attached]]" in complaint(lab, subject)
    with subject.open("a") as file:
        file.write('[[attached]]\nname = "rucksack"\nsegment = "torso"\nmass_kg = "unknown"\non_scale = false\n')
        file.write("com_mm = [-150, 300, 0]\n")
    outcome = run("fit", subject, "-o", lab.parent / "out")
    assert outcome.status in (0, 1), outcome.err
    carried = re.search(r"total mass \(kg\): stated 64\.0, .*, ([\d.]+) of it not body", outcome.out)
    assert carried is not None
    assert abs(float(carried[1]) - 8.6) < 2.5
