"""Compare joint moments with those of OpenSim and RRA.

Joint moments, residuals and seconds of Kinertia next to OpenSim's IK + ID and RRA.

RRA takes most of the time, a minute or two per walk; runs that are finished in FOLDER are taken from there.
"""

import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Self

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import opensim
import pandas as pd
import typer
from scipy.signal import butter, sosfiltfilt

from kinertia.io.text.sto import read_sto
from validation.measured_trials import table
from validation.page import PAGES, write_page
from validation.peer_cases import Case, measured_cases, results, truth_case

FIRST_SEED = 100
JOINTS = {
    "hip_flexion": "hip flexion",
    "hip_adduction": "hip adduction",
    "hip_rotation": "hip rotation",
    "knee_angle": "knee",
    "ankle_angle": "ankle",
    "lumbar_extension": "lumbar extension",
    "lumbar_bending": "lumbar bending",
}
SHOWN = ("hip_flexion", "knee_angle", "ankle_angle")
"""Joints of the figures."""
PROGRAMS = {
    "opensim": "OpenSim, IK + ID",
    "rra": "OpenSim, RRA",
    "default": "Kinertia",
    "calibrated": "Kinertia, `--calibrate`",
}
LOADED_N = 20.0
FAST_HZ = 15.0
IMPACT_S = (-0.02, 0.06)
"""Interval that counts as heel strike, around the time at which the force passes LOADED_N."""
OURS, THEIRS, STANCE = "#D55E00", "#0072B2", "#E8E8E8"

Runs = dict[str, Any]
"""Result of `peer_cases.results`."""


def at(moments: pd.DataFrame, column: str, time: np.ndarray) -> np.ndarray:
    """Interpolate one column at the given times."""
    return np.interp(time, moments.index, moments[column])


def joint_errors(moments: pd.DataFrame, truth: pd.DataFrame, time: np.ndarray) -> dict[str, float]:
    """Return the mean squared error per joint, both sides together (N² m²)."""
    squares = {
        name: (at(moments, name, time) - at(truth, name, time)) ** 2 for name in map(str, truth) if name in moments
    }
    return {
        joint: float(np.mean([square for name, square in squares.items() if name.startswith(joint)]))
        for joint in JOINTS
    }


def pooled(errors: Iterable[dict[str, float]]) -> dict[str, float]:
    """Return the RMS over people per joint."""
    frame = pd.DataFrame(list(errors))
    return dict(np.sqrt(frame.mean())) if len(frame) else dict.fromkeys(JOINTS, np.nan)


def moment_errors(cases: list[tuple[Case, Runs]], program: str) -> dict[str, float]:
    """Return the RMS error per joint (N m) of a program over all people, each joint at its best cutoff."""
    per_cutoff: dict[int, list[dict[str, float]]] = {}
    for case, runs in cases:
        for cutoff, moments in runs[program].moments.items():
            errors = joint_errors(moments, read_sto(case.truth), runs["time"])  # type: ignore[arg-type]
            per_cutoff.setdefault(cutoff, []).append(errors)
    return dict(pd.DataFrame([pooled(errors) for errors in per_cutoff.values()], columns=list(JOINTS)).min())


@dataclass(frozen=True)
class Residuals:
    """Residual force or moment at the pelvis by three definitions, N or N m.

    Attributes:
        rms: RMS over frames of its size.
        component: mean over frames of the absolute value of a component, averaged over the three.
        peak: largest size.
    """

    rms: float
    component: float
    peak: float

    @classmethod
    def of(cls, moments: pd.DataFrame, time: np.ndarray, kind: str) -> Self:
        """Compute them from inverse dynamics at these times; `kind` is `force` or `moment`.

        >>> frames = pd.DataFrame({"pelvis_tx_force": [3.0, 3.0], "pelvis_ty_force": [4.0, 4.0],
        ...                        "pelvis_tz_force": [0.0, 0.0]}, index=[0.0, 1.0])
        >>> Residuals.of(frames, np.array([0.0, 0.5]), "force")
        Residuals(rms=5.0, component=2.3333333333333335, peak=5.0)
        """
        names = [name for name in map(str, moments) if name.startswith("pelvis_") and name.endswith(kind)]
        values = np.stack([at(moments, name, time) for name in names], axis=-1)
        size = np.sqrt(np.sum(values**2, axis=-1))
        return cls(float(np.sqrt(np.mean(size**2))), float(np.mean(np.abs(values))), float(size.max()))


