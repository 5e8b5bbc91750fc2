"""Serves the page of a person's markers: where each is on the body, corrections, and the marker set saved from them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route

from kinertia.cli.web.entries import entries, trouble, write
from kinertia.cli.web.jobs import Jobs
from kinertia.cli.web.library import Library, PersonFolder
from kinertia.cli.web.responses import expect, form, page, to
from kinertia.diagnostics.markers.marker_set import match_labels
from kinertia.errors import FileError, KinertiaError, SettingsError
from kinertia.io.marker_set_draft import places_of
from kinertia.io.marker_set_file import marker_set_text, preset_names, read_marker_set
from kinertia.io.opensim.reader import read_osim
from kinertia.io.output_folder import write_then_rename
from kinertia.io.recording import read_recording
from kinertia.model.imported_model import markers_of_model
from kinertia.model.marker_set import LANDMARKS, SEGMENTS, MarkerSet
from kinertia.trial.data import FloatArray, Markers

_SEGMENT, _LANDMARK = "segment:", "landmark:"
FILE = "markers.toml"
"""The person's own marker set."""
_HEADING = "# Written by kinertia app; name it under [model] markers or with --markers."


@dataclass(frozen=True, eq=False)
class MarkerPositions:
    """Markers of one recording and their assignment to segments and landmarks.

    Attributes:
        file: name of the recording.
        labels: labels of the recording.
        positions: (m, 3) m, in ground axes, of the frame that shows most of them; NaN where not visible.
        set_name: name of the marker set, or of the nearest preset.
        fits: whether the set is the recording's.
        of_model: whether the set is the markers of an OpenSim model, which are not assigned by hand.
        segments, landmarks: segment and landmark of every label that has one.
        missing: labels of the set that the recording lacks, each with similar ones.
    """

    file: str
    labels: tuple[str, ...]
    positions: FloatArray
    set_name: str
    fits: bool
    of_model: bool
    segments: Mapping[str, str]
    landmarks: Mapping[str, str]
    missing: Mapping[str, Sequence[str]]

    @property
    def unknown(self) -> tuple[str, ...]:
        """Labels without a segment."""
        return tuple(label for label in self.labels if label not in self.segments)


def marker_positions(person: PersonFolder) -> MarkerPositions:
    """Read the markers of the static trial, or of the first other recording.

    Raises:
        KinertiaError: there is no recording, or it cannot be read.
    """
    content = entries(person)
    model = _table(content.get("model"))
    path, unit = _recording(person, content)
    recording = read_recording(path, length_unit=unit).without_empty_markers()
    markers = recording.markers
    wanted = _named_set(person, model)
    match, used = match_labels(markers.labels, wanted)
    if used is not None:
        places = {name: dict(_owners(letters)) for name, letters in (("s", used.segments), ("l", used.landmarks))}
    else:
        placed = places_of(recording)
        places = {"s": dict(_owners(placed.segments)), "l": dict(_owners(placed.landmarks))}
    here = set(markers.labels)
    return MarkerPositions(
        path.name,
        markers.labels,
        _fullest_frame(markers),
        match.name,
        match.fits,
        match.of_model,
        {label: place for label, place in places["s"].items() if label in here},
        {label: place for label, place in places["l"].items() if label in here},
        match.missing,
    )


def save_places(person: PersonFolder, segments: Mapping[str, str], landmarks: Mapping[str, str]) -> None:
    """Write the person's own marker set, and enter it in the subject file.

    Args:
        person: the person.
        segments, landmarks: segment and landmark of every label that has one.

    Raises:
        KinertiaError: they make no valid marker set; then nothing is changed.
    """
    places = marker_positions(person)
    if places.of_model:
        raise SettingsError("the markers of an OpenSim model are assigned in its file")
    before = _named_set(person, _table(entries(person).get("model")))
    if before is None and places.fits:
        before = match_labels(places.labels, None)[1]
    text = marker_set_text(
        person.name,
        _grouped(landmarks, places.labels, LANDMARKS),
        _grouped(segments, places.labels, SEGMENTS),
        {} if before is None else before.widths,
        places.labels,
        _HEADING,
    )
    path = person.folder / FILE
    earlier = path.read_text(encoding="utf-8") if path.is_file() else None
    write_then_rename(path, text)
    try:
        read_marker_set(path)
    except KinertiaError:
        if earlier is None:
            path.unlink()
        else:
            write_then_rename(path, earlier)
        raise
    content = entries(person)
    write(person, {**content, "model": {**_table(content.get("model")), "markers": FILE}})
    person.note(seen=[path.name for path in person.files()])


