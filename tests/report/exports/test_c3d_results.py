"""Results in C3D files, and Plug-in Gait's own outputs as the oracle of signs."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

import kinertia
from command_line import fitted, run
from kinertia.errors import FileError
from kinertia.estimation.result.leg_moments import outputs_of
from kinertia.io.c3d.outputs import frames_of
from kinertia.motion.joint_moments import joint_wrenches
from kinertia.motion.smoothing import smooth
from kinertia.report.exports.c3d_results import c3d_with_results, prefix_of, to_file, usual_convention
from kinertia.report.exports.saved_fit import load_fit
from recordings import is_here
from validation import walks
from validation.measured_data import find

ezc3d = pytest.importorskip("ezc3d")


def points_of(path):
    """Every point (3, f) of a file by its label."""
    file = ezc3d.c3d(str(path))
    groups = file["parameters"]["POINT"]
    labels = [label for name in ("LABELS", "LABELS2", "LABELS3") if name in groups for label in groups[name]["value"]]
    return dict(zip(labels, np.moveaxis(file["data"]["points"][:3], 1, 0), strict=True)), file


def expect_outputs(path, fit, suffix=""):
    """The file of the fit's only trial holds its outputs, and nothing outside its frames."""
    points, file = points_of(path)
    (trial,) = fit.trials
    header = file["header"]["points"]
    at = (trial.joint_curves.time * header["frame_rate"]).round().astype(int) - header["first_frame"]
    outside = np.setdiff1d(np.arange(file["data"]["points"].shape[2]), at)
    outputs = outputs_of(fit, trial, usual_convention(fit))
    assert len(outputs) == 28
    # what a hinge transmits has a standard deviation, too, and a leg is known longer than both are
    knee = next(output for output in outputs if output.name == "RKneeMoment")
    assert np.isfinite(knee.sd).sum() == np.isfinite(knee.values).sum() > 3 * len(trial.time)
    for output in outputs:
        np.testing.assert_allclose(points[output.name + suffix][:, at].T, output.values, atol=1e-4)
        assert np.isnan(points[output.name + suffix][:, outside]).all()
        if np.isfinite(output.sd).any():
            np.testing.assert_allclose(
                points[output.name + suffix + "SD"][:, at].T, np.nan_to_num(output.sd, nan=-1.0), atol=1e-4
            )
    return points, at


def test_a_walk_in_trc_gets_a_new_file(fit, demo_run, tmp_path):
    outcome = run("export", demo_run[1], "--c3d", "-o", tmp_path / "out")
    assert outcome.status == 0, outcome.err
    assert "isb (--convention)" in outcome.out
    (trial,) = fit.trials
    path = tmp_path / "out" / f"{trial.name}.c3d"
    points, at = expect_outputs(path, fit)
    # the hip centre stays where it is in the pelvis
    apart = np.linalg.norm(points["LHJC"] - points["RHJC"], axis=0)[at]
    assert 100.0 < apart.mean() < 250.0
    assert np.ptp(apart) < 1e-3
    parameters = ezc3d.c3d(str(path))["parameters"]["KINERTIA"]
    masses = dict(zip(parameters["SEGMENTS"]["value"], parameters["MASS"]["value"], strict=True))
    assert masses == pytest.approx(dict(zip(fit.estimate.segments, fit.estimate.mass_kg, strict=True)), rel=1e-6)
    assert len(parameters["SHA256"]["value"]) == len(parameters["FILES"]["value"]) > 1
    written = ezc3d.c3d(str(path))["parameters"]["ANALYSIS"]
    speeds = fit.spatiotemporal.groupby("side").speed_m_s.mean()
    for side, name, value in zip(*(written[key]["value"] for key in ("CONTEXTS", "NAMES", "VALUES")), strict=True):
        assert name != "Walking Speed" or value == pytest.approx(speeds[side[0].lower()], rel=1e-6)
    assert written["NAMES"]["value"].count("Walking Speed") == len(speeds)
    events = ezc3d.c3d(str(path))["parameters"]["EVENT"]
    assert {"Kinertia: force plate"} <= set(events["DESCRIPTIONS"]["value"])
    strikes = events["TIMES"]["value"][1][[label == "Foot Strike" for label in events["LABELS"]["value"]]]
    for stride in trial.strides:
        assert np.abs(strikes - stride.start_s).min() < 1e-6
    assert kinertia.read_recording(path).events == ()


def test_export_refuses_what_is_not_the_trials_file(demo_run, tmp_path):
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    refused = run("export", demo_run[1], "--c3d", "--recordings", folder, "-o", tmp_path / "out")
    assert refused.status == 2
    assert "--recordings" in refused.err
    assert not (tmp_path / "out").exists()
    named = json.loads((demo_run[1] / "fit.json").read_text())["trials"][0]["name"]
    (source,) = (demo_run[1] / "lab").rglob(f"{named}.trc")
    changed = folder / source.name
    changed.write_bytes(source.read_bytes() + b"\n")
    refused = run("export", demo_run[1], "--c3d", "--recordings", folder, "-o", tmp_path / "out")
    assert refused.status == 2
    assert "has changed since" in " ".join(refused.err.split())
    assert run("export", demo_run[1], "--c3d", "--convention", "iso", "-o", tmp_path / "out").status == 2