def figures_of(all_runs: list[Runs], program: str) -> list[str]:
    """Return cells: residual force and moment, marker error, seconds; RMS over people, mean of the seconds."""
    done = [runs for runs in all_runs if not runs[program].failed]
    if not done:
        return ["failed", "", "", ""]
    force, moment = (
        np.sqrt(np.mean([Residuals.of(runs[program].opensim, runs["time"], kind).rms ** 2 for runs in done]))
        for kind in ("force", "moment")
    )
    markers = np.sqrt(np.mean([runs[program].marker_rms_m ** 2 for runs in done])) * 1e3
    seconds = np.mean([runs[program].seconds for runs in done])
    return [f"{force:.1f}", f"{moment:.1f}", f"{markers:.1f}", f"{seconds:.0f}"]


def moments_table(cases: list[tuple[Case, Runs]]) -> str:
    """Return joint-moment errors, a row per program, and the ratio of the last one to OpenSim's IK + ID."""
    rows, errors = [], {}
    for program in present(cases[0][1]):
        errors[program] = moment_errors(cases, program)
        rows.append([PROGRAMS[program], *(f"{errors[program][joint]:.2f}" for joint in JOINTS)])
    ratio = [f"{errors[program][joint] / errors['opensim'][joint]:.2f}" for joint in JOINTS]
    rows.append([f"{PROGRAMS[program]} / {PROGRAMS['opensim']}", *ratio])
    return table(["RMS error (N m)", *JOINTS.values()], rows)


def present(runs: Runs) -> list[str]:
    """Return the programs that were run on a case, in the order of PROGRAMS."""
    return [program for program in PROGRAMS if program in runs]


def figures_table(titled: dict[str, list[Runs]]) -> str:
    """Return residuals, marker errors and seconds: a row per walk and program."""
    rows = [
        [title, PROGRAMS[program], *figures_of(runs, program)]
        for title, runs in titled.items()
        for program in present(runs[0])
    ]
    return table(["walk", "program", "residual (N)", "residual (N m)", "markers (mm)", "seconds"], rows)


def contacts(loads: Path, forces: Path) -> dict[str, list[tuple[float, float]]]:
    """Return per side the times (s) of heel strike and toe-off of every stance that was measured."""
    measured, spans = read_sto(forces), {}
    for force in ET.parse(loads).iter("ExternalForce"):
        body = force.findtext("applied_to_body", "").strip()
        vertical = measured[force.findtext("force_identifier", "").strip() + "y"]
        spans[body[-1]] = stances(measured.index.to_numpy(), vertical.to_numpy())
    return spans


def stances(time: np.ndarray, vertical: np.ndarray, shortest_s: float = 0.1) -> list[tuple[float, float]]:
    """Return start and end of every interval with load on the foot."""
    loaded = np.r_[False, vertical > LOADED_N, False].astype(int)
    starts, ends = np.flatnonzero(np.diff(loaded) == 1), np.flatnonzero(np.diff(loaded) == -1) - 1
    pairs = zip(time[starts], time[ends], strict=True)
    return [(float(start), float(end)) for start, end in pairs if end - start > shortest_s]


def fast_part(moments: pd.DataFrame, column: str) -> np.ndarray:
    """Return the part of a moment above FAST_HZ."""
    rate = (len(moments) - 1) / (moments.index[-1] - moments.index[0])
    slow = sosfiltfilt(butter(2, FAST_HZ, fs=rate, output="sos"), moments[column])
    return moments[column].to_numpy() - slow


def spikes(
    moments: pd.DataFrame, column: str, feet: list[tuple[float, float]], time: np.ndarray
) -> tuple[float, float]:
    """Return the largest fast part at heel strike, and in the rest of stance (N m), from the first to the last time."""
    fast = pd.Series(np.abs(fast_part(moments, column)), moments.index)
    fast = fast[(fast.index >= time[0]) & (fast.index <= time[-1])]
    impact, rest = [0.0], [0.0]
    for strike, off in feet:
        if strike < time[0]:
            continue
        first, last = (strike + offset for offset in IMPACT_S)
        impact += list(fast[first:last])
        rest += list(fast[last : off + IMPACT_S[0]])
    return max(impact), max(rest)


