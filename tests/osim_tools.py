"""OpenSim's own tools, run on files."""

from pathlib import Path

import pandas as pd

from kinertia.io.text.sto import read_sto


def inverse_dynamics_tool(opensim, model: Path, coordinates: Path, loads: Path, folder: Path) -> pd.DataFrame:
    """What OpenSim's Inverse Dynamics writes, without its muscles and its filter."""
    tool = opensim.InverseDynamicsTool()
    tool.setModelFileName(str(model))
    tool.setCoordinatesFileName(str(coordinates))
    tool.setExternalLoadsFileName(str(loads))
    tool.setLowpassCutoffFrequency(-1)
    forces = opensim.ArrayStr()
    forces.append("Muscles")
    tool.setExcludedForces(forces)
    tool.setResultsDir(str(folder))
    tool.setOutputGenForceFileName("id.sto")
    assert tool.run()
    return read_sto(folder / "id.sto")
