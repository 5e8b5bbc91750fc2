"""Cases of limits of findings about files and what is stated; `marker_limits` says what a case is."""

import tempfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from kinertia.diagnostics.plates import ground_contact
from kinertia.errors import KinertiaError, findings_of
from kinertia.estimation import body_measures
from kinertia.io import recording
from kinertia.io.text.trc import read_trc
from kinertia.model.anthropometry import check_subject
from kinertia.model.stadium_body import girths_with_widths, measures
from kinertia.trial.data import Markers, PlateLoads
from kinertia.trial.stances import LegCoverage


def refusals(call, *given):
    """The findings that a call raises; none if it returns."""
    try:
        call(*given)
    except KinertiaError as error:
        return findings_of(error)
    return []


def pressed(force_n):
    time = np.arange(3) / 100
    force = np.zeros((3, 1, 3))
    force[1, 0, 1] = force_n
    plates = PlateLoads(time, ("plate",), force, np.zeros((3, 1, 3)), (None,))
    walk = SimpleNamespace(name="walk", markers=Markers(time, ("A",), np.zeros((3, 1, 3))), plates=plates)
    return refusals(recording._expect_laboratory, Path("walk.c3d"), walk)


def of_rate(off):
    """A TRC file whose header states this much more than its times have."""
    rows = "".join(f"{k + 1}\t{0.0101 * k:.4f}\t1\t2\t3\n" for k in range(101))
    header = (
        "PathFileType\t4\t(X/Y/Z)\tx.trc\n"
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n"
        f"{(1 + off) / 0.0101:.6f}\t100\t101\t1\tmm\t100\t1\t101\n"
        "Frame#\tTime\tHeel\t\t\n\t\tX1\tY1\tZ1\n"
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.trc"
        path.write_text(header + rows)
        return refusals(read_trc, path)


def stating(mass_kg=70.0, height_m=1.8):
    return refusals(check_subject, mass_kg, height_m, "male")


def girth(ratio):
    """What is found of a girth that is this many times its width."""
    around, across = (measures()[place].name for place in girths_with_widths()[0])
    stated = {around: (0.3 * ratio, 0.01), across: (0.3, 0.01)}
    values = np.log([value for value, _ in stated.values()])
    return body_measures._implausible(stated, values, np.eye(2), values)


def on_plates(share, patched):
    """A leg whose push-off (36 percent of stance) is on plates in this share."""
    stance = np.ones(101, dtype=bool)
    stance[65:] = np.arange(36) < round(36 * share)
    leg = LegCoverage("r", stance, None)
    patched.setattr(ground_contact, "task_of", lambda context: "walk")
    patched.setattr(ground_contact, "coverage_of", lambda context: (leg,))
    return ground_contact.stance_coverage(SimpleNamespace(trials=[SimpleNamespace(window_s=None, name="walk")]))


FILE_LIMITS = {
    "F172 strongest": (pressed, 0.99e6, 1.01e6, [], ["ERROR"]),
    "T103 differs": (of_rate, 0.0099, 0.0101, [], ["ERROR"]),
    "S102 lightest": (lambda kg: stating(mass_kg=kg), 10.1, 9.9, [], ["ERROR"]),
    "S102 heaviest": (lambda kg: stating(mass_kg=kg), 299.9, 300.1, [], ["ERROR"]),
    "S102 shortest": (lambda m: stating(height_m=m), 0.51, 0.49, [], ["ERROR"]),
    "S102 tallest": (lambda m: stating(height_m=m), 2.49, 2.51, [], ["ERROR"]),
    "S403 least": (girth, 1.91, 1.89, [], ["WARNING"]),
    "S403 most": (girth, 3.29, 3.31, [], ["WARNING"]),
    "P272 phase": (on_plates, 0.93, 0.88, [], ["WARNING"]),
}
