"""Compare estimates and error bars with the truth."""

from pathlib import Path
from typing import Annotated

import typer

from kinertia.studies.parallel import in_parallel
from validation.accuracy_study import SCENARIOS, run_accuracy
from validation.accuracy_tables import JOINT_CAPTION, accuracy_markdown, moments_markdown
from validation.calibration_errors import DISTURBANCES, Calibrated, calibrated, calibration_section
from validation.measured_data import data_folder
from validation.measured_walks import measured_section, measured_walk
from validation.page import write_page
from validation.pooling import pooled, pooling_section
from validation.study_bound import bound_rows
from validation.study_noise import UNIFORM_SD, study_draw, study_section
from validation.walks import WALKS

_PAGE = """# Accuracy of the simultaneous estimate

Results for synthetic people, whose true values are known, in fourteen laboratories with different errors.

**[Joint moments](#joint-moments)** are as good as the usual pipeline's or better at every joint in every laboratory,
but for ankles where axes are 5 degrees off (3 % worse). At legs and back, errors are 0.1 to 0.5 times the usual ones
where instruments or joint centres are wrong and calibrated, and 0.1 to 1.0 times where they are exact.

**[Error bars](#error-bars)** of masses, CoMs and inertias hold everywhere: the truth is covered in 94 to 98 %. Those of
joint moments are rather too long: 94 to 100 % per joint. With calibration errors, which they allow for, they are 1.0 to
1.8 times the errors at hips, back and knees (0.9 to 1.5 with skin in blocks); where skin goes with the joints and the
rest is exact, about twice. At ankles and subtalar joints they also allow for axes that are 4 degrees off: 1.6 to 2.1
times the errors where axes are exact and the calibration is not, six times where all is exact.

**What breaks them** breaks those of joint moments first: hip centres 15 mm off and calibration switched off leave 49 %
for hip flexion and 70 % for knees, a gain of 2 % that is not calibrated 90 % for ankles. Axes 5 degrees off leave 96 %
of ankle moments covered, and 77 % of the angles of hip rotation. Wobbling thighs do little in the smooth synthetic
walk, which has no impacts.

**Joint angles**: where calibration is off, as it is in practice, errors are 0.2 to 0.8 times those of inverse
kinematics, mostly about half. What varies in time is better; constant offsets are where markers were put.

**Masses better than the literature's in 95 % of people cannot be had** from one walk: an estimate at the theoretical
bound would be better in three quarters, with squats, arm swings and trunk sway besides in 83 %. The literature, scaled
to a person's mass, is already nearly as good, and chance decides for many: the estimate is better in 78 to 98 %.

**Long walks and several**: skin motion is the same in every stride, and does not average out. What comes back counts
once, at whatever pace, so that bars hold after twelve strides, too, and errors are hardly smaller than after two. Other
motions are more informative.

On trials made by OpenSim, with OpenSim's own tools as the usual pipeline: [peers](peers.md).

## Joint moments

RMS errors of joint moments (N m), estimate / usual pipeline, {people} people in each laboratory, a walk of
2.5 s. *Usual pipeline*: inverse kinematics, literature BSPs, forces as measured,
coordinates low-passed at the best of 6, 10 and 12 Hz for each joint. Both know the same skeleton and see the same
markers and forces.

{moments}

## The study's noise, from starts 50 % off

RMS errors of the 49 parameters of [the study](study.md), mean over {draws} draws: the walk of the package
(1.14 m/s, one stride and margins, 41 markers, 100 Hz), the study's sinusoidal noise on every marker coordinate,
every parameter of the start changed by uniform +/-50 %. Both estimators see the same starts and markers and know the
skeleton. The simultaneous estimate also knows that the start is within some 50 % ({uniform_sd:.2f} of its value as
standard deviation), that left mirrors right, and the total mass within 0.5 %. It reads the noise from the markers, as
`kinertia fit` does.

{study}

**How good an estimate could be on this walk.** *At best* is the Cramér-Rao bound of an
ideal estimate, for which forces are exact and the noise is known to consist of the study's sinusoids. What they leave
free is information, seen by cameras of 0.1 mm or even 0.01 mm. The
moments of inertia are then still off by 0.05 kg m2: the trunk hardly turns at 1.14 m/s, so that one
stride says little about its moments, which dominate the RMS, and they stay near the start. The lines after
"simultaneous" change one thing each. How the noise is weighted changes the result by a few percent; telling the
estimator where starts come from helps the masses and worsens the inertias.

## Calibration

Errors put into the truth of a walk of 2.5 s (people unlike the literature, 1 mm of camera noise, prior of the
literature), five people each. Per quantity: RMS error / mean posterior deviation (largest error in posterior
deviations). Priors: plates and synchronisation as in every fit, fault-free or faulty; hips 10 mm. BSPs: RMS errors of
mass (kg), CoM (mm), inertia (kg m2) with calibration free, held at its wrong values, and of the literature.

{calibration}

## Measured walks

`kinertia fit`, default settings. Residuals are RMS over the measured window.

{measured}

The total mass agrees with the scale within 1 % also where
the plates do not: those of the Plug-in Gait walks correspond to 3.4 and 4.7 % less than the stated mass, and the
estimate finds their gains wrong by that much and says so. A parameter beyond 3 prior SDs gives a warning in every fit.

## Pooling

The gait2354 walk, cut in two: differences of the BSPs from the estimate of the whole walk, in its posterior deviations.

{pooling}

The halves together give the estimate of the whole, well within its error bars; what is left is what the cut takes away
(the dynamics of the frames beside it). Most errors of one half come back in the other and count once, so that both
together say little more than the better half. That takes the calibration of the left plate's free moment: it
adds some 7 N m to the left per kN of vertical force, while the mean vertical moment over whole strides should be near
zero. Without
this unknown, the halves together are off by 0.40 deviations (RMS; 1.9 at most), since each half explains the moment by
another initial rate of turning and by CoMs moved to the side.

## Error bars

People drawn from the prior (masses, CoMs and inertias with all their correlations, physically possible, given the
scale), a walk of 2.5 s at 100 Hz, {people} people in each laboratory.
*Coverage*: parameters whose truth lies in the 95 % interval, and the standard error over people. *Error / sd*: RMS.
*Bound*: the Cramér-Rao bound, prior included, at the true motion and parameters, with the estimator's own noise model.
*Better*: people for whom the RMS error is below the literature's, and in brackets the share for whom that of an
estimate at the bound would be. *Measured*, *informed* and *assumed*: parameters of all kinds, in prior SDs. Skin,
skeleton and instruments are the same in all trials of a person. {joint_caption} What an error bar means is explained in
[error bars](../error-bars.md).

{error_bars}
"""


