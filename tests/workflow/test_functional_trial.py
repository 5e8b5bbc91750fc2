"""A trial without forces says where joint axes, joint centres and markers are; a knee axis that is off is found."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kinertia import Settings, Subject, TrialInput, estimate, prepare, prepare_subject
from kinertia.errors import BlockedError, SettingsError
from kinertia.estimation.result.drawn_fit import kept_draws
from kinertia.estimation.simultaneous.instruments.instrument_errors import AXIS
from kinertia.io.text.trc import write_trc
from kinertia.model.gait27 import LEG_AXIS_TILTS
from kinertia.report.exports.files import write_draws
from kinertia.synthetic.laboratory import LabNoise, SkinMotion, camera_noise, record, write_lab
from kinertia.synthetic.motions import squat
from kinertia.synthetic.walk import walk, walking_subject
from kinertia.trial.data import Recording
from kinertia.workflow.check import check_person
from kinertia.workflow.person import Person
from kinertia.workflow.prepare import prepared
from kinertia.workflow.screening import screen

TILTS_DEG = {"knee_tilt_1_r": 5.0, "knee_tilt_2_r": -4.0, "knee_tilt_1_l": -5.0, "knee_tilt_2_l": 3.0}
SUBJECT = Subject(sex="male")


def recorded(seed):
    """Static trial and walk of somebody whose knees turn about other axes than the static trial shows, and squats."""
    person, rng = walking_subject(), np.random.default_rng(seed)
    locked = {name: float(np.radians(tilt)) for name, tilt in TILTS_DEG.items()}
    person = replace(person, skeleton=person.skeleton.lock(locked))
    lab = record(person, walk(person, 2.5, 1000.0), LabNoise(), rng, 10)
    squats = squat(person)
    moved = SkinMotion.draw(squats.skeleton, squats.motion.q, rng).moved(
        squats.markers, squats.skeleton, squats.motion.q
    )
    return lab, Recording("squat", camera_noise(moved, 0.0005, rng))


def off_deg(fit) -> dict[str, tuple[float, float]]:
    """Per knee, by how much the estimated axis misses the true one, and the deviation of one of its two angles."""
    result = {}
    for side in "rl":
        found = [
            entry for entry in fit.posterior.calibration if entry.joint == f"knee_{side}" and entry.quantity == AXIS
        ]
        away = [np.degrees(entry.value) - TILTS_DEG[f"knee_tilt_{entry.axis}_{side}"] for entry in found]
        result[side] = float(np.hypot(*away)), float(np.degrees(max(entry.sd for entry in found)))
    return result


@pytest.fixture(scope="module")
def lab():
    return recorded(100)


@pytest.fixture(scope="module")
def fit(lab):
    measured, squats = lab
    return estimate(
        prepare(Person(SUBJECT, [TrialInput(measured.walk), TrialInput(squats, use="kinematics")], measured.static))
    )


def test_its_markers_alone_count(fit):
    assert [trial.name for trial in fit.trials] == ["walk"]
    assert [finding.where.trial for finding in fit.findings if finding.code == "P280"] == ["squat"]
    assert not [entry for entry in fit.posterior.calibration if entry.trial == "squat"]
    assert not fit.left_out
    assert fit.converged
    assert fit.overview.line.endswith("the trial was used, and the markers of one more.")


def test_draws_are_of_the_trials_in_the_result(fit, tmp_path):
    assert len(kept_draws(fit).trials) == len(fit.trials)
    write_draws(fit, tmp_path, 2)
    assert (tmp_path / "draw_002" / "kinematics.mot").is_file()


def test_axes_of_knees_are_found(fit):
    for away, sd in off_deg(fit).values():
        assert away < 3.0  # 6.4 and 5.8 by the static trial alone
        assert sd < 2.0


def test_its_skin_leaves_markers_where_the_walk_has_them(lab):
    """Squats draw skin: with the walk's markers drawn along, ankles were 6 mm, and their moments 3 N m, off."""
    measured, squats = lab
    alone = prepare(Person(SUBJECT, [TrialInput(measured.walk)], measured.static), Settings(joint_axes=True)).skeleton
    inputs = [TrialInput(measured.walk), TrialInput(squats, use="kinematics")]
    together = prepare(Person(SUBJECT, inputs, measured.static)).skeleton
    assert together.labels == alone.labels
    assert np.linalg.norm(together.marker_locals - alone.marker_locals, axis=1).max() < 0.003


def test_a_trial_with_forces_is_needed(lab):
    measured, squats = lab
    with pytest.raises(SettingsError, match="forces"):
        prepare(Person(SUBJECT, [TrialInput(squats, use="kinematics")], measured.static))


def test_forces_of_such_a_trial_are_not_used(lab):
    measured, _ = lab
    again = replace(measured.walk, name="again")
    ready = prepare(Person(SUBJECT, [TrialInput(measured.walk), TrialInput(again, use="kinematics")], measured.static))
    assert [trial.trial.name for trial in ready.functional] == ["again"]
    assert ready.functional[0].trial.loads.plates == ()
    assert [trial.trial.name for trial in ready.kinematics] == ["walk"]


def with_empty_plates(recording, name):
    zero = np.zeros_like(recording.plates.force)
    return replace(recording, name=name, plates=replace(recording.plates, force=zero, moment=zero))


