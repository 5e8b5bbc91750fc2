"""Body segment parameters of one walk, step by step, with a look at every step's result.

`kinertia.estimate_bsp` does all of this in one call; here are its steps, to look into or to change. The walk is
OpenSim's gait2354 example: a man of 72.6 kg and 1.803 m on an instrumented treadmill. Run it with

    python examples/fit_gait2354.py FOLDER

where FOLDER holds subject01_static.trc, subject01_walk1.trc, subject01_walk1_grf.mot and subject01_walk1_grf.xml.
"""

import sys
from pathlib import Path

import numpy as np

import kinertia


def show(title: str, load: np.ndarray) -> None:
    """Print the RMS length of a residual's force and moment."""
    force, moment = (np.sqrt(np.mean(np.sum(part**2, axis=1))) for part in (load[:, :3], load[:, 3:]))
    print(f"{title:<48}{force:6.1f} N {moment:6.1f} N m")


def main(folder: Path, window_s: tuple[float, float] | None = None) -> kinertia.Fit:
    """Run all steps; `window_s` (s) uses only a part of the walk."""
    # 1. Read. Everything is in metres, newtons and seconds from here on, X forward, Y up, Z right.
    static = kinertia.read_recording(folder / "subject01_static.trc")
    walk = kinertia.read_recording(
        folder / "subject01_walk1.trc", folder / "subject01_walk1_grf.mot", folder / "subject01_walk1_grf.xml"
    )
    print(f"{len(walk.markers.labels)} markers at {walk.markers.rate_hz:g} Hz, {len(walk.markers.time)} frames")

    # 2. Look at it before estimating from it: which marker is what, which foot is on which plate, are the loads sound?
    marker_set = kinertia.choose_marker_set(static.markers.labels)
    check = kinertia.check_recording(walk, marker_set, mass_kg=72.6)
    print(*(f"{name}: {fact}" for name, fact in check.facts()), sep="\n")
    print(*(found.line() for found in check.findings if found.is_open), sep="\n")

    # 3. Prepare: joint centres and axes from the static trial, inverse kinematics, smoothing, the literature's BSPs.
    subject = kinertia.Subject(name="subject01", sex="male", mass_kg=72.6, height_m=1.803)
    ready = kinertia.prepare(
        kinertia.Person(subject, [kinertia.TrialInput(walk, window_s)], static, marker_set=marker_set)
    )
    (kinematics,) = ready.kinematics
    print(
        f"{len(ready.skeleton.coordinates)} coordinates, {len(ready.skeleton.segments)} segments",
        *ready.notes,
        sep="\n",
    )
    print(f"markers are {1e3 * kinematics.ik.marker_rms_m:.1f} mm from the model's, RMS")
    knee = np.degrees(kinematics.motion.q[:, ready.skeleton.coordinates.index("knee_angle_r")])
    print(f"right knee angle from {knee.min():.0f} to {knee.max():.0f} degrees")

    # 4. The residual: the load at the pelvis that the ground reactions do not explain.
    wrench = kinematics.foot_loads.sum(axis=1)
    show(
        "residual of the literature's BSPs",
        kinertia.residual(ready.skeleton, ready.literature, kinematics.motion, wrench),
    )

    # 5. Estimate motion, BSPs and calibration together.
    fit = kinertia.estimate(ready)
    show("... with the estimated motion and BSPs", fit.trials[0].residuals["estimate"])

    # 6. Look at it before believing it.
    print(fit.overview.line)
    print(*(found.line() for found in fit.overview.open), sep="\n")
    print(
        *(f"{rating.output}: {rating.use}; {rating.reason}" for rating in kinertia.suitability(fit, fit.findings)),
        sep="\n",
    )
    print(fit.bsp[fit.bsp.parameter == "mass"][["segment", "literature", "estimate", "sd", "evidence"]].to_string())
    knee_moment = fit.trials[0].moments["estimate"]["knee_angle_r"]
    print(f"right knee moment from {knee_moment.min():.0f} to {knee_moment.max():.0f} N m")
    return fit


if __name__ == "__main__":
    main(Path(sys.argv[1]))
