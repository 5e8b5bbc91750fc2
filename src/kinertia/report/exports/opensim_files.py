"""Writes ground reactions and posterior draws as OpenSim's files."""

from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np

from kinertia.io.output_folder import write_then_rename
from kinertia.io.text.sto import TimeTable, write_table
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.trial.data import FEET

_MARGIN = 12
"""Samples outside the motion's time."""
FORCES_FILE, LOADS_FILE = "ground_reactions.mot", "external_loads.xml"


def write_ground_reactions(
    folder: Path, reactions: GroundReactions, window_s: tuple[float, float], feet: Sequence[str], remark: str = ""
) -> None:
    """Write `ground_reactions.mot` and `external_loads.xml`.

    Per foot: force (N), the point on the ground where it acts (m), torque there (N m), in ground axes. Without load the
    point is constant at its nearest loaded position: OpenSim fits splines to the columns, which would oscillate at a
    jump.

    Args:
        folder: folder to write to.
        reactions: reactions on the motion's time base.
        window_s: first and last time of the motion; some samples outside are also written, since splines are inaccurate
            at their ends.
        feet: bodies on which the right and the left foot's forces act.
        remark: a line of the header.
    """
    first, last = np.searchsorted(reactions.time, window_s)
    rows = slice(max(int(first) - _MARGIN, 0), int(last) + _MARGIN)
    columns: dict[str, np.ndarray] = {}
    for foot, side in enumerate(FEET):
        force = reactions.wrench[:, foot, :3]
        point = reactions.point[:, foot]
        for stem, values in (("force_{}_v", force), ("force_{}_p", point), ("torque_{}_", reactions.torque[:, foot])):
            columns |= {f"ground_{stem.format(side)}{axis}": values[rows, k] for k, axis in enumerate("xyz")}
    table = TimeTable(reactions.time[rows], tuple(columns), np.column_stack(list(columns.values())), False)
    write_table(folder / FORCES_FILE, table, "ground_reactions", remark)
    write_then_rename(folder / LOADS_FILE, _external_loads(feet))


def _external_loads(feet: Sequence[str]) -> str:
    forces = [
        f'''      <ExternalForce name="{name}_foot">
        <applied_to_body>{escape(body, quote=False)}</applied_to_body>
        <force_expressed_in_body>ground</force_expressed_in_body>
        <point_expressed_in_body>ground</point_expressed_in_body>
        <force_identifier>ground_force_{side}_v</force_identifier>
        <point_identifier>ground_force_{side}_p</point_identifier>
        <torque_identifier>ground_torque_{side}_</torque_identifier>
      </ExternalForce>'''
        for name, side, body in zip(("right", "left"), FEET, feet, strict=True)
    ]
    return "\n".join(
        [
            '<?xml version="1.0" encoding="UTF-8" ?>',
            '<OpenSimDocument Version="40000">',
            '  <ExternalLoads name="ground_reactions">',
            "    <objects>",
            *forces,
            "    </objects>",
            "    <groups />",
            f"    <datafile>{FORCES_FILE}</datafile>",
            "  </ExternalLoads>",
            "</OpenSimDocument>",
            "",
        ]
    )
