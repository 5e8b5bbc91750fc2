"""Reads ground reaction forces from MOT/STO files: with or without ExternalLoads, and with any torque columns.

A force file has a point of application for each torque, and only the program that wrote it ensures that they match. By
definition the torque about the centre of pressure has no horizontal part: in eleven correct force files the median is
0.0 mm times the vertical force, the 99th percentile at most 10 mm (where forces are smallest). Torques about the middle
of the plate do have horizontal parts, of some 20 mm and more. A point that never moves (the plate's middle, the origin)
is not a centre of pressure: force and torque are then what acts at that point, which is no error.

Free moments may also be in another plate's columns: they follow the load of that plate. An unloaded plate has no free
moment. While the other foot alone carries the person, correct force files have at most 0.2 times the free moment that
they have while the plate's own foot does (RMS; filters and amplifiers leave some), files with interchanged columns at
least 5 times. What a file holds for an unloaded plate may also be a ratio of two noise signals, but that is as large
while neither plate is loaded, or jumps from sample to sample. Where both plates are always loaded, nothing is reported.
"""

import re
import xml.etree.ElementTree as ElementTree  # nosec B405 - expat reads no files and bounds entities
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path, PureWindowsPath

import numpy as np

from kinertia.errors import FileError, expect_file, mismatch
from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.quantity import Quantity, Where
from kinertia.io.file_names import path_from
from kinertia.io.text.number_table import uniform_times
from kinertia.io.text.sto import TimeTable, read_table
from kinertia.model.anatomy import segment_of
from kinertia.trial.data import LOAD_THRESHOLD_N, BoolArray, FloatArray, PlateLoads
from kinertia.trial.file_contents import TorqueColumns
from kinertia.trial.ground_contact import FIRM_LOAD_N
from kinertia.trial.plate_loading import PlateLoad, joined, largest_n, without_unloaded_level
from kinertia.trial.plate_signals import without_spikes
from kinertia.trial.sampled_data import impossible_load, rms

_FOOT_WORDS = {"r": "r", "right": "r", "l": "l", "left": "l"}
_FEWEST = 20
_MOVES_M = 0.02
"""Least movement of a centre of pressure: it moves by 0.2 m under a foot that lands and leaves, by 0.1 m in squats."""
_FEWEST_ALONE = 10
_SOME_NM, _LITTLE, _LONGEST_ARM_M = 0.2, 0.5, 0.034
"""Limits: RMS of a free moment; share of it while the plate is unloaded; free moment over vertical force (95th
percentile, m)."""
_JUMPS = 0.7
"""RMS of the changes from sample to sample over that of the values: 1.4 of noise, 0.003 to 0.44 of free moments."""


@dataclass(frozen=True)
class _Columns:
    """Columns of one plate's load: each identifier is followed by x, y, z."""

    name: str
    force: str
    point: str
    torque: str | None
    foot: str | None


def read_forces(
    mot_path: str | Path | None, loads_path: str | Path | None = None, turn: FloatArray | None = None
) -> tuple[PlateLoads, tuple[Finding, ...]]:
    """Read force plates from a MOT or STO file: force and point of application in ground axes, N, m, N m.

    With an ExternalLoads file its identifiers state the columns and its bodies the foot that each claims (a
    claim only); its own `datafile` is used only when `mot_path` is None. Without one, columns are recognised
    by name: `ground_force_vx`, `1_ground_force_vx`, `ground_force_r_vx`, `ground_force_1_vx` and the like,
    with the point `..._px` and the torque `..._mx`, `ground_torque_...x` or `ground_moment_...mx`.

    Below `LOAD_THRESHOLD_N` of vertical force the point of application is garbage: such samples are set to zero, unless
    they are how a load begins or ends (`plate_loading`). Where no torque is given, the free moment is zero.
    Times that were rounded when written are put back on the even grid they came from.

    Args:
        mot_path, loads_path: the files.
        turn: rotation (3, 3) from the axes of the file to ground axes, where these differ.

    Returns:
        the plates, and what was assumed while reading.

    Raises:
        FileError: a file is missing or broken, a required column is missing, a load is not expressed in ground or acts
            on a segment other than a foot, time does not increase, a loaded sample is NaN, or the forces point down.
    """
    findings: tuple[Finding, ...] = ()
    if loads_path is None:
        if mot_path is None:
            raise ValueError("read_forces needs a force file or an ExternalLoads file")
        path = Path(mot_path)
        table = read_table(path)
        groups = _groups_by_name(path, table)
    else:
        loads_path = Path(loads_path)
        root = _external_loads(loads_path)
        groups, findings = _groups_by_identifier(root, loads_path)
        path, more = (Path(mot_path), ()) if mot_path is not None else _datafile(root, loads_path)
        findings += more
        table = read_table(path)
        _expect_columns(groups, table, path, loads_path)
    _expect_different(groups, table, path)
    time, time_findings = uniform_times(path, table.time)
    table = replace(table, time=time, values=table.values[: len(time)])
    turn = np.eye(3) if turn is None else turn
    plates = [_plate_load(path, table, group, turn) for group in groups]
    loads = joined(table.time, [group.name for group in groups], [group.foot for group in groups], plates)
    loads = replace(loads, torques=torque_columns(*_stated(table, groups, turn)))
    return loads, (*findings, *table.findings, *time_findings)


