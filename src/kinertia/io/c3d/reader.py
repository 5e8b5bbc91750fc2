"""Reads C3D files: markers, force plates and the subject's measurements, through ezc3d.

The parts of a C3D file that are only conventions are checked against the data: which axis is vertical, whether plates
measure the force on the person or on the plate, whether a plate lies where its corners are.
"""

import contextlib
import re
import tempfile
from collections.abc import Iterator, Sequence, Set
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from kinertia.errors import FileError, expect_file
from kinertia.findings.display import first_few
from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.quantity import Quantity, Where
from kinertia.io.c3d.ezc3d_library import (
    C3dContent,
    C3dTrouble,
    expect_ezc3d,
    parameter_values,
    read_content,
    read_in_subprocess,
    text_list,
)
from kinertia.io.c3d.file_contents import file_events, subject_data
from kinertia.io.c3d.outputs import OUTPUT_TYPES, OWN_GROUP, USUAL_UNITS, unit_factor
from kinertia.io.c3d.plates import PLATE_TYPES, lab_plates, person_on_plates
from kinertia.io.c3d.structure import doubts_about, with_plain_samples
from kinertia.io.c3d.theia import POSE_SD_M, Poses, virtual_markers, virtual_places
from kinertia.io.lab_plates import plate_left_out, to_ground, to_ground_plates
from kinertia.io.text.number_table import left_out, most_seen, people_among, without_prefixes
from kinertia.io.text.trc import METRES_PER_UNIT, read_as_missing, stand_ins, unknown_unit
from kinertia.trial.data import FloatArray, Markers, Recording
from kinertia.trial.file_contents import FileOutputs

_OUTPUT_LISTS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS")
_MODELLED = "MODELED_MARKERS"
_OUTPUT_NAME = re.compile(r"(Angles?|Forces?|Moments?|Powers?|GRF)$")
PERSON_M = (0.3, 2.8)
"""How far a person's markers reach in one frame."""


def read_c3d(path: str | Path, length_unit: str | None = None, standing: bool = False) -> Recording:
    """Read markers, force plates and measurements of the subject from a C3D file, turned to ground axes.

    Markers: model outputs (angles, forces, moments, powers) and unnamed points (`*...`) are left out, virtual
    points (joint centres, segment origins, modelled markers: F166) are kept unless Kinertia wrote them; `subject:`
    prefixes are stripped; of repeated labels the one in most frames is kept. Time counts from the first frame of the
    capture, so a cropped file does not begin at zero.

    Plates: types 1 to 4 (ezc3d reads no others); moment about the ground origin; samples with less than
    `LOAD_THRESHOLD_N` of vertical force are zero. Plates that cannot be read are left out (F151), so
    `plates` is None when none is left.

    Poses of segments (Theia), in a file without points: virtual markers at the landmarks of the marker set "theia".

    Args:
        path: the file.
        length_unit: unit of its lengths, "mm", "cm" or "m", which overrules the file; if None, the file's or, where it
            states none, the one that makes markers the size of a person.
        standing: read poses as one frame of the same person standing upright, as a static trial.

    Raises:
        FileError: the file is missing, empty, truncated, not a C3D file, has no markers or an unknown length unit;
            or ezc3d is not installed.
    """
    path = Path(path)
    file, plate_findings = _open(path)
    parameters = file["parameters"]
    poses = _poses(file)
    if poses is None:
        labels, positions, label_findings = _markers(path, file)
    else:
        labels, positions, label_findings = (), np.stack(list(poses.translation.values()), axis=1), []
    unit_name, unit_findings = _length_unit(path, parameters, positions, length_unit)
    unit = METRES_PER_UNIT[unit_name]
    if poses is not None:
        labels, positions, label_findings = _pose_markers(path, poses, unit, standing)
    time = _times(file, "points" if poses is None else "rotations")[: len(positions)]
    plates, more_findings = lab_plates(path, file, unit_name)
    stated = str(parameter_values(parameters, "POINT", "Y_SCREEN", [""])[0]).strip().upper()
    rotation, up, axis_findings = to_ground(path, stated, "POINT:Y_SCREEN", unit * positions, plates)
    markers = Markers(time, labels, unit * positions @ rotation.T)
    ground_plates, load_findings = to_ground_plates(path, plates, rotation, _times(file, "analogs"))
    person = subject_data(path, parameters)
    of_plates = (*plate_findings, *more_findings, *axis_findings, *load_findings)
    virtual = {} if poses is None else dict.fromkeys(labels, POSE_SD_M)
    return Recording(
        path.stem,
        markers,
        ground_plates,
        person.mass_kg,
        person.height_m,
        person.measurements,
        (*unit_findings, *label_findings, *of_plates, *person.findings),
        unit_name,
        up,
        virtual,
        events=file_events(parameters, labels),
        outputs=_file_outputs(file, time, unit * rotation),
    )


