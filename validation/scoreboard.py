"""Rank programs by residuals, and show what these hide.

The table that AddBiomechanics and RRA are judged by, on recordings at hand: markers and residuals of each program, by
several definitions. Below it, from the pages that have them, what residuals cannot show.
"""

import re
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import opensim
import pandas as pd
import typer

from kinertia.io.text.sto import read_sto
from validation.measured_data import data_folder
from validation.measured_trials import table
from validation.opensim_runs import inverse_dynamics, quietly
from validation.page import PAGES, write_page
from validation.peer_cases import Case, Result, marker_errors, measured_cases, results
from validation.peers import PROGRAMS, Residuals, Runs, at

THEIRS = "addbiomechanics"
PROGRAMS_HERE = {**PROGRAMS, THEIRS: "AddBiomechanics, inverse kinematics"}
ORDER = ("opensim", THEIRS, "rra", "default", "calibrated")


def cases(folder: Path) -> Iterator[tuple[Case, Path | None]]:
    """Yield recordings that have a scaled model and loads, each with AddBiomechanics' motion where there is one."""
    for case in measured_cases(folder).values():
        yield case, None
    data, fits = data_folder(), {"default": (), "calibrated": ("--calibrate",)}
    for name in ("walking1", "walking2"):
        case_folder, at_home = folder / f"subject4-{name}", data / "subject4"
        case_folder.mkdir(exist_ok=True)
        loads = _on_both_feet(at_home / f"{name}_external_forces.xml", case_folder / "loads_declared.xml")
        motion = at_home / f"addbiomechanics_{name}_ik.mot"
        title, model = f"subject4, {name}", at_home / "addbiomechanics_scaled.osim"
        walk, forces = at_home / f"{name}.trc", at_home / f"{name}_grf.mot"
        yield Case(title, case_folder, model, walk, forces, loads, 62.6, fits), motion if motion.exists() else None
    case_folder, at_home = folder / "hamner", data / "field" / "hamner_run"
    case_folder.mkdir(exist_ok=True)
    model, walk = at_home / "subject02_registered.osim", at_home / "subject02_running.trc"
    forces, loads, setup = (
        at_home / name for name in ("subject02_running_grf.mot", "External_Loads.xml", "Setup_IK.xml")
    )
    yield Case("Hamner, run at 4 m/s", case_folder, model, walk, forces, loads, 65.9, fits, setup), None


def _on_both_feet(loads: Path, out: Path) -> Path:
    """Copy the loads of subject4, whose file has both plates under the right foot, with the second under the left."""
    tree = ET.parse(loads)
    for force, body in zip(tree.iter("ExternalForce"), ("calcn_r", "calcn_l"), strict=True):
        for element in force.iter("applied_to_body"):
            element.text = body
    tree.write(out)
    return out


def delivered_by_addbiomechanics(case: Case, motion: Path, time: np.ndarray) -> Result:
    """Run OpenSim's inverse dynamics with the motion and the model that AddBiomechanics delivered."""
    work, result = case.folder / "opensim", Result()
    with quietly(work / "opensim.log"):
        moments = inverse_dynamics(work / "model.osim", motion, work / "loads.xml", work / "theirs.sto", 6)
        result.marker_rms_m = marker_errors(case, case.model, motion, time)
    result.opensim = moments
    return result


def peak_force_n(case: Case, time: np.ndarray) -> float:
    """Return the largest ground reaction of a foot at these times."""
    forces = read_sto(case.forces)
    stems = [str(name)[:-2] for name in forces if re.search(r"_vy$", str(name))]
    sizes = [np.sqrt(sum(at(forces, f"{stem}v{axis}", time) ** 2 for axis in "xyz")) for stem in stems]
    return float(np.max(sizes))


def rows(case: Case, runs: Runs) -> list[list[str]]:
    """Return the table's rows of one recording."""
    cells, largest = [], peak_force_n(case, runs["time"])
    for program in (program_name for program_name in ORDER if program_name in runs):
        result, row = runs[program], [case.title, PROGRAMS_HERE[program]]
        if result.failed or result.opensim is None:
            cells.append([*row, "failed", *[""] * 6])
            continue
        force, moment = (Residuals.of(result.opensim, runs["time"], kind) for kind in ("force", "moment"))
        row += [f"{100.0 * result.marker_rms_m:.2f}", f"{force.rms:.1f}", f"{force.component:.1f}"]
        row += [f"{100.0 * force.rms / largest:.2f}", f"{moment.rms:.1f}", f"{moment.component:.1f}"]
        cells.append([*row, f"{100.0 * force.peak / largest:.1f}"])
    return cells


def tables_of(page: str) -> list[pd.DataFrame]:
    """Read the tables of a page of evidence, in order; cells are text.

    >>> parsed("| a | b |\\n| --- | --: |\\n| x | 3 % |")[0].loc[0, "b"]
    '3 %'
    """
    return parsed((PAGES / f"{page}.md").read_text(encoding="utf-8"))


