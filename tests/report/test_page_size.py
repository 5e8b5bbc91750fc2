"""A report stays small enough to be sent, however many trials there are and however long."""

import re
from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.result.trial_fit import JointCurves
from kinertia.estimation.simultaneous.uncertainty.curve_deviations import CurveDeviations
from kinertia.motion.dynamics import Motion
from kinertia.report.pages.page import MOST_TRIALS, render
from kinertia.trial.data import FootLoads
from report_page import Elements

MOST_BYTES = 3_200_000
MOST_BYTES_OF_MANY = 4_500_000


def prolonged(trial, times):
    """The same trial many times over, with every frame in the window."""
    kinematics = trial.kinematics
    shown = kinematics.frames

    def again(array, frames=slice(None)):
        return np.concatenate([array[frames]] * times)

    markers, loads, ik = kinematics.trial.markers, kinematics.trial.loads, kinematics.ik
    time = np.arange(times * len(shown)) / markers.rate_hz
    inside = (loads.time >= kinematics.window_s[0]) & (loads.time < kinematics.window_s[1] + 1 / markers.rate_hz)
    walked = replace(
        kinematics.trial,
        markers=replace(markers, time=time, positions=again(markers.positions, shown)),
        loads=FootLoads(
            np.arange(times * inside.sum()) * len(time) / markers.rate_hz / (times * inside.sum()),
            again(loads.force, inside),
            again(loads.moment, inside),
        ),
        measured=np.ones(len(time), dtype=bool),
        leg_known=None,
        on_ground=again(kinematics.trial.on_ground, shown),
    )
    curves = trial.joint_curves
    frames_of_motion = shown - kinematics.trajectory_frames.start

    def parts(record, frames=slice(None)):
        return {name: again(getattr(record, name), frames) for name in vars(record)}

    def joints(of_stage):
        return replace(
            of_stage, moments=again(of_stage.moments, frames_of_motion), forces=again(of_stage.forces, frames_of_motion)
        )

    solved = replace(ik, time=time, q=again(ik.q, shown), errors_m=again(ik.errors_m, shown))
    return replace(
        trial,
        kinematics=replace(
            kinematics,
            trial=walked,
            ik=solved,
            windows_s=((0.0, float(time[-1])),),
            known=again(kinematics.known, shown),
        ),
        motion=Motion(**parts(trial.motion)),
        residuals={stage: again(values) for stage, values in trial.residuals.items()},
        full_residuals={stage: again(values) for stage, values in trial.full_residuals.items()},
        joint_loads={stage: again(values) for stage, values in trial.joint_loads.items()},
        deviations=CurveDeviations(**parts(trial.deviations)),
        marker_errors_m={stage: again(values) for stage, values in trial.marker_errors_m.items()},
        joint_curves=JointCurves(
            time,
            again(curves.known, frames_of_motion),
            Motion(**parts(curves.motion, frames_of_motion)),
            {stage: again(values, frames_of_motion) for stage, values in curves.forces.items()},
            {stage: joints(of_stage) for stage, of_stage in curves.joints.items()},
            CurveDeviations(**parts(curves.deviations, frames_of_motion)),
        ),
    )


@pytest.mark.slow
def test_many_long_trials_stay_below_the_limit(fit):
    long = prolonged(fit.trials[0], 20)
    assert len(long.time) > 1500
    posterior = replace(fit.posterior, marker_noise=fit.posterior.marker_noise * 30)
    made = render(replace(fit, trials=(long,) * 30, posterior=posterior))
    assert len(made.encode()) <= MOST_BYTES_OF_MANY
    elements = Elements(made)
    assert len(elements.named("canvas")) == 1
    (trials,) = re.findall(r'<select data-set="trial">(.*?)</select>', made)
    assert trials.count("<option") == MOST_TRIALS
    assert f"first {MOST_TRIALS} of 30 trials" in elements.text
    assert len(render(replace(fit, trials=(long,))).encode()) <= MOST_BYTES_OF_MANY


def test_three_trials_with_strides_stay_below_3_2_mb(fit):
    posterior = replace(fit.posterior, marker_noise=fit.posterior.marker_noise * 3)
    made = render(replace(fit, trials=fit.trials * 3, posterior=posterior))
    assert 'id="cycle"' in made
    assert len(made.encode()) < MOST_BYTES