def _grouped(places: Mapping[str, str], labels: Sequence[str], known: Sequence[str]) -> dict[str, list[str]]:
    """Group labels by their place, in the order of the recording."""
    grouped: dict[str, list[str]] = {}
    for label in labels:
        if places.get(label) in known:
            grouped.setdefault(places[label], []).append(label)
    return grouped


def _owners(places: Mapping[str, Sequence[str]]) -> list[tuple[str, str]]:
    return [(label, place) for place, labels in places.items() for label in labels]


def _named_set(person: PersonFolder, model: Mapping[str, Any]) -> MarkerSet | None:
    """Return the set that the subject file states, or that its model has."""
    if "osim" in model:
        return markers_of_model(read_osim(person.folder / model["osim"]))
    named = model.get("markers")
    if named is None:
        return None
    return read_marker_set(named if named in preset_names() else person.folder / named)


def _recording(person: PersonFolder, content: Mapping[str, Any]) -> tuple[Path, str | None]:
    model, trials = _table(content.get("model")), content.get("trial")
    if "static" in model:
        return person.folder / model["static"], model.get("length_unit")
    for trial in trials if isinstance(trials, list) else ():
        if "markers" in trial:
            return person.folder / trial["markers"], trial.get("length_unit")
    raise FileError(
        person.folder, "no recording is marked as static trial or walk yet; choose one in the table of files"
    )


def _fullest_frame(markers: Markers) -> FloatArray:
    seen = np.isfinite(markers.positions).all(axis=2)
    positions: FloatArray = markers.positions[int(np.argmax(seen.sum(axis=1)))]
    return positions


def _table(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def marker_routes(library: Library, jobs: Jobs) -> list[BaseRoute]:
    """Return the routes that show and save the places of a person's markers."""

    async def show(request: Request) -> Response:
        return await run_in_threadpool(_page, request, expect(library.person(request.path_params["name"])))

    async def save(request: Request) -> Response:
        person = expect(library.person(request.path_params["name"]))
        if jobs.busy(person):
            raise HTTPException(409, "wait for the check or fit of this person, or cancel it, before changing anything")
        given = await form(request)
        chosen = [
            {name.removeprefix(start): place for name, place in given.items() if name.startswith(start) and place}
            for start in (_SEGMENT, _LANDMARK)
        ]
        try:
            await run_in_threadpool(save_places, person, chosen[0], chosen[1])
        except KinertiaError as error:
            return await run_in_threadpool(_page, request, person, str(error), given)
        if not trouble(person):
            jobs.add(person, "check")
        return to(request, "people", person.name)

    address = "/people/{name}/markers"
    return [Route(address, show), Route(address, save, methods=["POST"])]


def _page(
    request: Request, person: PersonFolder, problem: str = "", given: Mapping[str, str] | None = None
) -> Response:
    places: MarkerPositions | None = None
    try:
        places = marker_positions(person)
    except KinertiaError as error:
        problem = problem or str(error)
    rows = [] if places is None else _rows(places, given or {})
    return page(
        request,
        "markers.html.j2",
        422 if problem else 200,
        person=person,
        places=places,
        problem=problem,
        rows=rows,
        segments=[(name, in_words(name)) for name in SEGMENTS],
        landmarks=[(name, in_words(name)) for name in LANDMARKS],
        scene=None if places is None else _scene(places, rows),
        names={"segment": _SEGMENT, "landmark": _LANDMARK},
    )


def in_words(name: str) -> str:
    """Return a name in words: "upper_arm_r" is the right upper arm."""
    side = {"_r": "right ", "_l": "left "}.get(name[-2:], "")
    return side + (name[:-2] if side else name).replace("_", " ")


def _rows(places: MarkerPositions, given: Mapping[str, str]) -> list[dict[str, str]]:
    """List every label with its place, those without first."""
    rows = [
        {
            "label": label,
            "segment": given.get(_SEGMENT + label, places.segments.get(label, "")),
            "landmark": given.get(_LANDMARK + label, places.landmarks.get(label, "")),
        }
        for label in places.labels
    ]
    return sorted(rows, key=lambda row: bool(row["segment"]))


def _scene(places: MarkerPositions, rows: list[dict[str, str]]) -> list[dict[str, Any]]:
    """Return the content of the figure: labels with positions in mm about the middle of the body."""
    seen = np.isfinite(places.positions).all(axis=1)
    middle = places.positions[seen].mean(axis=0) if seen.any() else np.zeros(3)
    at = dict(zip(places.labels, (1e3 * (places.positions - middle)), strict=True))
    return [
        {"label": row["label"], "at": None if np.isnan(at[row["label"]]).any() else at[row["label"]].round().tolist()}
        for row in rows
    ]