def document(sections: dict[str, str]) -> str:
    """Return the text of docs/validation/accuracy.md."""
    return _PAGE.format(uniform_sd=UNIFORM_SD, joint_caption=JOINT_CAPTION, **sections)


def _calibrated(case: tuple[str, int]) -> Calibrated:
    return calibrated(DISTURBANCES[case[0]], case[1])


def main(
    people: Annotated[int, typer.Option(min=2, help="People in each laboratory.")] = 40,
    seed: Annotated[int, typer.Option(help="Of people and noise.")] = 1,
    workers: Annotated[int | None, typer.Option(help="Processes (default: one per core).")] = None,
    skin: Annotated[Path | None, typer.Option(help="File of measured skin: only that laboratory and its page.")] = None,
    keep: Annotated[Path | None, typer.Option(help="Folder for its walks, which are used again.")] = None,
) -> None:
    """Run everything and write the page; parts that need the measured trials are left out where these are absent."""
    if skin:
        from validation.skin_laboratory import measure  # needs OpenSim

        measure(skin, people, keep, workers or 2)
        return
    sections = {"people": str(people)}
    laboratories = run_accuracy(SCENARIOS, people, seed, workers)
    sections |= {"error_bars": accuracy_markdown(laboratories), "moments": moments_markdown(laboratories)}
    seeds = range(5)
    outcomes = in_parallel(_calibrated, [(name, seed) for name in DISTURBANCES for seed in seeds], workers)
    by_name = {name: outcomes[i * len(seeds) : (i + 1) * len(seeds)] for i, name in enumerate(DISTURBANCES)}
    sections["calibration"] = calibration_section(by_name)
    draws = in_parallel(study_draw, range(20), workers)
    sections |= {"study": study_section(draws, bound_rows(len(draws))), "draws": str(len(draws))}
    try:
        data_folder()
    except FileNotFoundError as error:
        sections |= dict.fromkeys(("measured", "pooling"), f"Left out: {error}.")
    else:
        sections["measured"] = measured_section({name: measured_walk(name) for name in WALKS})
        sections["pooling"] = pooling_section(*pooled())
    write_page("accuracy", document(sections))