def _open(path: Path) -> tuple[C3dContent, list[Finding]]:
    """Read the content of the file, with forces where ezc3d can compute them, and plates that were left out (F151)."""
    expect_file(path)
    expect_ezc3d(path)
    doubt = doubts_about(path)
    findings = []
    try:
        with _plain(path) as readable:
            file = read_in_subprocess(readable) if doubt else read_content(readable)
    except C3dTrouble as error:
        problem = f"{doubt}; {error}" if doubt else str(error)
        raise FileError.found(path, "F106", what=Quantity(problem)) from None
    parameters = file["parameters"]
    if file["trouble"] and parameter_values(parameters, "FORCE_PLATFORM", "USED", [0])[0]:
        types = parameter_values(parameters, "FORCE_PLATFORM", "TYPE", [])
        unknown = ", ".join(str(kind) for kind in types if kind not in PLATE_TYPES)
        reason = f"their type ({unknown}) cannot be read" if unknown else f"ezc3d cannot read them ({file['trouble']})"
        findings.append(plate_left_out(path, None, reason))
    if not file["data"]["points"].shape[1] and _poses(file) is None:
        found = "no points, and no Theia poses of pelvis, thighs, shanks, feet and toes"
        raise FileError.found(path, "F164", found=Quantity(found))
    return file, findings


@contextlib.contextmanager
def _plain(path: Path) -> Iterator[Path]:
    """Yield the file, or a copy where ezc3d would misread its analog samples."""
    content = with_plain_samples(path)
    if content is None:
        yield path
        return
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "plain.c3d"
        copy.write_bytes(content)
        yield copy


def _poses(file: C3dContent) -> Poses | None:
    """Return the poses of a file that has no points."""
    if file["data"]["points"].shape[1] or not np.size(file["data"]["rotations"]):
        return None
    labels = [str(label) for label in parameter_values(file["parameters"], "ROTATION", "LABELS", [])]
    heels = {side: parameter_values(file["parameters"], "THEIA3D", f"{side}_heel") for side in "rl"}
    known = {side: np.ravel(heel).astype(float) for side, heel in heels.items() if np.size(heel) == 3}
    return Poses.of(labels, file["data"]["rotations"], known)


def _pose_markers(
    path: Path, poses: Poses, unit: float, standing: bool
) -> tuple[tuple[str, ...], FloatArray, list[Finding]]:
    """Make virtual markers of poses: labels, positions (n, m, 3) in lab axes and file units, and the finding F165."""
    poses = poses.scaled(unit)
    places = virtual_places(poses)
    positions = virtual_markers(poses.standing() if standing else poses, places) / unit
    made = Quantity("the person standing upright" if standing else "segment poses")
    sizes = {"count": Quantity(len(places), "1"), "sd_m": Quantity(POSE_SD_M, "m")}
    return tuple(places), positions, [with_evidence("F165", Where(path.name), {**sizes, "source": made})]


