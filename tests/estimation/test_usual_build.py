"""The usual build and its spread, as they are fitted to a few people."""

import numpy as np
import pytest

from kinertia.estimation import body_measures
from kinertia.estimation.body_measures import measured_body
from kinertia.model.stadium_body import log_size, measures, usual_build
from stadium_people import SIZES, stadium_people
from validation.measured_data import find
from validation.usual_build import FILE, HEADER, fitted, read_people, stadium_mass_kg, stature_m, written

pytest.importorskip("yeadon", reason="needs yeadon (pip install -e '.[test]')")
NAMES = [measure.name for measure in measures()]
SAMPLES = "yeadon/samplemeasurements"
"""Folder of the package's five people among the measured data."""


def synthetic_people():
    measures_m = np.array([person.measures_m for person in stadium_people().values()])
    return measures_m, np.full(len(measures_m), np.nan)


def files_of_people(folder):
    """The same people in files such as the package's; the last one weighed."""
    for k, (name, person) in enumerate(stadium_people().items(), start=1):
        lines = ["# a person", "measurementconversionfactor: 0.01"]
        lines += [f"totalmass: {SIZES[name][0] if k == len(SIZES) else -1}"]
        lines += [f"{key}: {float(100.0 * value)!r}" for key, value in person.both.items()]
        (folder / f"{k}.txt").write_text("\n".join(lines), encoding="utf-8")


def test_people_are_read_from_the_packages_files(tmp_path):
    files_of_people(tmp_path)
    measures_m, mass_kg = read_people(tmp_path)
    np.testing.assert_allclose(measures_m, synthetic_people()[0], rtol=1e-12)
    np.testing.assert_array_equal(mass_kg, [np.nan] * 4 + [SIZES["Ed"][0]])


def test_people_of_one_shape_have_no_spread_but_their_size():
    shape = usual_build().log_shape
    same = np.exp([shape + log_size(60.0, 1.6), shape + log_size(80.0, 1.8)])
    height_m, mass_kg = stature_m(same), np.array([60.0, 80.0])
    np.testing.assert_allclose(height_m[1] / height_m[0], 1.8 / 1.6, rtol=1e-12)
    same *= np.exp(0.01 * np.random.default_rng(0).normal(size=same.shape))
    usual = fitted(same, mass_kg)
    off = usual.log_shape - shape + np.log(stature_m(same) / [1.6, 1.8]).mean() * (log_size(1.0, np.e) - log_size(1, 1))
    assert np.abs(off).max() < 0.03
    assert usual.log_sd.max() < 0.04


def test_slips_of_the_pen_count_as_not_measured():
    measures_m, _ = synthetic_people()
    wrong = measures_m.copy()
    width = NAMES.index("trunk_rib_width")
    wrong[2, width] *= 2.0
    sound, slipped = (
        fitted(sizes_m, np.array([size[0] for size in SIZES.values()])) for sizes_m in (measures_m, wrong)
    )
    others = np.delete(np.arange(len(NAMES)), width)
    np.testing.assert_array_equal(slipped.log_shape[others], sound.log_shape[others])
    assert slipped.log_shape[width] == pytest.approx(sound.log_shape[width], abs=0.05), "and not 0.14 more"


def test_the_figures_are_of_a_correlation():
    usual = usual_build()
    np.testing.assert_allclose(np.square(usual.common).sum(axis=1), 1.0, atol=1e-7)
    assert np.all((usual.log_sd > 0.01) & (usual.log_sd < 0.5))
    refitted = fitted(*synthetic_people())
    assert refitted.common.shape == usual.common.shape
    np.testing.assert_allclose(np.square(refitted.common).sum(axis=1), 1.0)


def test_the_file_is_what_is_written_of_its_figures():
    text = FILE.read_text(encoding="utf-8")
    assert text.startswith(HEADER)
    assert written(usual_build()) == text


@pytest.mark.measured
@pytest.mark.skipif(find(SAMPLES) is None, reason="need the five people of yeadon's source")
def test_the_file_is_of_the_five_people():
    of_people = fitted(*read_people(find(SAMPLES)))
    for name, values in vars(usual_build()).items():
        np.testing.assert_allclose(getattr(of_people, name), values, atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("source", ["synthetic", *([SAMPLES] if find(SAMPLES) else [])])
def test_people_are_expected_from_the_four_others_within_the_deviations(monkeypatch, source):
    """Lengths and girths that were not measured, by those that were, of somebody who is not among the people."""
    people, masses = synthetic_people() if source == "synthetic" else read_people(find(source))
    away = []
    try:
        for k, person in enumerate(people):
            rest = fitted(np.delete(people, k, axis=0), np.delete(masses, k))
            monkeypatch.setattr(body_measures, "usual_build", lambda rest=rest: rest)
            body_measures._shape_and_spread.cache_clear()
            predicted = body_measures._predicted(person, 0.08)
            lengths = {name: person[NAMES.index(name)] for name in ("leg_knee_length", "leg_ankle_length")}
            made = {measure.name: (person[j], measure.sd_m) for j, measure in enumerate(measures()) if measure.first}
            (height_m,) = stature_m(person[None])
            body = measured_body(made, lengths, 0.08, stadium_mass_kg(person), height_m)
            away.append((body.values - predicted).ravel() / np.sqrt(np.diag(body.covariance)))
    finally:
        body_measures._shape_and_spread.cache_clear()
    assert np.mean(np.abs(away) < 1.96) > 0.95
    assert np.mean(np.square(away)) < 1.0, "densities and cuts are the same here"