def left_by_others(demo_run, folder, spelling=str, **units):
    """The C3D file of the demo's walk, as other software leaves it: with these labels and units of outputs."""
    assert run("export", demo_run[1], "--c3d", "-o", folder / "plain").status == 0
    (path,) = (folder / "plain").glob("*.c3d")
    file = ezc3d.c3d(str(path))
    for name, unit in units.items():
        file["parameters"]["POINT"][name]["value"] = [unit]
    labels, ours = (file["parameters"][group]["LABELS"] for group in ("POINT", "KINERTIA"))
    labels["value"] = [label if label in ours["value"] else spelling(label) for label in labels["value"]]
    file.write(str(folder / path.name))
    return folder / path.name


def test_results_have_the_units_that_the_file_states(fit, demo_run, tmp_path):
    stated = {"ANGLE_UNITS": "rad", "MOMENT_UNITS": "N-mm", "FORCE_UNITS": "", "POWER_UNITS": "mW"}
    path = left_by_others(demo_run, tmp_path, **stated)
    (trial,) = fit.trials
    path.write_bytes(c3d_with_results(fit, trial, path, "isb", {}))
    points, file = points_of(path)
    header = file["header"]["points"]
    at = (trial.joint_curves.time * header["frame_rate"]).round().astype(int) - header["first_frame"]
    factors = {"ANGLES": np.pi / 180.0, "MOMENTS": 1e3, "FORCES": 1.0, "POWERS": 1e3}
    for output in outputs_of(fit, trial, "isb"):
        np.testing.assert_allclose(
            points[output.name][:, at].T, factors[output.kind] * output.values, rtol=1e-5, atol=1e-5
        )
    units = file["parameters"]["KINERTIA"]["UNITS"]["value"]
    assert units == ["ANGLES rad", "FORCES N/kg", "MOMENTS N-mm/kg", "POWERS mW/kg"]
    assert file["parameters"]["POINT"]["FORCE_UNITS"]["value"] == ["N"]


def test_markers_that_the_file_spells_otherwise_are_found_in_it(fit, demo_run, tmp_path):
    path = left_by_others(demo_run, tmp_path, "Walk_{}".format)
    path.write_bytes(c3d_with_results(fit, fit.trials[0], path, "isb", {}))
    expect_outputs(path, fit)


def test_a_file_whose_unit_is_unknown_is_refused(fit, demo_run, tmp_path):
    path = left_by_others(demo_run, tmp_path, MOMENT_UNITS="lbf ft")
    with pytest.raises(FileError, match="MOMENTS are in 'lbf ft'"):
        c3d_with_results(fit, fit.trials[0], path, "isb", {})


@pytest.mark.parametrize("prefix", ["", "Anna:"])
def test_the_prefix_is_the_persons(prefix):
    labels = ("Wand:A", "Wand:B", *(prefix + label for label in ("LASI", "RASI", "LKNE")), f"{prefix}LHJC")
    markers = SimpleNamespace(labels=("LASI", "RASI", "LKNE"))
    trial = SimpleNamespace(kinematics=SimpleNamespace(trial=SimpleNamespace(markers=markers)))
    assert prefix_of(SimpleNamespace(labels=labels), trial) == prefix


def test_the_prefix_is_not_that_of_a_second_person():
    """The reader leaves the others' prefixes in place, so that as many labels are found without Anna's."""
    person, other = ("LASI", "RASI", "LKNE"), ("Ben:LASI", "Ben:RASI", "Ben:LKNE")
    markers = SimpleNamespace(labels=(*person, *other))
    trial = SimpleNamespace(kinematics=SimpleNamespace(trial=SimpleNamespace(markers=markers)))
    labels = (*(f"Anna:{label}" for label in person), *other)
    assert prefix_of(SimpleNamespace(labels=labels), trial) == "Anna:"


WALKS = {
    "pig_a": ("pig_c3d/subject_a_walk.c3d", "pig_c3d/subject_a_static.c3d", "--mass 41.5 --height 1.61 --sex male"),
    "pig_b": ("pig_c3d/subject_b_walk.c3d", "pig_c3d/subject_b_static.c3d", "--sex female"),
    "HC002D": (*(f"field/biomechzoo/HC002D/{kind}.c3d" for kind in ("straight", "static")), "--sex male"),
    "HC036A": (*(f"field/biomechzoo/HC036A/{kind}.c3d" for kind in ("straight", "static")), "--sex male"),
    "UNIPD": ("field/unipd/walking1.c3d", "field/unipd/static.c3d", "--mass 83 --height 1.8 --sex male"),
}