def _length_unit(path: Path, parameters: Any, positions: FloatArray, stated: str | None) -> tuple[str, list[Finding]]:
    """Return the file's length unit; if it has none, the one that makes markers (n, m, 3) the size of a person."""
    unit = str(parameter_values(parameters, "POINT", "UNITS", [""])[0]).strip().lower()
    if stated is not None:
        differs = finding("F123", Where(path.name), stated=Quantity(stated), unit=Quantity(f"'{unit}'"))
        return stated, [] if unit == stated else [differs]
    if unit in METRES_PER_UNIT:
        return unit, []
    if unit:
        raise unknown_unit(path, "lengths (POINT:UNITS)", f"'{unit}'")
    size = _size(positions)
    low, high = PERSON_M
    likely = [name for name, metres in METRES_PER_UNIT.items() if low < size * metres < high]
    if len(likely) != 1:
        unit = f"not stated, and markers {size:.3g} units apart fit none"
        extent = {"extent": Quantity(size, "1")} if np.isfinite(size) else {}
        raise unknown_unit(path, "lengths (POINT:UNITS)", unit, known=extent)
    extent_m = Quantity(size * METRES_PER_UNIT[likely[0]], "m", usual=PERSON_M)
    return likely[0], [finding("F122", Where(path.name), extent_m=extent_m, unit=Quantity(likely[0]))]


def _size(positions: FloatArray) -> float:
    """Return how far markers (n, m, 3) extend along an axis: the median of the frames that show most of them."""
    seen = np.asarray(np.isfinite(positions).all(axis=2))
    count = seen.sum(axis=1)
    fullest = np.flatnonzero(count == count.max(initial=1))
    return float(np.median([np.ptp(positions[k, seen[k]], axis=0).max() for k in fullest])) if len(fullest) else np.nan


def _times(file: Any, kind: str) -> FloatArray:
    """Return times (s) of the marker frames ("points"), the poses ("rotations") or the analog samples ("analogs")."""
    header, count = file["header"], file["data"][kind].shape[-1]
    first = "rotations" if kind == "rotations" else "points"
    start: float = header[first]["first_frame"] / header[first]["frame_rate"]
    return start + np.arange(count) / (header[kind]["frame_rate"] or 1.0)


def _markers(path: Path, file: Any) -> tuple[tuple[str, ...], FloatArray, list[Finding]]:
    """Read labels and positions (n, m, 3), in lab axes and file units, of the points that are positions."""
    positions = np.moveaxis(file["data"]["points"][:3], 0, 2).swapaxes(0, 1).copy()
    missing = stand_ins(positions)
    for where in missing.values():
        positions[where] = np.nan
    shown = np.asarray(np.isfinite(positions).all(axis=2))
    seen = np.asarray(shown.any(axis=0))
    labels = text_list(file["parameters"], "POINT", "LABELS")[: positions.shape[1]]
    labels += ["*"] * (positions.shape[1] - len(labels))
    ours = set(text_list(file["parameters"], OWN_GROUP, "LABELS"))
    outputs = _outputs(file["parameters"], labels) - ours
    unnamed = [k for k, label in enumerate(labels) if not label or label.startswith("*")]
    kept = [k for k in range(len(labels)) if k not in set(unnamed) and labels[k] not in outputs | ours]
    unread = [labels[k] for k in kept]
    people = list(people_among([label for label, k in zip(unread, kept, strict=True) if seen[k]]))
    on_plates = person_on_plates(file["data"].get("platform", []), people, unread, positions[:, kept])
    names, findings = without_prefixes(path, unread, people[0] if len(people) == 1 else on_plates)
    if on_plates:
        who = {"person": Quantity(on_plates), "people": Quantity(", ".join(people))}
        findings.append(with_evidence("F162", Where(path.name), who))
    first, repeated = most_seen(path, names, shown[:, kept])
    chosen = {name: kept[k] for name, k in first.items()}
    if not chosen or not seen[list(chosen.values())].any():
        raise FileError.found(path, "F164", found=Quantity(f"none of its {len(labels)} points has a label and data"))
    if outputs:
        findings.append(left_out(path, len(outputs), f"model outputs ({first_few(sorted(outputs))})"))
    if unnamed:
        findings.append(left_out(path, len(unnamed), "unnamed points"))
    modelled = [name for name in text_list(file["parameters"], "POINT", _MODELLED) if name in chosen]
    if modelled:
        points = Quantity(first_few(modelled))
        findings.append(
            finding("F166", Where(path.name), points=points, source=Quantity("modelled markers of the file"))
        )
    findings += repeated
    of_markers = {what: where[:, list(chosen.values())] for what, where in missing.items()}
    findings += read_as_missing(path, tuple(chosen), of_markers)
    return tuple(chosen), positions[:, list(chosen.values())], findings


