"""The files of a measured person, to be spoilt: read, with what idle plates read put back, and written as before."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np

from kinertia.io.c3d.writer import write_c3d
from kinertia.io.marker_set_file import marker_set_of
from kinertia.io.subject.person_recordings import read_inputs
from kinertia.io.subject.tables import SubjectFile
from kinertia.io.text.sto import write_sto
from kinertia.io.text.trc import write_trc
from kinertia.model.marker_set import MarkerSet
from kinertia.settings import Subject
from kinertia.synthetic.laboratory import force_table
from kinertia.trial.data import FloatArray, Markers, PlateLoads, Recording
from kinertia.trial.ground_contact import centre_of_pressure

_IDLE_SD_N, _IDLE_SD_NM = 1.0, 0.1


@dataclass(frozen=True, eq=False)
class MeasuredPerson:
    """Recordings of one person: a static trial and a walk.

    Attributes:
        subject: subject data as stated.
        marker_set: which label is which landmark.
        static, walk: recordings as read; plates with noise while unloaded.
        window_s: window of the walk that the user vouches for, if any.
    """

    subject: Subject
    marker_set: MarkerSet
    static: Recording
    walk: Recording
    window_s: tuple[float, float] | None = None

    @property
    def plates(self) -> PlateLoads:
        """Plates of the walk."""
        if self.walk.plates is None:
            raise ValueError("the walk has no force plates")
        return self.walk.plates

    def in_static(self, change: Callable[[Markers], Markers]) -> Self:
        """Change the markers of the static trial."""
        return replace(self, static=replace(self.static, markers=change(self.static.markers)))

    def in_walk(self, change: Callable[[Markers], Markers]) -> Self:
        """Change the markers of the walk."""
        return replace(self, walk=replace(self.walk, markers=change(self.walk.markers)))

    def in_both(self, change: Callable[[Markers], Markers]) -> Self:
        """Change the markers of both trials."""
        return self.in_static(change).in_walk(change)

    def with_plates(self, plates: PlateLoads) -> Self:
        """Replace the loads of the walk."""
        return replace(self, walk=replace(self.walk, plates=plates))


def read_person(wanted: SubjectFile, rng: np.random.Generator) -> MeasuredPerson:
    """Read the person of a subject file, with the first of the trials.

    Raises:
        KinertiaError: a file is missing or broken, or there is no static trial.
    """
    static, inputs, marker_set = read_inputs(wanted)
    walk = inputs[0].recording
    marker_set = marker_set_of(static.markers, marker_set)
    stated = {key: getattr(wanted.subject, key) or getattr(static, key) for key in ("mass_kg", "height_m")}
    subject = wanted.subject.model_copy(update=stated)
    # a static trial needs no forces
    person = MeasuredPerson(subject, marker_set, replace(static, plates=None), walk, inputs[0].window_s)
    return person if walk.plates is None else person.with_plates(_with_idle_noise(walk.plates, rng))


def _with_idle_noise(plates: PlateLoads, rng: np.random.Generator) -> PlateLoads:
    """Add noise to unloaded plates: the reader leaves nothing there, but real plates read a little."""
    idle = (plates.force == 0).all(axis=2)[..., None]
    force = plates.force + idle * rng.normal(0.0, _IDLE_SD_N, plates.force.shape)
    moment = plates.moment + idle * rng.normal(0.0, _IDLE_SD_NM, plates.moment.shape)
    return replace(plates, force=force, moment=moment)


def acting(plates: PlateLoads) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return force (k, p, 3) N, its point on the ground (k, p, 3) m, and the torque (k, p, 3) N m about that."""
    point = centre_of_pressure(plates.wrench)
    return plates.force, point, plates.moment - np.cross(point, plates.force)


def loads_of(plates: PlateLoads, force: FloatArray, point: FloatArray, torque: FloatArray) -> PlateLoads:
    """Return the plates with these forces, points and torques, (k, p, 3) each."""
    return replace(plates, force=force, moment=np.cross(point, force) + torque)


def write_person(folder: Path, person: MeasuredPerson) -> Path:
    """Write static trial and walk as a laboratory has them, and their subject file; return its path.

    Plates whose corners are known are written to a C3D file with the markers, others to a MOT file beside a TRC file.
    """
    static = "static.c3d" if person.static.measurements else "static.trc"
    if person.static.measurements:
        write_c3d(folder / static, person.static)
    else:
        write_trc(folder / static, person.static.markers)
    subject = person.subject.model_dump(exclude_none=True)
    tables: list[tuple[str, Mapping[str, object]]] = [("[subject]", subject)]
    (folder / "markers.toml").write_text(_marker_set_text(person.marker_set), encoding="utf-8")
    tables.append(("[model]", {"static": static, "markers": "markers.toml"}))
    trial: dict[str, object] = {"name": "walk", "markers": "walk.trc", "forces": "walk_grf.mot"}
    if person.plates.corners is not None:
        write_c3d(folder / "walk.c3d", person.walk)
        trial = {"name": "walk", "markers": "walk.c3d"}
    else:
        write_trc(folder / "walk.trc", person.walk.markers)
        # by these names a reader knows which columns are torques
        names = tuple(f"{k}_ground_force" for k in range(1, len(person.plates.names) + 1))
        write_sto(folder / "walk_grf.mot", force_table(replace(person.plates, names=names)), False, "walk_grf")
    if person.window_s is not None:
        trial["window_s"] = list(person.window_s)
    tables.append(("[[trial]]", trial))
    path = folder / "subject.toml"
    path.write_text(_toml(tables), encoding="utf-8")
    return path


def _marker_set_text(marker_set: MarkerSet) -> str:
    landmarks, segments = (
        {k: list(v) for k, v in table.items() if v} for table in (marker_set.landmarks, marker_set.segments)
    )
    tables = (("[landmarks]", landmarks), ("[segments]", segments), ("[widths]", marker_set.widths))
    return f"name = {json.dumps(marker_set.name)}\n" + _toml(tables)


def _toml(tables: Sequence[tuple[str, Mapping[str, object]]]) -> str:
    """Format tables as TOML; strings, numbers and lists are written alike in JSON and TOML."""
    lines = []
    for heading, entries in tables:
        lines += [heading, *(f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in entries.items()), ""]
    return "\n".join(lines)
