"""What is stated, what files have, and which markers are not there."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.subject.body_data import absent_markers, population, stated_and_filed
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.trial.data import Markers, Recording
from people import person
from recordings import WALKS

MARKERS = Markers(np.array([0.0, 0.1]), ("A",), np.zeros((2, 1, 3)))
STATIC = Recording("static", MARKERS, mass_kg=60.0, height_m=1.7)


@pytest.mark.parametrize(("mass_kg", "trials"), [(60.5, []), (61.0, ["static"]), (59.0, ["static"])])
def test_a_stated_mass_that_a_file_contradicts(mass_kg, trials):
    found = list(stated_and_filed(person(static=STATIC, mass_kg=mass_kg, height_m=1.7)))
    assert [one.where.trial for one in found] == trials
    for one in found:
        assert (one.code, one.where.part) == ("S103", "mass")
        assert (one.evidence["stated"].value, one.evidence["filed"].value) == (mass_kg, 60.0)


def test_files_that_contradict_each_other():
    other = replace(STATIC, name="second", mass_kg=66.0)
    (found,) = stated_and_filed(person([other], STATIC, mass_kg=60.0, height_m=1.7))
    assert found.where.trial == "second"


def test_files_that_agree_are_one_finding():
    (found,) = stated_and_filed(person([replace(STATIC, name="second")], STATIC, mass_kg=66.0, height_m=1.7))
    assert (found.where.trial, found.evidence["files"].value) == (None, "static, second")


@pytest.mark.parametrize(
    ("stated_kg", "filed_kg", "severity"), [(72.6, 75.0, "INFO"), (75.0, 72.6, "WARNING"), (90.0, 95.0, "WARNING")]
)
def test_plates_that_confirm_the_stated_mass(recording_of, stated_kg, filed_kg, severity):
    """Whoever corrects a mass as S111 asks is not accused of the old one in the file."""
    walk = replace(recording_of(*WALKS["synthetic"]), mass_kg=filed_kg)
    marker_set = choose_marker_set(walk.markers.labels)
    (found,) = stated_and_filed(person([walk], None, marker_set, mass_kg=stated_kg))
    assert (found.code, found.severity.name) == ("S103", severity)


def test_a_population_that_the_tables_do_not_describe():
    assert list(population(person(mass_kg=70.0, height_m=1.75))) == []
    (found,) = population(person(mass_kg=110.0, height_m=1.75))
    assert (found.code, found.severity.name, found.evidence["population"].value) == ("S401", "WARNING", "obese")
    (found,) = population(person(mass_kg=110.0, height_m=1.75, population="obese"))
    assert found.severity.name == "INFO"


def test_markers_that_a_trial_lacks(recording_of):
    static, walk = recording_of("synthetic/static.trc"), recording_of("synthetic/walk.trc")
    marker_set = choose_marker_set(static.markers.labels)
    lost = walk.markers.labels[3]
    fewer = replace(walk, markers=walk.markers.select([one for one in walk.markers.labels if one != lost]))
    (whole,), (lacking,) = (list(absent_markers(person([one], static, marker_set))) for one in (walk, fewer))
    assert lacking.code == whole.code == "M105"
    assert set(lacking.where.markers) - set(whole.where.markers) == {lost}
