"""Compare moments at ends of recordings to the truth."""

import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer

from kinertia.io.text.sto import read_sto, write_sto
from kinertia.io.text.trc import read_trc, write_trc
from kinertia.motion.joint_moments import joint_and_side
from kinertia.motion.kinematics import END_PERIODS
from kinertia.workflow.from_files import fit_subject
from validation.measured_trials import table
from validation.whole_stance import FIRST_SEED, LEG, LUMBAR, PEOPLE

CUTS = 6
_LASTS_S, _LAST_S, _ROUNDING_S = 1.2, 0.02, 1e-6
_ZONES = ("last 20 ms", "to half a period", "elsewhere")
_SUBJECT = """[subject]
mass_kg = {mass_kg:.1f}

[[trial]]
markers = "walk.trc"
forces = "walk_grf.mot"
loads = "../loads.xml"

[model]
osim = "../model.osim"
"""


def errors(seed: int, cuts: int, off: bool) -> pd.DataFrame:
    """Return the errors of a person's joint moments in random cuts of the recording, in which all steps are on plates.

    Columns: `what` ("knee adduction"), `zone`, `error` and `sd` (N m).
    """
    from validation.stance_walks import estimated_moments, true_moments
    from validation.truth_trials import Faults, disturbed, gait2354, make_trial

    random, parts = np.random.default_rng(seed), []
    with tempfile.TemporaryDirectory() as temporary:
        walk = Path(temporary)
        make_trial(walk, seed, Faults(), gait2354())
        truth, forces = true_moments(walk), read_sto(walk / "truth" / "forces.mot")
        forces = disturbed(forces, Faults(plate_m=0.020, lag_s=0.010)) if off else forces
        markers = read_trc(walk / "walk.trc")
        mass_kg = float(pd.read_json(walk / "truth" / "truth.json", typ="series")["total_mass_kg"])
        for number in range(cuts):
            start = markers.time[0] + random.uniform(0.0, np.ptp(markers.time) - _LASTS_S)
            cut, folder = markers.cut(start, start + _LASTS_S), walk / f"cut{number}"
            during = (forces.index > cut.time[0] - _ROUNDING_S) & (forces.index < cut.time[-1] + _ROUNDING_S)
            folder.mkdir()
            write_trc(folder / "walk.trc", cut)
            write_sto(folder / "walk_grf.mot", forces[during], False, "walk_grf")
            (folder / "subject.toml").write_text(_SUBJECT.format(mass_kg=mass_kg), encoding="utf-8")
            trial = fit_subject(folder / "subject.toml").trials[0]
            values, sd = estimated_moments(trial)
            away_s = np.minimum(values.index - cut.time[0], cut.time[-1] - values.index).to_numpy()
            inner = away_s >= END_PERIODS / trial.kinematics.cutoff_hz
            zone = np.where(away_s < _LAST_S, _ZONES[0], np.where(inner, _ZONES[2], _ZONES[1]))
            for name in values:
                joint, _, component = str(name).rpartition("_")
                true = np.interp(values.index, truth.index, truth[name])
                rows = {"zone": zone, "error": values[name] - true, "sd": sd[name]}
                parts.append(pd.DataFrame(rows).assign(what=f"{joint_and_side(joint)[0]} {component}").dropna())
    return pd.concat(parts, ignore_index=True)


def document(found: pd.DataFrame) -> str:
    """Return the table: RMS error, SD over error and coverage per component and zone."""
    rows = []
    for what in (*LEG, *LUMBAR):
        row = [what]
        for zone in _ZONES:
            here = found[(found["what"] == what) & (found["zone"] == zone)]
            error, sd = (float(np.sqrt(np.square(here[name]).mean())) for name in ("error", "sd"))
            covered = float((here["error"].abs() < 1.959964 * here["sd"]).mean())
            row += [f"{error:.2f}", f"{sd / error:.1f}", f"{100.0 * covered:.0f}"]
        rows.append(row)
    heads = [f"{zone}: {figure}" for zone in _ZONES for figure in ("error (N m)", "SD / error", "covered (%)")]
    return table(["component", *heads], rows)


def gathered(seeds: Sequence[int], cuts: int, off: bool) -> pd.DataFrame:
    """Return the errors of all people, each in a process of its own: OpenSim does not free its memory."""
    with ProcessPoolExecutor(1, get_context("spawn"), max_tasks_per_child=1) as pool:
        return pd.concat(list(pool.map(partial(errors, cuts=cuts, off=off), seeds)), ignore_index=True)


def main(
    people: Annotated[int, typer.Option(help="Number of people.")] = PEOPLE,
    cuts: Annotated[int, typer.Option(help="Number of cuts of each person's walk.")] = CUTS,
    off: Annotated[bool, typer.Option(help="Left plate 20 mm off, forces 10 ms late.")] = False,
) -> None:
    """Fit walks made by OpenSim, cut at both ends, and print the table; needs OpenSim."""
    print(document(gathered(range(FIRST_SEED, FIRST_SEED + people), cuts, off)))