def _plate_load(path: Path, table: TimeTable, group: _Columns, turn: FloatArray) -> PlateLoad:
    """Return force (k, 3) and moment about the ground origin (k, 3), zero while the plate is unloaded."""
    force = _triple(table, group.force) @ turn.T
    _expect_numbers(path, table, group, group.force, np.ones(len(force), dtype=bool))
    moment = np.cross(np.nan_to_num(_triple(table, group.point)) @ turn.T, force)
    if group.torque is not None:
        moment = moment + np.nan_to_num(_triple(table, group.torque)) @ turn.T
    force, moment, spikes = without_spikes(table.time, force, moment)
    up, largest = int(np.argmax(turn[1])), int(np.argmax(np.abs(force @ turn).max(axis=0)))
    if largest == 1 != up:
        peaks = tuple(map(float, np.abs(force @ turn).max(axis=0)))
        axes = {
            "peak_n": Quantity(peaks, "N"),
            "axis": Quantity("Y"),
            "vertical": Quantity("XYZ"[up]),
            "column": Quantity(f"{group.force}y"),
        }
        raise FileError.found(path, "P201", None, Where(plate=group.name), **axes)
    if largest_n(table.time, force) < -LOAD_THRESHOLD_N:
        down = {"force_n": Quantity(float(force[:, 1].min()), "N"), "column": Quantity(f"{group.force}{'xyz'[up]}")}
        raise FileError.found(path, "F157", None, Where(plate=group.name), **down)
    plate = without_unloaded_level(table.time, force, moment)._replace(spikes=spikes)
    for identifier in filter(None, (group.point, group.torque)):
        _expect_numbers(path, table, group, identifier, plate.force[:, 1] >= LOAD_THRESHOLD_N)
    return plate


def _stated(table: TimeTable, groups: Sequence[_Columns], turn: FloatArray) -> list[FloatArray]:
    """Return forces, points and torques (k, p, 3) as stated in the file, in ground axes; missing ones are zero."""
    zero = np.zeros((len(table.time), 3))
    identifiers = ((group.force, group.point, group.torque) for group in groups)
    return [
        np.stack(
            [zero if identifier is None else _triple(table, identifier) @ turn.T for identifier in of_quantity], axis=1
        )
        for of_quantity in zip(*identifiers, strict=True)
    ]


def _triple(table: TimeTable, identifier: str) -> FloatArray:
    return table.columns([identifier + axis for axis in "xyz"])


def _expect_numbers(path: Path, table: TimeTable, group: _Columns, identifier: str, where: np.ndarray) -> None:
    broken = np.argwhere(np.isnan(_triple(table, identifier)) & where[:, None])
    if broken.size:
        row, axis = broken[0]
        column = f"column {identifier}{'xyz'[axis]}"
        raise FileError.of(path, impossible_load(group.name, column, float(table.time[row])))


def _groups_by_name(path: Path, table: TimeTable) -> list[_Columns]:
    columns = list(table.labels)
    forces = [c[:-1] for c in columns if c.endswith("vx") and {c[:-1] + "y", c[:-1] + "z"} <= set(columns)]
    written = {label[:-1].lower(): label[:-1] for label in columns}
    groups = []
    for force in forces:
        stem = force[:-1]
        if not _has(table, stem + "p"):
            expected = Quantity(f"{stem}px, {stem}py and {stem}pz, or an ExternalLoads file")
            raise FileError.found(path, "F142", force=Quantity(f"{force}x"), expected=expected)
        candidates = [stem + "m", stem + "t"]
        turned = (re.sub("force", word, stem, flags=re.IGNORECASE) for word in ("torque", "moment"))
        candidates += [other + end for other in turned for end in ("", "m", "t")]
        wanted = (written.get(c.lower()) for c in candidates if c != stem)
        torque = next((c for c in wanted if c is not None and _has(table, c)), None)
        words = re.split(r"[_\W]+", stem.lower())
        feet = {_FOOT_WORDS[word] for word in words if word in _FOOT_WORDS}
        groups.append(_Columns(stem.strip("_ "), force, stem + "p", torque, feet.pop() if len(feet) == 1 else None))
    if not groups:
        raise FileError.found(path, "F141", columns=Quantity(_listed(columns)))
    return groups


