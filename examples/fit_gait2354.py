"""Body segment parameters of one walk, step by step, with a look at every step's result.

`kinertia.estimate_bsp` does all of this in one call; here are its steps, to look into or to change. The walk is
OpenSim's gait2354 example: a man of 72.6 kg and 1.803 m on an instrumented treadmill. Run it with

    python examples/fit_gait2354.py FOLDER

where FOLDER holds subject01_static.trc, subject01_walk1.trc, subject01_walk1_grf.mot and subject01_walk1_grf.xml.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from kinertia import Subject, read_recording
from kinertia.estimation.prepare import calibrate
from kinertia.estimation.two_level import Window, correct_pelvis, estimate_two_level, stretches
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.model.anthropometry import literature_bsp
from kinertia.model.bsp import BodySegmentParameters
from kinertia.motion.dynamics import joined, residual
from kinertia.motion.inverse_kinematics import rms
from kinertia.motion.kinematics import facing, solve_kinematics
from kinertia.trial.plate_assignment import build_trial


def show(title: str, load: np.ndarray) -> None:
    """Print the RMS length of a residual's force and moment."""
    force, moment = (rms(np.linalg.norm(load[:, part], axis=1)) for part in (slice(0, 3), slice(3, 6)))
    print(f"{title:<48}{force:6.1f} N {moment:6.1f} N m")


def main(folder: Path, window_s: tuple[float, float] | None = None) -> BodySegmentParameters:
    """Run all steps; `window_s` (s) uses only a part of the walk."""
    # 1. Read. Everything is in metres, newtons and seconds from here on, X forward, Y up, Z right.
    static = read_recording(folder / "subject01_static.trc")
    walk = read_recording(
        folder / "subject01_walk1.trc", folder / "subject01_walk1_grf.mot", folder / "subject01_walk1_grf.xml"
    )
    print(f"{len(walk.markers.labels)} markers at {walk.markers.rate_hz:g} Hz, {len(walk.markers.time)} frames")

    # 2. Which marker is what, which plate carries which foot, and which frames have all ground contact measured.
    marker_set = choose_marker_set(static.markers.labels)
    worn = set(walk.markers.labels)
    feet = {side: [label for label in labels if label in worn] for side, labels in marker_set.foot_labels().items()}
    trial = build_trial(walk, feet, window_s)
    rotation, turned_deg = facing(trial.markers, marker_set)
    trial = trial.rotated(rotation)
    print(f"{marker_set.name} markers; ground contact measured in {trial.measured.sum()} frames")

    # 3. Calibrate: joint centres, joint axes and marker positions from the static trial, adapted to the walk.
    subject = Subject(name="subject01", sex="male", mass_kg=72.6, height_m=1.803)
    model, skeleton, notes = calibrate(static, [trial], marker_set, subject, hip_centre="bell")
    print(f"{len(skeleton.coordinates)} coordinates, {len(skeleton.segments)} segments", *notes, sep="\n")

    # 4. Inverse kinematics frame by frame, then quintic splines whose smoothness cross-validation chooses.
    kinematics = solve_kinematics(skeleton, trial, turned_deg, "gcv")
    print(f"markers are {1e3 * kinematics.ik.marker_rms_m:.1f} mm from the model's, RMS")
    knee = np.degrees(kinematics.motion.q[:, skeleton.coordinates.index("knee_angle_r")])
    print(f"right knee angle from {knee.min():.0f} to {knee.max():.0f} degrees")

    # 5. The residual: the load at the pelvis that the ground reactions do not explain.
    literature = literature_bsp(72.6, 1.803, "male", model.geometry, "dumas")
    window = Window(kinematics.time, kinematics.motion, kinematics.foot_loads.sum(axis=1))
    show("residual of the literature's BSPs", residual(skeleton, literature, window.motion, window.wrench))

    # 6. Pelvis correction: let the pelvis accelerate as the forces say, and stay as near as possible to the markers.
    parts = stretches(window)
    corrected = joined([correct_pelvis(skeleton, literature, part) for part in parts])
    show("... with the pelvis corrected", residual(skeleton, literature, corrected, window.wrench))

    # 7. The two-level estimate: the BSPs that leave the least residual after pelvis correction.
    result = estimate_two_level(skeleton, literature, parts)
    show("... with the estimated BSPs", np.concatenate(result.residuals))

    # 8. Look at it before believing it.
    print(f"total mass {result.bsp.total_mass_kg:.1f} kg")
    for segment, before, after in zip(literature.segments, literature.mass_kg, result.bsp.mass_kg, strict=True):
        print(f"  {segment:<12}{before:6.2f} -> {after:6.2f} kg")
    print(
        f"segments that no body can have: {(~result.bsp.physically_consistent()).sum()} of {len(literature.segments)}"
    )
    return result.bsp


if __name__ == "__main__":
    main(Path(sys.argv[1]))
