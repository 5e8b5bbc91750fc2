"""What goes wrong with markers between the person and the file: labels, places, axes, time."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from kinertia.diagnostics.evidence.landmarks import bridged_trajectory
from kinertia.model.joint_centres import find_landmarks, hip_in_pelvis, pelvis_frame
from kinertia.trial.data import LOAD_THRESHOLD_N, FloatArray, Markers
from validation.measured_person import MeasuredPerson

Change = Callable[[MeasuredPerson, np.random.Generator], MeasuredPerson | None]
"""The person with a mistake; None where it cannot be made, for want of a marker."""
_TO_Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
_ACROSS = np.diag([1.0, 1.0, -1.0])


def loaded_middle_s(person: MeasuredPerson) -> float:
    """Return the middle (s) of the time in which plates are loaded: a fit uses what is around it."""
    loaded = person.plates.time[(person.plates.force[..., 1] > LOAD_THRESHOLD_N).any(axis=1)]
    return float((loaded[0] + loaded[-1]) / 2)


def exchanged(*pairs: tuple[str, str], where: str = "both") -> Change:
    """Return a fault that swaps the labels of these landmarks; `where`: "static", "walk" or "both"."""

    def change(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson | None:
        names = person.marker_set.landmarks
        swaps: dict[str, str] = {}
        for label, other in pairs:
            if label not in names or other not in names:
                return None
            for a, b in zip(names[label], names[other], strict=False):
                swaps |= {a: b, b: a}
        return _in(person, where, lambda markers: _renamed(markers, swaps), set(swaps))

    return change


def sides_exchanged(where: str = "both") -> Change:
    """Return a fault that swaps left and right of all labels."""

    def change(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson | None:
        other = {
            label: twin
            for label in person.marker_set.labels
            if (twin := _twin(label, person.marker_set.labels)) is not None
        }
        return _in(person, where, lambda markers: _renamed(markers, other), set())

    return change


def wands_exchanged(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson | None:
    """Swap a marker of the right thigh and one of the right shank, not landmarks, in the walk."""
    joints = {label for name, labels in person.marker_set.landmarks.items() if "wand" not in name for label in labels}
    seen = set(person.walk.markers.labels)
    picked = [
        [segment for segment in person.marker_set.segments[name] if segment not in joints and segment in seen]
        for name in ("thigh_r", "shank_r")
    ]
    if not all(picked):
        return None
    wand, other = (labels[0] for labels in picked)
    return person.in_walk(lambda markers: _renamed(markers, {wand: other, other: wand}))


def turned(rotation: FloatArray, where: str = "both") -> Change:
    """Return a fault that rotates the markers to other axes."""
    return lambda person, rng: _in(person, where, lambda markers: markers.rotated(rotation), set())


def tilted(axis: str, degrees: float) -> Change:
    """Return a fault that tilts the cameras about a horizontal axis; the walks go along X."""
    return turned(Rotation.from_euler(axis, degrees, degrees=True).as_matrix())


def z_up(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson:
    """Set Z up in the markers of the walk, Y up in the forces."""
    return person.in_walk(lambda markers: markers.rotated(_TO_Z_UP))


def mirrored(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson:
    """Reverse the sign of the axis across the laboratory, in markers and forces."""
    plates = person.plates
    corners = None if plates.corners is None else plates.corners @ _ACROSS
    # a moment is no arrow: mirrored across Z, its Z component stays and the others turn their signs
    moment = -plates.moment @ _ACROSS
    person = person.with_plates(replace(plates, force=plates.force @ _ACROSS, moment=moment, corners=corners))
    return person.in_both(lambda markers: markers.rotated(_ACROSS))


def scaled(factor: float, where: str) -> Change:
    """Return a fault that puts markers in another unit, or of a person of another size."""

    def change(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson | None:
        return _in(person, where, lambda markers: replace(markers, positions=factor * markers.positions), set())

    return change


def moved(offset_m: tuple[float, float, float], where: str) -> Change:
    """Return a fault that displaces all markers."""
    return lambda person, rng: _in(
        person, where, lambda markers: replace(markers, positions=markers.positions + np.array(offset_m)), set()
    )


def placed_anew(sd_m: float) -> Change:
    """Return a fault that re-applies the static trial's markers, each displaced with SD `sd_m` along each axis."""

    def change(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson:
        offsets = rng.normal(0.0, sd_m, (len(person.static.markers.labels), 3))
        return person.in_static(lambda markers: replace(markers, positions=markers.positions + offsets))

    return change


def copied(source: str, target: str) -> Change:
    """Return a fault that gives a landmark's marker the trajectory of another's in the walk."""

    def change(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson | None:
        names = person.marker_set.landmarks
        labels = [names.get(name, ("",))[0] for name in (source, target)]
        if not set(labels) <= set(person.walk.markers.labels):
            return None
        column, other = (person.walk.markers.labels.index(label) for label in labels)

        def same(markers: Markers) -> Markers:
            places = markers.positions.copy()
            places[:, other] = places[:, column]
            return replace(markers, positions=places)

        return person.in_walk(same)

    return change


def one_marker(landmark: str, change: Callable[[FloatArray, FloatArray, float], FloatArray]) -> Change:
    """Return a fault that changes a marker's trajectory (n, 3) m, given times (n,) s and middle (s) of the loads."""

    def spoilt(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson | None:
        label = person.marker_set.landmarks.get(landmark, ("",))[0]
        if label not in person.walk.markers.labels:
            return None
        middle = loaded_middle_s(person)

        def changed(markers: Markers) -> Markers:
            places, k = markers.positions.copy(), markers.labels.index(label)
            places[:, k] = change(places[:, k], markers.time, middle)
            return replace(markers, positions=places)

        return person.in_walk(changed)

    return spoilt


def spikes(way: FloatArray, time: FloatArray, middle_s: float) -> FloatArray:
    """Displace the marker by 300 mm in every twentieth frame."""
    off = np.zeros_like(way)
    off[10::20, 0] = 0.3
    result: FloatArray = way + off
    return result


def frozen(way: FloatArray, time: FloatArray, middle_s: float) -> FloatArray:
    """Freeze the marker where it was 0.25 s before the middle, until 0.25 s after it."""
    held = np.abs(time - middle_s) <= 0.25
    result = way.copy()
    result[held] = way[np.argmax(held)]
    return result


def bridged(way: FloatArray, time: FloatArray, middle_s: float) -> FloatArray:
    """Fill a gap of half a second around the middle with a straight line."""
    gap = np.abs(time - middle_s) <= 0.25
    result = way.copy()
    for axis in range(3):
        result[gap, axis] = np.interp(time[gap], time[~gap], way[~gap, axis])
    return result


def jumping(way: FloatArray, time: FloatArray, middle_s: float) -> FloatArray:
    """Raise the marker by 60 mm from the middle on."""
    result: FloatArray = way + np.outer(np.where(time > middle_s, 0.06, 0.0), [0.0, 1.0, 0.0])
    return result


def displaced(way: FloatArray, time: FloatArray, middle_s: float) -> FloatArray:
    """Raise the marker by 50 mm, as if fallen off before the walk and re-applied."""
    result: FloatArray = way + np.array([0.0, 0.05, 0.0])
    return result


def exchanged_for_a_while(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson | None:
    """Swap the labels of the two knees' lateral markers for 0.4 s."""
    names = [person.marker_set.landmarks.get(f"knee_lateral_{side}", ("",))[0] for side in "rl"]
    if not set(names) <= set(person.walk.markers.labels):
        return None
    middle = loaded_middle_s(person)

    def changed(markers: Markers) -> Markers:
        places = markers.positions.copy()
        column, other = (markers.labels.index(name) for name in names)
        rows = np.abs(markers.time - middle) <= 0.2
        places[rows, column], places[rows, other] = places[rows, other], places[rows, column]
        return replace(markers, positions=places)

    return person.in_walk(changed)


def closed_up(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson:
    """Cut 80 ms of marker frames in the middle, and close the gap in time."""
    middle = loaded_middle_s(person)

    def changed(markers: Markers) -> Markers:
        kept = np.abs(markers.time - middle) > 0.04
        return Markers(markers.time[: kept.sum()], markers.labels, markers.positions[kept])

    return _forces_to_the_end(person.in_walk(changed))


def half_speed(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson:
    """Give markers of the walk half their rate; in a C3D file, which has one time base, forces as well."""

    def slow(time: FloatArray) -> FloatArray:
        start = person.walk.markers.time[0]
        result: FloatArray = start + 2 * (time - start)
        return result

    if person.plates.corners is not None:
        person = person.with_plates(replace(person.plates, time=slow(person.plates.time)))
    return person.in_walk(lambda markers: replace(markers, time=slow(markers.time)))


def few_frames(rate_hz: float) -> Change:
    """Return a fault that leaves out frames of the walk until about this rate is left."""

    def change(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson | None:
        step = round(person.walk.markers.rate_hz / rate_hz)
        plates, frames = person.plates, len(person.walk.markers.time)
        kept = slice(0, frames // step * step, step)
        samples = slice(0, kept.stop * (len(plates.time) // frames))
        cut = replace(plates, time=plates.time[samples], force=plates.force[samples], moment=plates.moment[samples])
        return person.with_plates(cut).in_walk(
            lambda markers: replace(markers, time=markers.time[kept], positions=markers.positions[kept])
        )

    return change


def low_passed(cutoff_hz: float) -> Change:
    """Return a fault that filters all trajectories of the walk with a zero-lag Butterworth filter of fourth order."""

    def change(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson:
        def smooth(markers: Markers) -> Markers:
            sections = butter(2, cutoff_hz, fs=markers.rate_hz, output="sos")
            known = np.stack(
                [bridged_trajectory(markers.time, trajectory) for trajectory in np.moveaxis(markers.positions, 1, 0)],
                axis=1,
            )
            smoothed = sosfiltfilt(sections, known, axis=0)
            return replace(markers, positions=np.where(np.isfinite(markers.positions), smoothed, np.nan))

        return person.in_walk(smooth)

    return change


def virtual_markers(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson | None:
    """List hip joint centres, computed from the pelvis, as markers of the thighs."""
    marks = find_landmarks(person.static, person.marker_set)
    if not {"asis_r", "asis_l", "psis_r", "psis_l"} <= set(marks.points):
        return None
    _, _, width, depth = pelvis_frame(marks)
    sets = person.marker_set

    def changed(markers: Markers) -> Markers:
        corner = {
            n: markers.select(sets.landmarks[n]).positions.mean(axis=1)
            for n in ("asis_r", "asis_l", "psis_r", "psis_l")
        }
        origin = (corner["asis_r"] + corner["asis_l"]) / 2
        z = _units(corner["asis_r"] - corner["asis_l"])
        y = _units(np.cross(z, origin - (corner["psis_r"] + corner["psis_l"]) / 2))
        axes = np.stack([np.cross(y, z), y, z], axis=2)
        hips = [origin + axes @ hip_in_pelvis(width, depth, "bell", side) for side in "rl"]
        return Markers(
            markers.time,
            (*markers.labels, "centre_r", "centre_l"),
            np.concatenate([markers.positions, np.stack(hips, 1)], 1),
        )

    segments = dict(sets.segments)
    segments |= {f"thigh_{side}": (*segments[f"thigh_{side}"], f"centre_{side}") for side in "rl"}
    return replace(person, marker_set=replace(sets, segments=segments)).in_both(changed)


def _forces_to_the_end(person: MeasuredPerson) -> MeasuredPerson:
    """Cut the forces after the last marker frame."""
    plates, markers = person.plates, person.walk.markers
    if plates.corners is None:
        return person
    ratio = round(1.0 / markers.rate_hz / float(plates.time[1] - plates.time[0]))
    count = ratio * len(markers.time)
    return person.with_plates(
        replace(plates, time=plates.time[:count], force=plates.force[:count], moment=plates.moment[:count])
    )


def _in(
    person: MeasuredPerson, where: str, change: Callable[[Markers], Markers], needed: set[str]
) -> MeasuredPerson | None:
    """Change the markers there; None where a required label is missing."""
    files = {"static": (person.static,), "walk": (person.walk,), "both": (person.static, person.walk)}[where]
    if not all(needed <= set(file.markers.labels) for file in files):
        return None
    return {"static": person.in_static, "walk": person.in_walk, "both": person.in_both}[where](change)


def _renamed(markers: Markers, names: dict[str, str]) -> Markers:
    labels = tuple(names.get(label, label) for label in markers.labels)
    return replace(markers, labels=labels)


def _twin(label: str, labels: tuple[str, ...]) -> str | None:
    """Return the label of the other side: R and L exchanged somewhere in it."""
    for k, letter in enumerate(label):
        if letter in "RLrl":
            twin = label[:k] + {"R": "L", "L": "R", "r": "l", "l": "r"}[letter] + label[k + 1 :]
            for candidate in (twin, label[:k] + {"R": "L", "L": "R", "r": "L", "l": "R"}[letter] + label[k + 1 :]):
                if candidate in labels and candidate != label:
                    return candidate
            lower = label[:k] + {"L": "r", "R": "l", "r": "l", "l": "r"}[letter] + label[k + 1 :]
            if lower in labels:
                return lower
    return None


def _units(vectors: FloatArray) -> FloatArray:
    result: FloatArray = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return result