def _has(table: TimeTable, identifier: str) -> bool:
    return all(identifier + axis in table.labels for axis in "xyz")


def _listed(columns: Sequence[str]) -> str:
    return ", ".join(columns[:40]) + (" ..." if len(columns) > 40 else "")


def _external_loads(path: Path) -> ElementTree.Element:
    expect_file(path)
    try:
        root = ElementTree.parse(path).getroot()  # nosec B314 - as above
    except ElementTree.ParseError as error:
        raise mismatch(path, "XML", str(error), "an ExternalLoads file", error.position[0]) from None
    except (LookupError, ValueError) as error:  # what Python's codecs say of its encoding
        raise mismatch(path, "XML", str(error), "UTF-8", 1) from None
    if root.find(".//ExternalForce") is None:
        raise mismatch(path, "an ExternalLoads file", "no ExternalForce", "one for each load")
    return root


def _datafile(root: ElementTree.Element, loads_path: Path) -> tuple[Path, tuple[Finding, ...]]:
    """Find the force file that the loads state, with findings about assumptions.

    For an absolute path on another computer, often Windows, the file of that name beside the loads is used.
    """
    name = (root.findtext(".//datafile") or "").strip()
    if not name or name.lower() == "unassigned":
        raise FileError.found(loads_path, "F148", **_relocated("''", "it names no MOT or STO file"))
    path = path_from(loads_path.parent, name)
    if path.is_file():
        return path, ()
    named = PureWindowsPath(name)  # knows both separators
    beside = loads_path.parent / named.name
    if named.root and beside.is_file():
        read = _relocated(name, f"it does not exist; {beside.name} in the same folder was read instead")
        return beside, (with_evidence("F148", Where(loads_path.name), read),)
    raise FileError.found(loads_path, "F148", **_relocated(name, f"there is no file {path.absolute()}"))


def _relocated(path: str, outcome: str) -> dict[str, Quantity]:
    return {"path": Quantity(path), "outcome": Quantity(outcome)}


def _groups_by_identifier(root: ElementTree.Element, path: Path) -> tuple[list[_Columns], tuple[Finding, ...]]:
    groups, disabled = [], []
    for number, element in enumerate(root.iter("ExternalForce"), start=1):
        name = element.get("name") or f"load {number}"
        if _text(element, "isDisabled") == "true" or _text(element, "appliesForce") == "false":
            disabled.append(name)
            continue
        for tag in ("force_expressed_in_body", "point_expressed_in_body"):
            body = _text(element, tag) or "ground"
            if body.rsplit("/", 1)[-1] != "ground":
                raise FileError.found(path, "F146", None, Where(part=body), load=Quantity(name), entry=Quantity(tag))
        force, point = _text(element, "force_identifier"), _text(element, "point_identifier")
        for tag, identifier in (("force_identifier", force), ("point_identifier", point)):
            if not identifier:
                needed = Quantity(f"a {tag}, the beginning of its three column names")
                raise FileError.found(path, "F143", load=Quantity(name), identifier=needed, found=Quantity("none"))
        body = _text(element, "applied_to_body").rsplit("/", 1)[-1]
        if not (segment_of(body) or "foot").startswith("foot"):
            raise FileError.found(path, "F149", None, Where(part=body), load=Quantity(name))
        side = re.search(r"_([rl])$", body)
        groups.append(
            _Columns(name, force, point, _text(element, "torque_identifier") or None, side[1] if side else None)
        )
    if not groups:
        raise FileError.found(path, "F147", load=Quantity(", ".join(disabled)))
    _expect_own_columns(groups, path)
    return groups, tuple(finding("F147", Where(path.name, plate=name), load=Quantity(name)) for name in disabled)


def _expect_own_columns(groups: Sequence[_Columns], path: Path) -> None:
    """Raise FileError where loads share columns, or one uses columns with another's name."""
    forces: dict[tuple[str, ...], str] = {}
    taken: dict[str, str] = {}
    for group in groups:
        forces.setdefault(_plate_name(group.force), group.force)
        # unmeasured torques may be one column of zeros for all
        for what, identifier in (("force", group.force), ("point", group.point)):
            mine = f"the {what} of {group.name}"
            if taken.setdefault(identifier, mine) != mine or identifier == group.torque:
                other = f"the torque of {group.name}" if identifier == group.torque else taken[identifier]
                both = {"load": Quantity(mine), "other": Quantity(other), "identifier": Quantity(identifier)}
                raise FileError.found(path, "F144", **both)
    for group in groups:
        for what, named in (("point", group.point), ("torque", group.torque or "")):
            owner = forces.get(_plate_name(named), group.force)
            if owner != group.force and _plate_name(owner) != _plate_name(group.force):
                mixed = {"load": Quantity(group.name), "what": Quantity(what), "identifier": Quantity(named)}
                raise FileError.found(path, "F145", **mixed, force=Quantity(group.force), owner=Quantity(owner))