RODS = {"Knee": ("Shank", "Foot"), "Hip": ("Thigh", "Shank", "Foot")}
ENDS = {"Thigh": ("FEP", "FEO"), "Shank": ("FEO", "TIO"), "Foot": ("TIO", "TOE")}
MASS_SHARE = {"Thigh": 0.1, "Shank": 0.0465, "Foot": 0.0145}
GYRATION_SHARE = {"Thigh": 0.323, "Shank": 0.302, "Foot": 0.475}
"""Of body mass and segment length: Dempster's, as Plug-in Gait's manual lists them."""
TIMES_INERTIA = 3.0
"""Moments of inertia in Vicon's own moments over those: while a foot swings its knee moments are, to 5 %, of Dempster's
masses and three times his moments of inertia (regression over seven swings of four people: 1.0 and 2.9)."""


def more_inertia(points, side, joint, at, rate_hz):
    """(w, 3) N m per kg of body mass, in the file's axes: what Vicon's larger moments of inertia add to a moment."""
    result = np.zeros((len(at), 3))
    frames = np.arange(max(at[0] - 30, 0), min(at[-1] + 30, points["LASI"].shape[1]))
    for name in RODS[joint]:
        ends = np.hstack([points[side + end][:, frames].T / 1000.0 for end in ENDS[name]])
        spline = smooth(frames / rate_hz, ends, 15.0)
        along, rate = (np.diff(spline(at / rate_hz, order).reshape(-1, 2, 3), axis=1)[:, 0] for order in (0, 2))
        inertia = MASS_SHARE[name] * GYRATION_SHARE[name] ** 2 * np.cross(along, rate)
        result += (TIMES_INERTIA - 1.0) * inertia
    return result


def extension_about(fit, joint, side, path, centre, more):
    """(w,) N m/kg extending moment of a joint about another point (w, 3), with a moment (w, 3) more, in the file's axes
    and units.
    """
    (trial,) = fit.trials
    frames = frames_of(path)
    turn, origin = to_file(path, frames, trial, "")
    loads = trial.reactions.at(trial.time)
    pose = trial.skeleton.pose(trial.motion.q)
    for leg, wrench in joint_wrenches(trial.skeleton, fit.estimate, trial.motion, loads).items():
        if (leg.name, leg.side.upper()) == (joint, side):
            arm = leg.centre(trial.skeleton, pose) - (centre - origin) @ np.linalg.inv(turn)
            turned = more @ np.linalg.inv(turn / np.cbrt(abs(np.linalg.det(turn))))
            moment = wrench[:, 3:] + np.cross(arm, wrench[:, :3]) + fit.mass_kg * turned
            axis = pose.rotation[:, trial.skeleton.segments.index(leg.child), :, 2]
            return (-1.0 if joint == "Hip" else 1.0) * np.einsum("nk,nk->n", axis, moment) / fit.mass_kg
    raise KeyError(joint, side)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, files in WALKS.items() if is_here(files[:2])])
def test_measured_files_come_back_with_vicons_signs(fit_of, tmp_path, name):
    walk, static, more = WALKS[name]
    options = ["--static", find(static), *more.split()]
    if name == "UNIPD":
        assert run("markers", find(static), "-o", tmp_path / "markers.toml").status == 0
        options += ["--markers", tmp_path / "markers.toml"]
    done = fit_of(name) if name in walks.WALKS else fitted(tmp_path / "fit", find(walk), *options)
    fit = load_fit(done.folder)
    exported = run("export", done.folder, "--c3d", "--recordings", find(walk).parent, "-o", tmp_path / "out")
    assert exported.status == 0, exported.err
    own_outputs = name != "UNIPD"
    path = tmp_path / "out" / find(walk).name
    points, at = expect_outputs(path, fit, "Kinertia" if own_outputs else "")
    kinematics = fit.trials[0].kinematics
    at = at[kinematics.frames - kinematics.trajectory_frames.start]
    before, file = points_of(find(walk))
    rate_hz = file["header"]["points"]["frame_rate"]
    for label, values in before.items():
        np.testing.assert_array_equal(points[label], values)
    again = fitted(tmp_path / "again", path, *options)
    np.testing.assert_array_equal(load_fit(again.folder).estimate.table(), fit.estimate.table())
    if own_outputs:
        for joint in ("Hip", "Knee", "Ankle"):
            for side in "RL":
                for kind in ("Angles", "Moment"):
                    theirs = before[f"{side}{'Vicon' if name == 'pig_a' else ''}{joint}{kind}"][0, at]
                    ours = points[f"{side}{joint}{kind}Kinertia"][0, at]
                    agree = np.corrcoef(theirs, ours)[0, 1]
                    if kind == "Moment" and joint != "Ankle" and agree < 0.9:
                        # their centres are up to 3.5 cm elsewhere, and their moments of inertia three times ours
                        extension_axis = points[side + {"Hip": "FEP", "Knee": "FEO"}[joint]][:, at].T
                        more = more_inertia(points, side, joint, at, rate_hz)
                        agree = np.corrcoef(theirs, extension_about(fit, joint, side, path, extension_axis, more))[0, 1]
                    assert agree > 0.9, (side, joint, kind, agree)