def parsed(text: str) -> list[pd.DataFrame]:
    """Read the Markdown tables of a text."""
    tables = []
    for block in re.findall(r"(?:^\|.*\|$\n?)+", text, flags=re.MULTILINE):
        heads, _, *lines = ([cell.strip() for cell in line.strip("|").split("|")] for line in block.splitlines())
        tables.append(pd.DataFrame(lines, columns=heads))
    return tables


def hidden() -> list[list[str]]:
    """Return rows of what residuals cannot show: question, figure, page."""
    held = next(candidate for candidate in tables_of("held-out") if "force (N)" in candidate)
    pairs = held["force (N)"].str.split(" -> ", expand=True).astype(float)
    before, after = (float(np.sqrt((pairs[k] ** 2).mean())) for k in (0, 1))
    sessions = pd.concat(
        [sessions_table for sessions_table in tables_of("sessions") if "chi2/n, mean" in sessions_table]
    )
    count = sessions["unknowns"].astype(float)
    agreed = float((sessions["chi2/n, mean"].astype(float) * count).sum() / count.sum())
    apart = float((sessions["beyond 99 %"].astype(float)).sum() / count.sum())
    skin = tables_of("measured-skin")[0]
    ratios = skin["ratio"].astype(float)
    shares = skin.iloc[:, [*skin].index("covered")].str.rstrip(" %").astype(float)  # the first: not after heel strike
    return [
        [
            "residual force of a trial that the estimate has not seen",
            f"{after:.1f} N (the model's own parameters: {before:.1f} N)",
            "[held-out trials](held-out.md)",
        ],
        [
            "do trials of one session agree? chi2 per degree of freedom, at most 1 if bars hold",
            f"{agreed:.2f}; {100.0 * apart:.1f} % of {count.sum():.0f} unknowns beyond 99 %",
            "[sessions](sessions.md)",
        ],
        [
            "joint moments through skin as measured on a person, errors over those of OpenSim at its best cutoff",
            f"{ratios.min():.2f} to {ratios.max():.2f}",
            "[measured skin](measured-skin.md)",
        ],
        [
            "true joint moments within their 95 % intervals there",
            f"{shares.min():.0f} to {shares.max():.0f} %",
            "[measured skin](measured-skin.md)",
        ],
    ]


def document(runs: Sequence[tuple[Case, Runs]]) -> str:
    """Return the text of docs/validation/scoreboard.md."""
    heads = ["recording", "program", "markers (cm)", "force (N)", "a component (N)", "force (% of peak load)"]
    heads += ["moment (N m)", "a component (N m)", "largest force (% of peak load)"]
    shown = [row for case, programs in runs for row in rows(case, programs)]
    failed = [f"{case.title}: {programs['rra'].failed}" for case, programs in runs if programs["rra"].failed]
    return TEXT.format(
        results=table(heads, shown),
        failed=f"RRA gave no result on {'; '.join(failed)}." if failed else "RRA failed on none.",
        hidden=table(["what residuals cannot show", "Kinertia", "from"], hidden()),
        version=opensim.GetVersion().split("-")[0],
    )


TEXT = """# Scoreboard

Programs are usually compared by what they leave of the equations of motion: residuals at the pelvis, and distances of
markers. Below are both, of recordings that come with a scaled OpenSim model, from the same files and in the same
frames, with OpenSim {version}.

- *markers*: RMS distance of measured markers from the model's, over frames and markers.
- *force, moment*: RMS over frames of the size of the residual that OpenSim's inverse dynamics finds at the pelvis,
  with forces unfiltered, from the model, motion and loads that a program delivers. The moment is about the pelvis'
  origin.
- *a component*: mean of the absolute value of one of its three components. Summaries that say *average residual* mean
  either. The same data give 1.7 to 3 times more by size. Moments about the laboratory's origin instead of the pelvis
  are larger again, several times where the person is metres away. Figures of two papers cannot be compared unless both
  say which they used.
- *of peak load*: relative to the largest ground reaction of a foot.

{results}

{failed} Its settings are those of OpenSim's gait2354 example, which is a walk.

*AddBiomechanics, inverse kinematics*: the motion that it delivered for this walk, low-passed at 6 Hz, with the model
that it scaled; its dynamic fit is not among the files. Its paper
([Werling et al. 2023](https://doi.org/10.1371/journal.pone.0295152)) has this table for Hamner's, Arnold's and
Uhlrich's people. They are not repeated here: those recordings are not among these, and different ones cannot be ranked
in one table.

Residuals can be made as small as one likes: by moving the person, as RRA does, by changing the body, or by giving
the forces to the pelvis. They are therefore no measure of whether joint moments are right. These are:

{hidden}

No other program states error bars, so there is no column for one.
"""


def main(
    keep: Annotated[Path | None, typer.Option("--folder", help="Keep all files here, and use those that are.")] = None,
) -> None:
    """Run all programs on all recordings and write the page."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = keep.resolve() if keep else Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        runs = []
        for case, motion in cases(folder):
            result = results(case)
            if motion is not None:
                result[THEIRS] = delivered_by_addbiomechanics(case, motion, result["time"])
            runs.append((case, result))
            print("\n".join(" | ".join(row) for row in rows(case, result)), flush=True)
        write_page("scoreboard", document(runs))