def spikes_table(cases: dict[str, tuple[Case, Runs]]) -> str:
    """Return the fast part of the moments of the figures, at heel strike and later: the larger of both sides."""
    rows = []
    for case, runs in cases.values():
        feet = contacts(case.loads, case.forces)
        for joint in SHOWN:
            row = [f"{case.title}, {JOINTS[joint]}"]
            for moments in (runs["default"].moments[0], runs["opensim"].moments[6]):
                both = [spikes(moments, f"{joint}_{side}_moment", feet[side], runs["time"]) for side in "rl"]
                row += [f"{largest:.1f}" for largest in np.max(both, axis=0)]
            rows.append(row)
    places = ("at heel strike", "rest of stance")
    return table(["N m", *(f"{who}, {where}" for who in ("Kinertia", "OpenSim") for where in places)], rows)


def draw(case: Case, runs: Runs, path: Path) -> None:
    """Draw moments over time, both programs, both sides; stance is grey from heel strike to toe-off."""
    mpl.rcParams.update({"svg.hashsalt": "kinertia", "font.size": 9, "font.family": "sans-serif"})
    feet, time = contacts(case.loads, case.forces), runs["time"]
    figure, axes = plt.subplots(len(SHOWN), 2, figsize=(8.4, 6.4), sharex=True, sharey="row")
    for column, (side, title) in enumerate((("r", "right"), ("l", "left"))):
        for row, joint in enumerate(SHOWN):
            view = axes[row, column]
            for strike, off in feet[side]:
                view.axvspan(strike, off, color=STANCE, lw=0)
                view.axvline(strike, color="#777777", lw=0.8)
                view.axvline(off, color="#777777", lw=0.8, ls=":")
            name = f"{joint}_{side}_moment"
            view.plot(time, at(runs["opensim"].moments[6], name, time), color=THEIRS, lw=1.1, label="OpenSim, 6 Hz")
            view.plot(time, at(runs["default"].moments[0], name, time), color=OURS, lw=1.1, label="Kinertia")
            view.set_xlim(time[0], time[-1])
            view.set_title(f"{JOINTS[joint]}, {title}", fontsize=9)
            view.set_ylabel("N m" if column == 0 else "")
    for view in axes[-1]:
        view.set_xlabel("s")
    axes[0, 0].legend(frameon=False, fontsize=8)
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None}, bbox_inches="tight")
    plt.close(figure)


def failures(cases: Iterable[tuple[Case, Runs]]) -> str:
    """State in one sentence on which cases RRA failed."""
    failed = [f"{case.title} ({runs['rra'].failed})" for case, runs in cases if runs["rra"].failed]
    return f"RRA failed on {', '.join(failed)}; these are left out of its rows." if failed else "RRA failed on none."


def document(
    sound: list[tuple[Case, Runs]], faulty: list[tuple[Case, Runs]], measured: dict[str, tuple[Case, Runs]]
) -> str:
    """Return the text of docs/validation/peers.md."""
    of_truth = {
        "truth, sound instruments": [runs for _, runs in sound],
        "truth, faulty instruments": [runs for _, runs in faulty],
    }
    pictures = "\n\n".join(
        f"![Hip flexion, knee and ankle moments of the {case.title}, Kinertia and OpenSim]({picture(name)})"
        for name, (case, _) in measured.items()
    )
    return TEXT.format(
        version=opensim.GetVersion().split("-")[0],
        people=len(sound),
        sound=moments_table(sound),
        faulty=moments_table(faulty),
        truth=figures_table(of_truth),
        measured=figures_table({case.title: [runs] for case, runs in measured.values()}),
        failures=failures([*sound, *faulty, *measured.values()]),
        pictures=pictures,
        spikes=spikes_table(measured),
        fast=f"{FAST_HZ:.0f}",
    )


def picture(name: str) -> str:
    """Return the path of a walk's figure, relative to the documentation."""
    return f"figures/moments_{name}.svg"


