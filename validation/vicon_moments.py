"""Compare joint moments with Vicon's own over stance."""

import contextlib
import io
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer

from kinertia.cli.commands import main as kinertia
from kinertia.estimation.result.fit import Fit
from kinertia.report.exports.saved_fit import load_fit
from kinertia.report.pages.vicon_differences import COMPONENTS, corrections
from kinertia.report.wording import INTERVAL_SD
from validation.measured_data import data_folder
from validation.measured_trials import table
from validation.page import write_page
from validation.vicon_curves import agreement, centres_apart_m, curves
from validation.walks import fit_arguments

WALKS = {"Plug-in Gait A": "pig_a", "Plug-in Gait B": "pig_b"}
FOLDERS = {
    "Clinic FMC": "field/fmc",
    "Clinic Sydney": "field/sydney",
    "Clinic MH": "field/mh",
    "Clinic RBWH": "field/rbwh",
    "CGM2.4, no static trial": "field/cgm24",
}
CHILDREN = ("HC002D", "HC030A", "HC032A", "HC036A", "HC038A")
"""Children of one laboratory (biomechZoo), with fits of their straight walks."""
_FEWEST = 20
"""Frames that both have."""
_BESIDE = 1
"""Frames on both sides of a peak that are needed: at the end of a window there is none."""
_LEAST_NM_KG = 0.1
"""Smaller peaks are of legs that are not on a plate."""
_EXPLAINED = ("same axes", "same forces")


def commands(data: Path) -> Iterator[tuple[str, list[str]]]:
    """Yield title and arguments of every fit."""
    for title, walk in WALKS.items():
        yield title, fit_arguments(data, walk)
    for title, folder in FOLDERS.items():
        yield title, [str(data / folder)]
    for child in CHILDREN:
        files = data / "field" / "biomechzoo" / child
        walk, static = str(files / "straight.c3d"), str(files / "static.c3d")
        yield f"Child {child}", [walk, "--static", static, "--sex", "male"]


def fitted(arguments: list[str], out: Path) -> Fit:
    """Fit as a user would, unless it was done before, and read the result."""
    if (out / "fit.json").exists():
        return load_fit(out)
    with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
        kinertia(["fit", *arguments, "-o", str(out), "--quiet"])
    return load_fit(out)


def peaks(stance: pd.DataFrame, corrected: Mapping[str, str]) -> Iterator[tuple[list[str], np.ndarray]]:
    """Yield the row of each leg's joint, with the differences of its peak from Vicon's (3,) N m/kg: as it is, with
    Vicon's centre and axes, and with the forces as measured, too.

    Args:
        stance: frames of all recordings, as `curves` has them.
        corrected: what was corrected in each recording.
    """
    flexion = stance[stance["component"] == COMPONENTS[0]]
    for key, some in flexion.groupby(["recording", "trial", "joint", "side"], sort=False):
        title, trial, joint, side = (str(part) for part in key)
        both: np.ndarray = some["ours"].notna().to_numpy()
        if both.sum() < _FEWEST or not _has_peak(some["vicon"].to_numpy(), both):
            continue
        known = some[both]
        at = known.iloc[int(np.argmax(known["ours"].to_numpy()))]
        off = np.array([known[name].max() for name in ("ours", "vicon_axes", "as_measured")]) - known["vicon"].max()
        ours = f"{at['ours']:.2f} ± {INTERVAL_SD * at['sd']:.2f}"
        leg = {"r": "right", "l": "left"}[side]
        differences = [f"{value:+.2f}" for value in off]
        name = f"{leg} {joint}"
        yield [title, trial, name, f"{known['vicon'].max():.2f}", ours, *differences, corrected[title] or "-"], off


def _has_peak(theirs: np.ndarray, both: np.ndarray) -> bool:
    """Decide whether a curve reaches its largest value within the frames, not at an end of them."""
    at = int(np.argmax(np.where(both, theirs, -np.inf)))
    around = both[max(at - _BESIDE, 0) : at + _BESIDE + 1]
    return bool(theirs[at] >= _LEAST_NM_KG and len(around) == 2 * _BESIDE + 1 and around.all())


def stance_table(stance: pd.DataFrame) -> str:
    """Return the agreement over the stance of every component, where all contact is on plates and where it is not."""
    heads = ["N m/kg", "contact", "frames", "Vicon", "r", "difference", "mean", "SD", "covered", *_EXPLAINED]
    rows = []
    for joint in ("hip", "knee", "ankle"):
        for component in COMPONENTS:
            of_component = stance[(stance["joint"] == joint) & (stance["component"] == component)]
            for inside, name in ((True, "all on plates"), (False, "not all")):
                some = of_component[of_component["inside"] == inside]
                if len(some):
                    rows.append([f"{joint} {component}", name, *_agreement_cells(some)])
    return table(heads, rows)


def _agreement_cells(some: pd.DataFrame) -> list[str]:
    found = agreement(some)
    cells = [f"{found['frames']:.0f}", f"{found['vicon']:.3f}", f"{found['correlation']:.2f}", f"{found['rms']:.3f}"]
    cells += [f"{found['mean']:+.3f}", f"{found['sd']:.3f}", f"{100.0 * found['covered']:.0f} %"]
    return [*cells, f"{found['vicon_axes']:.3f}", f"{found['as_measured']:.3f}"]


def correlations_table(stance: pd.DataFrame) -> str:
    """Return the correlation of each component in every recording."""
    names = [f"{joint} {component}" for joint in ("hip", "knee", "ankle") for component in COMPONENTS]
    rows = []
    for recording, of_recording in stance.groupby("recording", sort=False):
        cells = []
        for name in names:
            joint, component = name.split()
            some = of_recording[(of_recording["joint"] == joint) & (of_recording["component"] == component)]
            cells.append(f"{agreement(some)['correlation']:.2f}" if len(some) else "-")
        rows.append([str(recording), *cells])
    return table(["correlation", *names], rows)


