"""What the simultaneous estimate says of the measured walks, for its section of docs/validation/accuracy.md."""

import tempfile
from pathlib import Path
from typing import Any

from validation.measured_trials import farthest, results, table
from validation.walks import WALKS


def measured_walk(name: str) -> dict[str, Any]:
    """Return fit.json of a measured walk, its BSP table, and its largest departure from the literature in prior SDs."""
    with tempfile.TemporaryDirectory() as folder:
        run = results(name, Path(folder) / name)
    run["worst"] = farthest(run["bsp"])
    return run


def measured_section(runs: dict[str, dict[str, Any]]) -> str:
    """Describe the estimates from the measured walks."""
    rows = []
    for name, run in runs.items():
        (trial,) = run["trials"]
        markers, mass = trial["marker_rms_m"], run["total_mass_kg"]
        force, moment = (trial[f"residual_{kind}"]["estimate"] for kind in ("force_rms_N", "moment_rms_Nm"))
        rows.append([WALKS[name], f"{force:.1f}", f"{moment:.1f}"])
        rows[-1] += [f"{1e3 * markers['ik']:.1f}", f"{1e3 * markers['final']:.1f}"]
        rows[-1] += [f"{mass['estimate']:.2f} ({mass['measured']:.1f})", run["worst"], str(run["iterations"])]
        rows[-1] += ["yes" if run["converged"] else "no", f"{trial['seconds']['estimate']:.2f}"]
    headings = ["walk", "force (N)", "moment (N m)", "markers, IK (mm)", "markers, estimate (mm)"]
    headings += ["total mass (scale; kg)", "farthest from the literature (prior sd)", "steps", "converged", "s"]
    return table(headings, rows)
