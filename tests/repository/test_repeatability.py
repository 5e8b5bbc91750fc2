"""Sums over trials of one session, checked by hand."""

import json
from dataclasses import asdict

import pytest

from kinertia.estimation.simultaneous.instruments.instrument_errors import CalibrationEntry
from validation import sessions
from validation.repeatability import Estimate, Shared, group_sums, shared, weighted_mean


def of_values(*values, sd=1.0, prior_sd=2.0, group="delay"):
    estimates = tuple(Estimate(f"t{k}", value, sd, prior_sd) for k, value in enumerate(values))
    return Shared("synchronisation: delay", group, "s", estimates)


def folder(parent, name, delay_s, mass_kg):
    path = parent / name
    path.mkdir()
    late = {"value": delay_s, "prior_sd": 0.002, "sd": 0.001, "unit": "s", "moved": 3.0}
    delay = CalibrationEntry(kind="synchronisation", quantity="delay", **late)
    moved = {"axis": "x", "value": 0.0, "prior_sd": 0.01, "sd": 0.005, "unit": "m"}
    joint = CalibrationEntry(kind="joint", joint="hip_r", quantity="centre change", **moved)
    (path / "fit.json").write_text(json.dumps({"calibration": [asdict(delay), asdict(joint)]}))
    rows = ["segment,parameter,estimate,prior_sd,sd", f"femur_r,mass,{mass_kg},1.0,0.5", "femur_r,ixy,0.0,1.0,0.5"]
    (path / "bsp.csv").write_text("\n".join([*rows, "talus_r,mass,0.1,,"]))
    return path


def test_chi2_is_about_the_weighted_mean():
    unknown = Shared("a", "mass", "kg", (Estimate("a", 0.0, 1.0, 9.0), Estimate("b", 3.0, 2.0, 9.0)))
    assert weighted_mean(unknown.estimates) == pytest.approx((0.6, (4 / 5) ** 0.5))
    assert unknown.chi2 == pytest.approx(0.6**2 + 1.2**2)
    assert not unknown.beyond
    assert unknown.apart == [False]


def test_far_values_are_beyond_and_apart():
    unknown = of_values(0.0, 0.0, 6.0)
    assert unknown.beyond
    assert unknown.apart == [False, True, True]


@pytest.mark.parametrize(("values", "accused"), [((5.0, 5.0), [False, False]), ((5.0, 0.0), [True]), ((3.0, -3.0), [])])
def test_who_accuses_and_who_is_contradicted(values, accused):
    assert [wrong for _, wrong in of_values(*values).accusations()] == accused


def test_joints_and_bodies_accuse_nothing():
    assert not list(of_values(9.0, 0.0, group="joint").accusations())


def test_folders_of_results(tmp_path):
    folders = [folder(tmp_path, name, delay_s, 8.0) for name, delay_s in (("a", 0.005), ("b", 0.0))]
    sums = group_sums(shared(folders))
    assert {group: agreement.unknowns for group, agreement in sums.items()} == {"delay": 1, "joint": 1, "mass": 1}
    assert sums["delay"].worst == pytest.approx(12.5)
    assert sums["delay"].beyond == 1
    assert sums["delay"].pairs_apart == 1.0
    assert sums["joint"].median_sd == 0.005
    assert set(group_sums(shared(folders, instruments_only=True))) == {"delay"}
    page = sessions.compared(shared(folders))
    assert "deviation: 1; contradicted by the other trials: 1." in page
    assert "the fits say to check the instrument: 1; contradicted: 1." in page


def test_results_that_are_there_are_used_again(tmp_path):
    session = sessions.Session("s", "S", "nowhere", {"": ("a",)}, "--mass 60")
    (tmp_path / "s").mkdir()
    (tmp_path / "s" / "a.json").write_text(json.dumps({"said": "error: /x/y/a.trc: no file"}))
    outcome = sessions.fitted(session, "", "a", tmp_path, tmp_path)
    assert outcome.said == "error: a.trc: no file"
