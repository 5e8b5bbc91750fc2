"""Serves the page of a person's markers: a figure to turn, what is missing, a place for every label."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route

from kinertia.cli.web.entries import trouble
from kinertia.cli.web.jobs import Jobs
from kinertia.cli.web.library import Library, PersonFolder
from kinertia.cli.web.marker_assignment import MarkerPlaces, marker_places, save_places
from kinertia.cli.web.responses import expect, form, page, to
from kinertia.errors import KinertiaError
from kinertia.model.marker_set import LANDMARKS, SEGMENTS

_SEGMENT, _LANDMARK = "segment:", "landmark:"


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
    places: MarkerPlaces | None = None
    try:
        places = marker_places(person)
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


def _rows(places: MarkerPlaces, given: Mapping[str, str]) -> list[dict[str, str]]:
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


def _scene(places: MarkerPlaces, rows: list[dict[str, str]]) -> list[dict[str, Any]]:
    """Return the content of the figure: labels with positions in mm about the middle of the body."""
    seen = np.isfinite(places.positions).all(axis=1)
    middle = places.positions[seen].mean(axis=0) if seen.any() else np.zeros(3)
    at = dict(zip(places.labels, (1e3 * (places.positions - middle)), strict=True))
    return [
        {"label": row["label"], "at": None if np.isnan(at[row["label"]]).any() else at[row["label"]].round().tolist()}
        for row in rows
    ]
