"""Phases between contacts: stances that no heel strike follows, and landings."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.motion.gait_cycle import contact_phases, found_events
from kinertia.motion.joint_moments import component_names


def changed(kinematics, **fields):
    return replace(kinematics, trial=replace(kinematics.trial, **fields))


def test_only_stances_on_plates_that_are_part_of_no_stride(fit):
    (trial,) = fit.trials
    phases, strides = trial.phases, trial.strides
    assert phases
    assert {phase.phase for phase in phases} == {"stance"}
    for phase in phases:
        assert 0.4 < phase.end_s - phase.start_s < 1.0
        assert phase.toe_off_s == phase.end_s
        assert not [s for s in strides if s.side == phase.side and abs(s.start_s - phase.start_s) < 0.1]
    every = contact_phases(trial.skeleton, trial.kinematics, ())
    assert len(every) > len(phases), "without strides all stances are phases of their own"


def test_the_other_foot_of_a_stance_has_the_times_of_its_events(fit):
    (trial,) = fit.trials
    events = [found_event.event for found_event in found_events(trial.skeleton, trial.kinematics)]
    for contact_phase in contact_phases(trial.skeleton, trial.kinematics, ()):
        other = {"r": "l", "l": "r"}[contact_phase.side]
        for time_s, kind in (
            (contact_phase.opposite_toe_off_s, "toe off"),
            (contact_phase.opposite_strike_s, "heel strike"),
        ):
            near = [event.time_s for event in events if event[1:] == (other, kind) and abs(event.time_s - time_s) < 0.1]
            assert time_s in near


def test_no_phase_that_the_motion_does_not_cover(fit):
    (trial,) = fit.trials
    phase, spline = trial.phases[0], trial.kinematics.spline
    shown = spline.time[spline.time < phase.end_s - 0.05]
    cut = replace(trial.kinematics, spline=replace(spline, time=shown))
    found = contact_phases(trial.skeleton, cut, trial.strides)
    assert not [
        other_phase
        for other_phase in found
        if other_phase.side == phase.side and abs(other_phase.start_s - phase.start_s) < 0.1
    ]


@pytest.mark.parametrize("missing", [{"task": "squat"}, {"on_ground": None}])
def test_no_phases_of_squats_nor_where_contacts_are_unknown(fit, missing):
    (trial,) = fit.trials
    assert contact_phases(trial.skeleton, changed(trial.kinematics, **missing), ()) == ()


@pytest.fixture(scope="module")
def landing(fit):
    """The walk as a landing: both feet come to stand on plates while the pelvis falls, and rises later."""
    (trial,) = fit.trials
    k = trial.kinematics
    time = k.trial.markers.time
    first = float(time[len(time) // 2])
    ground = np.ones((len(time), 2), dtype=bool)  # from a box to the plate, as the markers of its feet see it
    loads = k.trial.loads
    standing = (loads.time < first - 0.2) | (loads.time >= first)
    force = np.zeros_like(loads.force)
    force[..., 1] = np.where(standing, 300.0, 0.0)[:, None]
    spline = _Falling(k.spline, k.ik.coordinates.index("pelvis_ty"), first + 0.25)
    moved = replace(changed(k, task="landing", on_ground=ground, loads=replace(loads, force=force)), spline=spline)
    return trial.skeleton, moved, first


class _Falling:
    """A spline whose pelvis is lowest at one time."""

    def __init__(self, spline, column, lowest_s):
        self.own, self.column, self.lowest_s, self.time = spline, column, lowest_s, spline.time

    def __call__(self, time, order=0):
        q = self.own(time, order).copy()
        if order == 0:
            q[:, self.column] = 0.7 + 3.0 * np.square(time - self.lowest_s)
        return q


def test_a_landing_lasts_from_contact_until_the_pelvis_is_lowest(landing):
    skeleton, kinematics, first = landing
    found = contact_phases(skeleton, kinematics, ())
    assert [(phase.side, phase.phase, phase.number) for phase in found] == [("r", "landing", 1), ("l", "landing", 1)]
    for phase in found:
        assert phase.start_s == pytest.approx(first, abs=0.02)
        assert phase.end_s == pytest.approx(first + 0.25, abs=0.03)


def test_a_step_onto_a_plate_is_no_landing(landing):
    skeleton, kinematics, first = landing
    slow = replace(kinematics, spline=_Falling(kinematics.spline.own, kinematics.spline.column, first + 0.05))
    assert contact_phases(skeleton, slow, ()) == ()


def test_a_landing_that_the_record_does_not_hold_has_no_phase(landing):
    skeleton, kinematics, first = landing
    later = replace(kinematics, spline=_Falling(kinematics.spline.own, kinematics.spline.column, first + 60.0))
    assert contact_phases(skeleton, later, ()) == ()


def test_curves_of_a_phase_are_those_over_time(fit):
    """In the columns of cycles, from the curves that are known over time; the left stance has no heel strike after."""
    (trial,), curves = fit.trials, fit.contact_phases()
    assert list(curves.columns) == ["trial", "task", "phase", "side", "stride", "percent", "quantity", "value", "sd"]
    joints = trial.joint_curves.joints["estimate"]
    for phase in trial.phases:
        of_phase = curves[(curves.side == phase.side) & (curves.stride == phase.number)]
        for axis, name in enumerate(component_names("knee")):
            rows = of_phase[of_phase.quantity == f"{name}_joint_moment"]
            known = rows.value.notna().to_numpy()
            row = joints.joints.index(f"knee_{phase.side}")
            there = np.isfinite(joints.moments[:, row, axis])
            expected = np.interp(phase.time[known], trial.joint_curves.time[there], joints.moments[there, row, axis])
            scale = np.abs(expected).max() / fit.mass_kg
            np.testing.assert_allclose(rows.value[known], expected / fit.mass_kg, atol=0.05 * scale)
            assert (rows.sd[known] > 0.0).all()
    upward = curves[curves.quantity == "ground_force_upward"].groupby(["side", "stride"]).value.max()
    assert (upward > 80.0).any()
