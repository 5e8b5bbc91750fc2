"""Sound files of wrong measurements: `kinertia fit` refuses them, and `kinertia check` says the same."""

import json
import re

import numpy as np
import pytest

from command_line import run
from kinertia.io.text.sto import read_sto, write_sto
from spoilt_lab import blocking_codes, changed_markers, complaint, expect_found, refused


def test_markers_swapped_for_the_whole_trial(lab):
    changed_markers(lab / "walk.trc", exchange("R.Heel", "L.Heel"))
    expect_found(refused(lab), "L202", {"trial": "walk", "markers": ["R.Heel", "L.Heel"]})


def exchange(label, other):
    def swap(positions, index):
        positions[:, [index(label), index(other)]] = positions[:, [index(other), index(label)]]

    return swap


def test_outer_and_inner_labels_swapped_in_the_static_trial(lab):
    outer, other = "L.Ankle.Lat", "L.Ankle.Med"
    changed_markers(lab / "static.trc", exchange(outer, other))
    expect_found(refused(lab), "L208", {"trial": "static", "markers": [outer, other]}, joint="left ankle")
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


def test_forces_that_do_not_belong_to_the_motion(lab):
    table = read_sto(lab / "walk.mot")
    table.loc[:, [name for name in table.columns if name.endswith("_vx")]] *= -1.0
    write_sto(lab / "walk.mot", table, False, "changed")
    where = {"trial": "walk", "axis": "fore-aft", "file_axis": "X"}
    expect_found(refused(lab), "P232", where, correlation=-0.94)
    assert_checked(lab, "P232")


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
