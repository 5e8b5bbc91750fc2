"""Ground reaction forces from MOT/STO files, with or without an OpenSim ExternalLoads file."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PureWindowsPath

import numpy as np

from kinertia.errors import FileError
from kinertia.io.even_times import even_times
from kinertia.io.file_names import path_from
from kinertia.io.number_table import expect_file
from kinertia.io.sto import TimeTable, read_table
from kinertia.trial.data import LOAD_THRESHOLD_N, FloatArray, PlateLoads
from kinertia.trial.idle_plate import PlateLoad, without_idle
from kinertia.trial.torque_columns import torque_columns

_FOOT_WORDS = {"r": "r", "right": "r", "l": "l", "left": "l"}


@dataclass(frozen=True)
class _Columns:
    """Which columns hold one plate's load: each identifier is followed by x, y, z."""

    name: str
    force: str
    point: str
    torque: str | None
    foot: str | None


def read_forces(mot_path: str | Path | None, loads_path: str | Path | None = None) -> PlateLoads:
    """Read force plates from a MOT or STO file: force and point of application in ground axes, N, m, N m.

    With an ExternalLoads file its identifiers say which column is what and its bodies which foot it claims (a
    claim only); its own `datafile` is used only when `mot_path` is None. Without one, columns are recognised
    by name: `ground_force_vx`, `1_ground_force_vx`, `ground_force_r_vx`, `ground_force_1_vx` and the like,
    with the point `..._px` and the torque `..._mx`, `ground_torque_...x` or `ground_moment_...mx`.

    Below `LOAD_THRESHOLD_N` of vertical force the point of application is garbage: such samples are set to zero, unless
    they are how a load begins or ends (`idle_plate`). Where no torque is given, the free moment is zero.
    Times that were rounded when written are put back on the even grid they came from. `read_forces_with_notes` tells
    what was assumed.

    Raises:
        FileError: a file is missing or broken, a column that is needed is not there, a load is not expressed
            in ground, time does not grow, a loaded sample is NaN, or the forces point down.
    """
    return read_forces_with_notes(mot_path, loads_path)[0]


def read_forces_with_notes(
    mot_path: str | Path | None, loads_path: str | Path | None = None, turn: FloatArray | None = None
) -> tuple[PlateLoads, tuple[str, ...]]:
    """`read_forces` and the assumptions made while reading, one sentence each.

    Args:
        mot_path, loads_path: as there.
        turn: rotation (3, 3) from the axes of the file to ground axes, where they are others.
    """
    notes: tuple[str, ...] = ()
    if loads_path is None:
        if mot_path is None:
            raise ValueError("read_forces needs a force file or an ExternalLoads file")
        path = Path(mot_path)
        table = read_table(path)
        groups = _groups_by_name(path, table)
    else:
        loads_path = Path(loads_path)
        root = _external_loads(loads_path)
        groups, notes = _groups_by_identifier(root, loads_path)
        path, more = (Path(mot_path), ()) if mot_path is not None else _datafile(root, loads_path)
        notes += more
        table = read_table(path)
        _expect_columns(groups, table, path, loads_path)
    time, time_notes = even_times(path, table.time)
    table = replace(table, time=time)
    turn = np.eye(3) if turn is None else turn
    wrenches = [_wrench(path, table, group, turn) for group in groups]
    loads = PlateLoads(
        table.time,
        tuple(group.name for group in groups),
        np.stack([plate.force for plate in wrenches], axis=1),
        np.stack([plate.moment for plate in wrenches], axis=1),
        tuple(group.foot for group in groups),
        noise_n=tuple(plate.noise_n for plate in wrenches),
        idle=tuple(plate.idle for plate in wrenches),
        torques=torque_columns(*_stated(table, groups, turn)),
    )
    return loads, (*notes, *table.notes, *time_notes, *_remarks(path, loads, groups))