def centres_table(apart: list[tuple[str, np.ndarray]]) -> str:
    """Return how far joint centres are from Vicon's, mean and RMS over legs, mm."""
    rows = []
    for joint in ("hip", "knee", "ankle"):
        of_joint = 1e3 * np.array([value for name, value in apart if name == joint])
        cells = [
            f"{mean:+.0f} ({rms:.0f})"
            for mean, rms in zip(of_joint.mean(0), np.sqrt((of_joint**2).mean(0)), strict=True)
        ]
        rows.append([joint, *cells])
    return table(["mm", "forward", "up", "outward"], rows)


def known_share(stance: pd.DataFrame) -> float:
    """Return the share of Vicon's frames with the leg on a plate in which Kinertia has moments."""
    return float(stance["ours"].notna().mean())


def document(corrected: Mapping[str, str], stance: pd.DataFrame, apart: list[tuple[str, np.ndarray]]) -> str:
    """Return the text of docs/validation/vicon-moments.md."""
    heads = ["recording", "trial", "joint", "Vicon", "Kinertia, 95 %", "difference", *_EXPLAINED, "corrected"]
    compared, means = list(peaks(stance, corrected)), []
    for joint in ("ankle", "knee", "hip"):
        off = np.array([offs for row, offs in compared if row[2].endswith(joint)])
        within = [f"{count} of {len(off)}" for count in (np.abs(off) <= 0.1).sum(axis=0)]
        rms = float(np.sqrt(np.square(off[:, 0]).mean()))
        means.append([joint, within[0], f"{off[:, 0].mean():+.2f}", f"{rms:.2f}", *within[1:]])
    return TEXT.format(
        summary=table(["joint", "within 0.1 N m/kg", "mean", "RMS", *_EXPLAINED], means),
        results=table(heads, [row for row, _ in compared]),
        stance=stance_table(stance),
        correlations=correlations_table(stance),
        centres=centres_table(apart),
        known=f"{100.0 * known_share(stance):.0f}",
        walks=stance.groupby(["recording", "trial"]).ngroups,
        recordings=stance["recording"].nunique(),
    )


TEXT = """# Moments of Vicon

Plug-in Gait's moments in {walks} straight walks of {recordings} people, and Kinertia's in the same axes and with the
same signs: positive where they extend, abduct or rotate externally. Differences are Kinertia's minus Vicon's.

## Over the stance

All frames in which Vicon has moments of a leg whose foot is on a plate; Kinertia has moments in {known} % of these, the
others are steps partly beside a plate. *Vicon*: RMS of its moments. *r*: correlation. *Difference*: RMS. *SD*: RMS of
Kinertia's standard deviation. *Covered*: Vicon's value is in Kinertia's 95 % interval. *Same axes*: RMS difference if
Kinertia's load is taken about Vicon's joint centres, in Vicon's axes (points of the file). *Same forces*: and with the
forces as measured, neither gains nor delay corrected.

{stance}

All recordings together, every component has Vicon's sign. Most differences are above the error bars. Centres, axes and
corrected forces explain most of them: with Vicon's, what remains is at most 22 % of a component at ankle and knee. It
is larger at the hip; segment masses and smoothing, which also differ, were not separated.

Error bars do not hold these differences, and need not: another definition of an axis is another quantity, and Vicon's
joint centres are no truth. Most of all this holds for adduction and rotation of the ankle, where the axes of the feet
differ by up to 25 degrees: of 0.8 N m/kg of plantarflexion, 10 degrees make 0.14. Centres of Kinertia's joints from
Vicon's, means over the trial in the axes of the segment above, mean (RMS) of all legs:

{centres}

Hips are higher and farther out by Kinertia's regression (Bell's) than by Vicon's (Davis'): 20 mm times 0.8 body weights
are 0.16 N m/kg of adduction.

{correlations}

The right shank wand of child HC036A stands in front of the shin. Kinertia does not take the ankle's direction from it
(L108).

## Peaks

Peak extension moments (ankle: plantarflexion), N m/kg, of legs on plates where both reach their peak. *Same axes* and
*same forces* as above: how many are within 0.1 N m/kg of Vicon's then, and by how much each peak differs.

{summary}

About Vicon's ankle centre and axes every ankle peak is within 0.1 N m/kg. Its centre alone, 5 to 22 mm from
Kinertia's, suffices for 25 of 27 (10 mm are 0.1 N m/kg); the other two are right feet whose axes differ by 22 and 26
degrees (Plug-in Gait A, child HC030A). Kinertia's centres may move by their uncertainty to where motion and forces
agree. The rest is corrected gains and delays of plates, which Vicon takes as they are (*corrected*, by more than
two standard deviations): a gain of -3.7 % adds 0.05 N m/kg, and a delay of 11 ms about as much. Hips differ by their
centres (above), and by segment masses and smoothing.

{results}
"""


def main(
    keep: Annotated[Path | None, typer.Option(help="Folder for the fits, which are used again.")] = None,
) -> None:
    """Run all fits and write the page."""
    data, corrected, stance, apart = data_folder(), {}, [], []
    with tempfile.TemporaryDirectory() as folder:
        for title, arguments in commands(data):
            fit = fitted(arguments, (keep or Path(folder)) / title.replace(" ", "-"))
            corrected[title] = corrections(fit)
            stance += list(curves(title, fit))
            apart += list(centres_apart_m(fit))
            print(title, flush=True)
    write_page("vicon-moments", document(corrected, pd.concat(stance, ignore_index=True), apart))