TEXT = """# Next to OpenSim

What `kinertia fit --model` gives next to two pipelines of OpenSim {version}, from the same files.

- *IK + ID*: `InverseKinematicsTool`, then `InverseDynamicsTool` with the coordinates low-passed and the forces as
  measured. At truth trials every joint is given its best cutoff of 6, 10 and 12 Hz, which a user could not know; all
  else is at 6 Hz, OpenSim's usual choice.
- *RRA*: `RRATool` with the actuators, tracking weights and 6 Hz filter of OpenSim's gait2354 example. A first pass
  moves the centre of mass of the torso and recommends masses, which are applied; a second pass, with that model,
  changes the motion. Then inverse dynamics of this motion with this model.
- *Kinertia*: `kinertia fit --model`; with `--calibrate`, markers and joint centres of the model may move.

OpenSim's model is scaled to the person's mass; Kinertia is told that mass. All programs are judged at the same frames.

## Truth: joint moments

OpenSim alone made these walks (`validation/truth_trials.py`): the gait2354 walk, walked by {people} people whose body
segment parameters differ from the model's, with soft tissue that moves with the joint angles and 0.3 mm of camera
noise. The true joint moments are known. RMS over both sides and all people.

Sound instruments:

{sound}

With the left plate 20 mm too far forward, forces 10 ms late and the model's hip centres 10 mm off:

{faulty}

The forces of these walks come from a smooth motion. They have no impacts, so these tables cannot say who is right in
the first 50 ms after heel strike.

## Truth: residuals, markers, seconds

Residual: RMS size of the force and of the moment at the pelvis that OpenSim's `InverseDynamicsTool` finds with the
model, motion and ground reactions that each program delivers (OpenSim's leave the laboratory's as they are), forces
unfiltered; the moment is about the axes of tilt, list and rotation. Markers: RMS distance to the measured ones. Seconds
are this machine's, per walk; Kinertia's include its report, OpenSim's one cutoff.

{truth}

## Measured walks

The same for two measured walks, with OpenSim's scaled models and the marker weights of its set-up files.

{measured}

{failures}

## Moments over time

Vertical lines: heel strike (solid) and toe-off (dotted); grey: the foot is on the ground. Kinertia with its default
settings, OpenSim's inverse dynamics with coordinates at 6 Hz and unfiltered forces. Signs are those of the model's
coordinates: hip flexion and ankle dorsiflexion are positive; so is knee extension in gait2354, but knee flexion in
Rajagopal's model.

{pictures}

### Spikes at heel strike

The largest part above {fast} Hz of these moments, within 60 ms of a heel strike and in the rest of stance:

{spikes}

At heel strike the ground reaction rises within a few hundredths of a second. The leg is then braked just as abruptly,
but markers on skin do not show that, and what they show of it the filter of the motion takes away. Inverse dynamics
sees a fast force without the acceleration that goes with it and puts the difference into the joint moments, most at the
knee and the hip, less at the ankle, where little mass lies below the joint (Bisseling and Hof 2006, Journal of
Biomechanics 39:2438). OpenSim's pipeline takes the forces as measured and shows it. Kinertia takes off what of the sum
of both feet's forces is faster than its motion, where that is more than 1 % of body weight, and keeps what one foot
passes to the other; `force_cutoff_hz = "none"` in the subject file keeps everything. A spike that is over 60 ms after
heel strike is not a moment of muscles: do not read peak moments or loading rates from it. Low-passing the forces like
the motion removes the spike, and flattens the true moments with it.
"""


def main(
    people: Annotated[int, typer.Option(help="Truth trials of each kind.")] = 6,
    keep: Annotated[Path | None, typer.Option("--folder", help="Keep all files here.")] = None,
) -> None:
    """Run everything and write the page and its figures."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = keep.resolve() if keep else Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        sound, faulty = (
            [(case, results(case)) for case in (truth_case(folder, FIRST_SEED + k, bad) for k in range(people))]
            for bad in (False, True)
        )
        measured = {name: (case, results(case)) for name, case in measured_cases(folder).items()}
        for name, (case, runs) in measured.items():
            draw(case, runs, PAGES / picture(name))
        write_page("peers", document(sound, faulty, measured))