def _expect_different(groups: Sequence[_Columns], table: TimeTable, path: Path) -> None:
    """Raise FileError where two plates have the same force in every row, as where it is given by plate and by foot."""
    loaded = [(group, force) for group in groups if (force := _triple(table, group.force)).any()]
    for (load, force), (other, same) in combinations(loaded, 2):
        if np.array_equal(force, same):
            both = {"load": Quantity(f"the force of {other.name}"), "other": Quantity(f"the force of {load.name}")}
            raise FileError.found(path, "F144", **both, identifier=Quantity(other.force))


def _plate_name(identifier: str) -> tuple[str, ...]:
    """Return the part of a column name that identifies the plate: "r", "1"."""
    words = re.sub("force|torque|moment|point|cop", "_", identifier.lower())
    return tuple(word for word in re.split(r"[_\W]+", words) if word not in ("", "v", "p", "m", "t"))


def _text(element: ElementTree.Element, tag: str) -> str:
    text = (element.findtext(tag) or "").strip()
    return "" if text.lower() == "unassigned" else text


def _expect_columns(groups: Sequence[_Columns], table: TimeTable, path: Path, loads_path: Path) -> None:
    for group in groups:
        for identifier in filter(None, (group.force, group.point, group.torque)):
            missing = [identifier + axis for axis in "xyz" if identifier + axis not in table.labels]
            if missing:
                needed = Quantity(f"columns {', '.join(missing)} by its identifier '{identifier}'")
                names = {"load": Quantity(f"{group.name} ({loads_path.name})"), "identifier": needed}
                raise FileError.found(path, "F143", **names, found=Quantity(_listed(table.labels)))


def torque_columns(force: FloatArray, point: FloatArray, torque: FloatArray) -> tuple[TorqueColumns, ...]:
    """Describe the torque columns of p plates as they are in the file.

    Args:
        force, point, torque: (k, p, 3) N, m and N m, in ground axes; where a plate is hardly loaded the point may be
            anything.
    """
    loaded = force[..., 1] > FIRM_LOAD_N
    columns, elsewhere = [], exchanged_torques(force[..., 1], torque[..., 1])
    for p in range(force.shape[1]):
        rows = loaded[:, p]
        if rows.sum() < _FEWEST:
            columns.append(TorqueColumns(np.nan, (0.0, 0.0, 0.0), None))
            continue
        plate_torque = torque[rows, p]
        moves = float(np.ptp(point[rows, p][:, [0, 2]], axis=0).max()) > _MOVES_M
        arm = (
            float(np.median(np.hypot(plate_torque[:, 0], plate_torque[:, 2]) / force[rows, p, 1])) if moves else np.nan
        )
        x, y, z = (rms(values) for values in plate_torque.T)
        columns.append(TorqueColumns(arm, (x, y, z), elsewhere.get(p), float(np.median(point[rows, p, 1]))))
    return tuple(columns)


def exchanged_torques(vertical: FloatArray, torque: FloatArray) -> dict[int, int]:
    """Find plates whose torques follow another plate's vertical force, and vice versa: returns {a: b, b: a}.

    Args:
        vertical, torque: (k, p) N and N m about the vertical, as they are in a file.
    """
    pairs: dict[int, int] = {}
    for a, b in combinations(range(vertical.shape[1]), 2):
        only_a, only_b = (
            (vertical[:, loaded] > FIRM_LOAD_N) & (vertical[:, other] < LOAD_THRESHOLD_N)
            for loaded, other in ((a, b), (b, a))
        )
        if min(only_a.sum(), only_b.sum()) < _FEWEST_ALONE:
            continue
        neither = (vertical[:, [a, b]] < LOAD_THRESHOLD_N).all(axis=1)
        if _goes_with(torque[:, a], only_a | neither, only_b, vertical[:, b]) and _goes_with(
            torque[:, b], only_b | neither, only_a, vertical[:, a]
        ):
            pairs |= {a: b, b: a}
    return pairs


def _goes_with(torque: FloatArray, without: BoolArray, other: BoolArray, vertical: FloatArray) -> bool:
    """Decide whether a torque (k,) is near zero in samples `without` and a free moment in samples `other`."""
    torque = np.nan_to_num(torque)
    meanwhile = rms(torque[other])
    return (
        meanwhile > _SOME_NM
        and rms(torque[without]) < _LITTLE * meanwhile
        and rms(np.diff(torque)[other[1:] & other[:-1]]) < _JUMPS * meanwhile
        and float(np.percentile(np.abs(torque[other]) / vertical[other], 95)) < _LONGEST_ARM_M
    )