def _file_outputs(file: Any, time: FloatArray, to_ground_m: FloatArray) -> FileOutputs | None:
    parameters = file["parameters"]
    points = np.moveaxis(file["data"]["points"][:3], 0, 2).swapaxes(0, 1)
    labels = text_list(parameters, "POINT", "LABELS")[: points.shape[1]]
    ours = set(text_list(parameters, OWN_GROUP, "LABELS"))
    found = file_outputs(parameters, labels, points, time, ours)
    return None if found is None else replace(found, points=segment_points(labels, points @ to_ground_m.T, ours))


def _outputs(parameters: Any, labels: list[str]) -> set[str]:
    groups = parameter_values(parameters, "POINT", "TYPE_GROUPS", [])
    lists = {*_OUTPUT_LISTS, *(str(name).strip() for name in list(groups)[::2])} - {_MODELLED}
    listed = {label for name in lists for label in text_list(parameters, "POINT", name)}
    return {label for label in labels if label in listed or _OUTPUT_NAME.search(label)}


_NAME = re.compile(r"(?:.*:)?([LR])(Vicon)?((?:Hip|Knee|Ankle)(?:Angles|Moment|Power))")


def file_outputs(
    parameters: Any, labels: Sequence[str], points: FloatArray, time: FloatArray, ours: Set[str]
) -> FileOutputs | None:
    """Read outputs of hips, knees and ankles, in SI units and degrees; None where there are none.

    Where a file has "LViconHipAngles" beside "LHipAngles" of another model, Vicon's count. Those in unknown units are
    left out.

    Args:
        parameters: parameters of the file.
        labels: labels of its points.
        points: (f, p, 3) in the file's units.
        time: (f,) s.
        ours: labels of points that Kinertia wrote.
    """
    found: dict[str, tuple[bool, FloatArray]] = {}
    for k, label in enumerate(labels):
        match = None if label in ours else _NAME.fullmatch(label)
        if match is None:
            continue
        name, vicon = match[1] + match[3], match[2] is not None
        factor = _factor(parameters, name)
        values = np.where((points[:, k] == 0.0).all(axis=1)[:, None], np.nan, points[:, k])
        if factor is not None and np.isfinite(values).any() and (vicon or name not in found):
            found[name] = vicon, factor * values
    return FileOutputs(time, {name: values for name, (_, values) in found.items()}) if found else None


_SEGMENT_POINT = re.compile(r"(?:.*:)?([LR](?:FE|TI|FO)[OALP])")
"""Origin of a thigh, shank or foot (the joint centre below it), and ends of its axes: anterior, lateral, proximal."""


def segment_points(labels: Sequence[str], points: FloatArray, ours: Set[str]) -> dict[str, FloatArray]:
    """Return the points (f, 3) that show Plug-in Gait's segments, by name: "LFEO"; NaN where they are missing.

    Args:
        labels: labels of the points.
        points: (f, p, 3).
        ours: labels of points that Kinertia wrote.
    """
    matches = ((k, None if label in ours else _SEGMENT_POINT.fullmatch(label)) for k, label in enumerate(labels))
    named = ((k, match[1]) for k, match in matches if match is not None)
    return {name: np.where((points[:, k] == 0.0).all(axis=1)[:, None], np.nan, points[:, k]) for k, name in named}


def _factor(parameters: Any, name: str) -> float | None:
    kind, unit = next(output_type for output_type in OUTPUT_TYPES.items() if name.upper().endswith(output_type))
    stated = str(parameter_values(parameters, "POINT", f"{unit}_UNITS", [""])[0]).strip()
    return unit_factor(kind, stated or USUAL_UNITS[kind])