def _wrench(path: Path, table: TimeTable, group: _Columns, turn: FloatArray) -> PlateLoad:
    """Force (k, 3) and moment about the ground origin (k, 3), zero where nobody stands on the plate."""
    force = _triple(table, group.force) @ turn.T
    _expect_numbers(path, table, group.force, np.ones(len(force), dtype=bool))
    up, largest = int(np.argmax(turn[1])), int(np.argmax(np.abs(force @ turn).max(axis=0)))
    if largest == 1 != up:
        raise FileError(
            path,
            f"the largest forces are in {group.force}y, along Y, but in the markers people stand along {'XYZ'[up]}; "
            "export markers and forces in the same axes, Y up",
        )
    if force[np.argmax(np.abs(force[:, 1])), 1] < -LOAD_THRESHOLD_N:
        raise FileError(
            path,
            f"the largest vertical force in {group.force}{'xyz'[up]} is {force[:, 1].min():.0f} N, downward; expected "
            f"{'XYZ'[up]} up and the force on the person, turn the sign or the axes before export",
        )
    loaded = force[:, 1] >= LOAD_THRESHOLD_N
    _expect_numbers(path, table, group.point, loaded)
    moment = np.cross(_triple(table, group.point) @ turn.T, force)
    if group.torque is not None:
        _expect_numbers(path, table, group.torque, loaded)
        moment = moment + _triple(table, group.torque) @ turn.T
    return without_idle(table.time, force, moment)


def _stated(table: TimeTable, groups: Sequence[_Columns], turn: FloatArray) -> list[FloatArray]:
    """Forces, points and torques (k, p, 3) as they stand in the file, in ground axes; torques that are not are zero."""
    zero = np.zeros((len(table.time), 3))
    identifiers = ((group.force, group.point, group.torque) for group in groups)
    return [
        np.stack([zero if one is None else _triple(table, one) @ turn.T for one in own], axis=1)
        for own in zip(*identifiers, strict=True)
    ]


def _triple(table: TimeTable, identifier: str) -> FloatArray:
    return table.columns([identifier + axis for axis in "xyz"])


def _expect_numbers(path: Path, table: TimeTable, identifier: str, where: np.ndarray) -> None:
    broken = np.argwhere(np.isnan(_triple(table, identifier)) & where[:, None])
    if broken.size:
        row, axis = broken[0]
        raise FileError(
            path,
            f"column {identifier}{'xyz'[axis]} has no number at {table.time[row]:g} s; expected one for "
            "every loaded sample, fill the gap or cut the trial before export",
        )


def _remarks(path: Path, loads: PlateLoads, groups: Sequence[_Columns]) -> list[str]:
    idle = [name for name, force in zip(loads.names, loads.force.swapaxes(0, 1), strict=True) if not force.any()]
    still = [group.name for group in groups if group.torque is None]
    notes = []
    if idle:
        notes.append(f"{path.name}: {', '.join(idle)} never reaches {LOAD_THRESHOLD_N:g} N")
    if still:
        notes.append(f"{path.name}: no torque columns for {', '.join(still)}; the free moment was taken as zero")
    return notes


def _groups_by_name(path: Path, table: TimeTable) -> list[_Columns]:
    columns = list(table.labels)
    forces = [c[:-1] for c in columns if c.endswith("vx") and {c[:-1] + "y", c[:-1] + "z"} <= set(columns)]
    groups = []
    for force in forces:
        stem = force[:-1]
        if not _has(table, stem + "p"):
            raise FileError(
                path,
                f"{force}x has no point of application; expected {stem}px, {stem}py and {stem}pz, or an "
                "ExternalLoads file",
            )
        candidates = [stem + "m", stem + "t"]
        candidates += [stem.replace("force", word) + end for word in ("torque", "moment") for end in ("", "m", "t")]
        torque = next((c for c in candidates if c != stem and _has(table, c)), None)
        words = re.split(r"[_\W]+", stem.lower())
        feet = {_FOOT_WORDS[word] for word in words if word in _FOOT_WORDS}
        groups.append(_Columns(stem.strip("_ "), force, stem + "p", torque, feet.pop() if len(feet) == 1 else None))
    if not groups:
        raise FileError(
            path,
            "no ground reaction forces: expected columns like ground_force_vx, ground_force_vy, "
            f"ground_force_vz, but it has {_listed(columns)}; rename them or give an ExternalLoads file",
        )
    return groups


def _has(table: TimeTable, identifier: str) -> bool:
    return all(identifier + axis in table.labels for axis in "xyz")


def _listed(columns: Sequence[str]) -> str:
    return ", ".join(columns[:40]) + (" ..." if len(columns) > 40 else "")