def test_a_trial_whose_forces_are_refused_gives_its_markers(lab):
    measured, _ = lab
    inputs = [TrialInput(measured.walk), TrialInput(with_empty_plates(measured.walk, "empty"))]
    screened = screen(Person(SUBJECT, inputs, measured.static))
    assert screened.left_out == ("empty",)
    assert [trial.name for trial in screened.usable] == ["walk", "empty"]
    assert [
        (finding.where.trial, finding.severity.name) for finding in screened.findings if finding.code == "P283"
    ] == [("empty", "INFO")]
    ready = prepared(screened, Settings())
    assert [trial.trial.name for trial in ready.kinematics] == ["walk"]
    assert [trial.trial.name for trial in ready.functional] == ["empty"]
    assert ready.left_out == ("empty",)
    assert check_person(screened.person).overview.line.endswith("1 of 2 trials was used, and the markers of one more.")


def test_check_counts_it_as_a_fit_does(lab):
    measured, squats = lab
    inputs = [TrialInput(measured.walk), TrialInput(squats, use="kinematics")]
    line = check_person(Person(SUBJECT, inputs, measured.static)).overview.line
    assert line.endswith("the trial was used, and the markers of one more.")


def test_its_markers_must_be_sound(lab):
    measured, _ = lab
    markers = measured.walk.markers
    other = {"R": "L", "L": "R"}
    mirrored = [other.get(label[0], label[0]) + label[1:] if label[1] == "." else label for label in markers.labels]
    swapped = replace(with_empty_plates(measured.walk, "empty"), markers=replace(markers, labels=tuple(mirrored)))
    screened = screen(Person(SUBJECT, [TrialInput(measured.walk), TrialInput(swapped)], measured.static))
    assert [trial.name for trial in screened.usable] == ["walk"]
    assert not [finding for finding in screened.findings if finding.code == "P283"]


@pytest.mark.parametrize("window_s", [(200.0, 260.0), (1.0, 1.04)])
def test_a_window_with_hardly_any_of_its_frames_leaves_it_out(lab, window_s):
    measured, squats = lab
    inputs = [TrialInput(measured.walk), TrialInput(squats, window_s, use="kinematics")]
    checked = check_person(Person(SUBJECT, inputs, measured.static))
    (found,) = [
        finding for finding in checked.findings if finding.where.trial == "squat" and finding.severity.name == "ERROR"
    ]
    assert (found.code, found.evidence["key"].value) == ("F191", "window_s")
    assert checked.overview.line.endswith("1 of 2 trials was used.")
    ready = prepare(Person(SUBJECT, inputs, measured.static))
    assert (ready.functional, ready.left_out) == ((), ("squat",))


@pytest.mark.parametrize("frames", [12, 19, 40])
def test_check_and_fit_say_alike_that_it_is_too_short(lab, frames):
    measured, squats = lab
    short = replace(squats, markers=squats.markers.cut(1.0, 1.0 + (frames - 0.5) / squats.markers.rate_hz))
    inputs = [TrialInput(measured.walk), TrialInput(short, use="kinematics")]
    checked = check_person(Person(SUBJECT, inputs, measured.static))
    ready = prepare(Person(SUBJECT, inputs, measured.static))
    for findings in (checked.findings, ready.findings):
        (found,) = [
            finding for finding in findings if finding.where.trial == "squat" and finding.severity.name == "ERROR"
        ]
        assert (found.code, found.evidence["frames"].value) == ("T104", frames)
    assert ready.left_out == ("squat",)


def test_of_no_trial_with_forces_none_joins(lab):
    measured, _ = lab
    inputs = [TrialInput(with_empty_plates(measured.walk, name)) for name in ("one", "two")]
    screened = screen(Person(SUBJECT, inputs, measured.static))
    assert not screened.markers_only
    with pytest.raises(BlockedError):
        screened.usable  # noqa: B018


def test_the_example_of_the_docs(lab, tmp_path):
    measured, squats = lab
    write_lab(tmp_path / "lab", measured)
    write_trc(tmp_path / "lab" / "squats.trc", squats.markers)
    page = (Path(__file__).parents[2] / "docs" / "subject-file.md").read_text(encoding="utf-8")
    (example,) = [block for block in re.findall(r"```toml\n(.*?)```", page, re.DOTALL) if "kinematics" in block]
    path = tmp_path / "lab" / "functional.toml"
    path.write_text(example)
    ready = prepare_subject(path)
    assert [trial.trial.name for trial in ready.functional] == ["squats"]
    assert set(LEG_AXIS_TILTS) <= set(ready.uncertainty.axes)


@pytest.mark.slow
@pytest.mark.first
def test_axes_and_their_deviations_hold_over_people():
    misses, pulls = [], []
    for seed in range(101, 107):
        measured, squats = recorded(seed)
        inputs = [TrialInput(measured.walk), TrialInput(squats, use="kinematics")]
        found = estimate(prepare(Person(SUBJECT, inputs, measured.static), Settings())).posterior.calibration
        for entry in found:
            name = f"knee_tilt_{entry.axis}_{str(entry.joint)[-1]}"
            if entry.quantity == AXIS and name in TILTS_DEG and str(entry.joint).startswith("knee"):
                misses.append(np.degrees(entry.value) - TILTS_DEG[name])
                pulls.append(misses[-1] / np.degrees(entry.sd))
    assert np.sqrt(np.mean(np.square(misses))) < 1.5
    assert np.sqrt(np.mean(np.square(pulls))) < 1.3
