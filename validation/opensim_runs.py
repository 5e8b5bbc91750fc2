"""OpenSim's inverse kinematics and inverse dynamics on files, without its chatter."""

import contextlib
import os
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np
import opensim
import pandas as pd

from kinertia.io.text.sto import read_sto
from kinertia.io.text.trc import read_trc

WHOLE = (-np.inf, np.inf)


@contextlib.contextmanager
def quietly(log: Path) -> Iterator[None]:
    """Redirect to a file what this process prints, including C code."""
    opensim.Logger.removeFileSink()
    sys.stdout.flush()
    sys.stderr.flush()
    kept = os.dup(1), os.dup(2)
    with log.open("ab") as file:
        try:
            for stream in (1, 2):
                os.dup2(file.fileno(), stream)
            yield
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            for stream, old in zip((1, 2), kept, strict=True):
                os.dup2(old, stream)
                os.close(old)


def vector(values: Iterable[float]) -> opensim.Vec3:
    """Convert an array to a Vec3."""
    return opensim.Vec3(*map(float, values))


def radians(model: opensim.Model, motion: Path) -> pd.DataFrame:
    """Read a motion file's coordinates in the model's order, in rad and m; those it lacks are left out."""
    table = read_sto(motion)
    coordinates = model.getCoordinateSet()
    columns = {}
    for coordinate in (coordinates.get(k) for k in range(coordinates.getSize())):
        if coordinate.getName() in table:
            turns = table.attrs["in_degrees"] and coordinate.getMotionType() == 1
            columns[coordinate.getName()] = table[coordinate.getName()] * (np.pi / 180 if turns else 1)
    return pd.DataFrame(columns)


def inverse_kinematics(
    model: opensim.Model,
    markers: Path,
    motion: Path,
    weights: Mapping[str, float] | None = None,
    span_s: tuple[float, float] = WHOLE,
) -> None:
    """Run OpenSim's InverseKinematicsTool; every marker of the model has weight 1 unless weights are given."""
    recorded = read_trc(markers)
    tool = opensim.InverseKinematicsTool()
    tool.setModel(model)
    tool.setMarkerDataFileName(str(markers))
    tool.setStartTime(max(float(recorded.time[0]), span_s[0]))
    tool.setEndTime(min(float(recorded.time[-1]), span_s[1]))
    known = model.getMarkerSet()
    for name in (known.get(k).getName() for k in range(known.getSize())):
        if name in recorded.labels and (weights is None or name in weights):
            task = opensim.IKMarkerTask()
            task.setName(name)
            task.setApply(True)
            task.setWeight(1.0 if weights is None else weights[name])
            tool.upd_IKTaskSet().cloneAndAppend(task)
    tool.setOutputMotionFileName(str(motion))
    tool.setResultsDir(str(motion.parent))
    tool.set_report_errors(False)
    tool.run()


def setup_weights(setup: Path) -> dict[str, float]:
    """Read marker weights from an inverse kinematics set-up file; markers that it does not use are left out."""
    weights = {}
    for task in ET.parse(setup).iter("IKMarkerTask"):
        weight = float(task.findtext("weight", "0"))
        if task.findtext("apply", "").strip() == "true" and weight > 0:
            weights[task.get("name", "")] = weight
    return weights


def inverse_dynamics(model: Path, motion: Path, loads: Path, out: Path, cutoff_hz: float = -1.0) -> pd.DataFrame:
    """Run OpenSim's InverseDynamicsTool: coordinates low-passed (or not: -1), forces unfiltered, no muscles."""
    time = read_sto(motion).index
    tool = opensim.InverseDynamicsTool()
    tool.setModelFileName(str(model))
    tool.setCoordinatesFileName(str(motion))
    tool.setExternalLoadsFileName(str(loads))
    tool.setLowpassCutoffFrequency(cutoff_hz)
    tool.setStartTime(float(time[0]))
    tool.setEndTime(float(time[-1]))
    tool.setResultsDir(str(out.parent))
    tool.setOutputGenForceFileName(out.name)
    without = opensim.ArrayStr()
    without.append("Muscles")
    tool.setExcludedForces(without)
    tool.run()
    return read_sto(out)


def without_forces(model: Path, out: Path, mass_kg: float | None = None) -> None:
    """Copy the model without muscles and other forces, all bodies scaled to a total mass if one is given."""
    copy = opensim.Model(str(model))
    copy.updForceSet().clearAndDestroy()
    copy.updControllerSet().clearAndDestroy()
    copy.finalizeConnections()
    state = copy.initSystem()
    if mass_kg is not None:
        factor = mass_kg / copy.getTotalMass(state)
        for k in range(copy.getBodySet().getSize()):
            copy.updBodySet().get(k).scaleMass(factor)
    copy.printToXML(str(out))


def with_forces_file(loads: Path, forces: Path, out: Path) -> None:
    """Copy an ExternalLoads file with this forces file as its only reference outside."""
    tree = ET.parse(loads)
    (external,) = tree.iter("ExternalLoads")
    for tag in ("external_loads_model_kinematics_file", "datafile"):
        for old in external.findall(tag):
            external.remove(old)
    ET.SubElement(external, "datafile").text = str(forces)
    tree.write(out)


def marker_rms_m(model: Path, motion: Path, markers: Path, time: np.ndarray, names: Iterable[str]) -> float:
    """Compute the RMS distance (m) between the model's and the measured markers at the given times."""
    posed = opensim.Model(str(model))
    state = posed.initSystem()
    coordinates = radians(posed, motion)
    recorded = read_trc(markers)
    names = [name for name in names if name in recorded.labels]
    columns = [recorded.labels.index(name) for name in names]
    distances = []
    for moment in time:
        for name in coordinates:
            coordinate = posed.getCoordinateSet().get(name)
            if not coordinate.getLocked(state):
                coordinate.setValue(state, np.interp(moment, coordinates.index, coordinates[name]), False)
        posed.realizePosition(state)
        measured = recorded.positions[int(np.argmin(np.abs(recorded.time - moment))), columns]
        places = [posed.getMarkerSet().get(name).getLocationInGround(state).to_numpy() for name in names]
        distances.append(np.sum((np.array(places) - measured) ** 2, axis=1))
    return float(np.sqrt(np.nanmean(distances)))