def _external_loads(path: Path) -> ElementTree.Element:
    expect_file(path)
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise FileError(
            path, f"not XML ({error}); expected an ExternalLoads file, export it again", error.position[0]
        ) from None
    except (LookupError, ValueError) as error:  # what Python's codecs say of its encoding
        raise FileError(path, f"not XML ({error}); save it as UTF-8", 1) from None
    if root.find(".//ExternalForce") is None:
        raise FileError(path, "no ExternalForce in it; expected an OpenSim ExternalLoads file")
    return root


def _datafile(root: ElementTree.Element, loads_path: Path) -> tuple[Path, tuple[str, ...]]:
    """Where the force file is that the loads name, and what was assumed.

    Of a whole path on another computer, often one with Windows, the file of that name beside the loads counts.
    """
    name = (root.findtext(".//datafile") or "").strip()
    if not name or name.lower() == "unassigned":
        raise FileError(loads_path, "names no datafile; give the MOT or STO file of the forces beside it")
    path = path_from(loads_path.parent, name)
    if path.is_file():
        return path, ()
    named = PureWindowsPath(name)  # knows both separators
    beside = loads_path.parent / named.name
    if named.root and beside.is_file():
        return beside, (f"{loads_path.name}: its datafile {name} is not there; {beside.name} beside it was read",)
    raise FileError(loads_path, f"its datafile {name} is not at {path.absolute()}; give the force file beside it")


def _groups_by_identifier(root: ElementTree.Element, path: Path) -> tuple[list[_Columns], tuple[str, ...]]:
    groups, notes = [], []
    for number, element in enumerate(root.iter("ExternalForce"), start=1):
        name = element.get("name") or f"load {number}"
        if _text(element, "isDisabled") == "true" or _text(element, "appliesForce") == "false":
            notes.append(f"{path.name}: {name} is disabled there and was left out")
            continue
        for tag in ("force_expressed_in_body", "point_expressed_in_body"):
            body = _text(element, tag) or "ground"
            if body.rsplit("/", 1)[-1] != "ground":
                raise FileError(path, f"{name} has {tag} = {body}; expected ground, transform the load before export")
        force, point = _text(element, "force_identifier"), _text(element, "point_identifier")
        for tag, identifier in (("force_identifier", force), ("point_identifier", point)):
            if not identifier:
                raise FileError(path, f"{name} has no {tag}; expected the beginning of its three column names")
        side = re.search(r"_([rl])$", _text(element, "applied_to_body"))
        groups.append(
            _Columns(name, force, point, _text(element, "torque_identifier") or None, side[1] if side else None)
        )
    if not groups:
        raise FileError(path, "all its external forces are disabled; expected at least one that applies")
    _expect_own_columns(groups, path)
    return groups, tuple(notes)


def _expect_own_columns(groups: Sequence[_Columns], path: Path) -> None:
    """Raise FileError where loads share columns, or one takes what another's name is on."""
    forces: dict[tuple[str, ...], str] = {}
    taken: dict[str, str] = {}
    for group in groups:
        forces.setdefault(_plate_name(group.force), group.force)
        # torques that nobody measured may be one column of zeros for all
        for what, identifier in (("force", group.force), ("point", group.point)):
            mine = f"the {what} of {group.name}"
            if taken.setdefault(identifier, mine) != mine or identifier == group.torque:
                other = f"the torque of {group.name}" if identifier == group.torque else taken[identifier]
                raise FileError(
                    path,
                    f"{other} and {mine} are the same columns, {identifier}x, {identifier}y and {identifier}z; "
                    "expected columns of its own for each: correct the identifier",
                )
    for group in groups:
        for what, named in (("point", group.point), ("torque", group.torque or "")):
            owner = forces.get(_plate_name(named), group.force)
            if owner != group.force and _plate_name(owner) != _plate_name(group.force):
                raise FileError(
                    path,
                    f"{group.name} takes its force from {group.force} and its {what} from {named}, which by its name "
                    f"goes with {owner}: correct the identifier",
                )


def _plate_name(identifier: str) -> tuple[str, ...]:
    """What tells the plate in the name of a column: "r", "1"."""
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
                raise FileError(
                    path,
                    f"no column {', '.join(missing)}, which {loads_path.name} names for {group.name} by the "
                    f"identifier '{identifier}'; correct the identifier, the columns are "
                    f"{_listed(table.labels)}",
                )
