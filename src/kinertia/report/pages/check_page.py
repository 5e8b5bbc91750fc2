"""Writes `check.html`: what `kinertia check` found, with forces, contacts and centres of pressure of each recording."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from kinertia.diagnostics.plates.ground_contact import Contact
from kinertia.findings.finding import Finding
from kinertia.findings.overview import Overview, reported
from kinertia.io.output_folder import complete_folder
from kinertia.report.figures.figure import (
    BLACK,
    GREEN,
    GREY,
    ORANGE,
    SIDES,
    UNUSED,
    Figure,
    Panel,
    base_layout,
    compact,
    plain,
    small_multiples,
    written,
)
from kinertia.report.figures.marker_figures import gap_figure, marker_scene
from kinertia.report.figures.skeleton_view import view
from kinertia.report.pages.finding_view import FindingView
from kinertia.report.pages.page import MOST_TRIALS, VIEW_FRAMES
from kinertia.report.pages.rendering import rendered
from kinertia.trial.data import LOAD_THRESHOLD_N, Markers, PlateLoads
from kinertia.trial.ground_contact import FIRM_LOAD_N, centre_of_pressure
from kinertia.trial.sampled_data import nearest_samples
from kinertia.workflow.check import ModelOverview, RecordingCheck

_LEFT_OUT = "left out"
_MOST_UNFOLDED = 4
"""Files listed above what to do next; of more, only the verdicts are counted there."""
MOST_SAMPLES = 1200
"""Largest number of samples drawn per curve, with the largest and smallest of those between."""
MOST_CONTACTS = 24
"""Whose centres of pressure are drawn: more would hide each other."""
_COMPONENTS = (
    ("upward", 1, {"color": BLACK, "width": 2}),
    ("along X", 0, {"color": ORANGE, "width": 1.3}),
    ("along Z", 2, {"color": GREEN, "width": 1.3}),
)
_FEET = {"r": SIDES["r"], "l": SIDES["l"], None: ("unknown foot", GREY)}
_WIDTHS_PX = {"1": 360, "2": 700, "3": 1000, "print": 960}
"""Widths of the page, by the number of columns of panels that fit."""
_LEAST_PX, _MOST_PX = 150, 460


@dataclass(frozen=True)
class Checked:
    """Verdict on one recording or model as a whole, and its findings by code."""

    name: str
    anchor: str
    verdict: str
    codes: tuple[str, ...]


def save_check_page(
    overviews: Sequence[Overview],
    recordings: Sequence[RecordingCheck],
    models: Sequence[ModelOverview],
    folder: str | Path,
) -> Path:
    """Write `check.html` into a folder and return the file.

    Args:
        overviews: findings of the person and of each model.
        recordings: contents of each recording, the static trial first.
        models: contents of each model.
        folder: folder to write to, made if necessary.

    Raises:
        FileError: the folder cannot be written to.
    """
    page = render_check(overviews, recordings, models)
    with complete_folder(folder, "check") as work:
        (work / "check.html").write_text(page, encoding="utf-8")
    return Path(folder) / "check.html"


def render_check(
    overviews: Sequence[Overview],
    recordings: Sequence[RecordingCheck],
    models: Sequence[ModelOverview] = (),
) -> str:
    """Render the page as text; arguments as in `save_check_page`. The first six recordings have pictures."""
    pictured = recordings[:MOST_TRIALS]
    most_frames = VIEW_FRAMES // max(len(pictured), 1)
    scenes = [(check.context.name, marker_scene(check.recording, check.used_set, most_frames)) for check in pictured]
    of_models = [model.overview for model in models]
    of_person = [overview for overview in overviews if not any(overview is other for other in of_models)]
    headlines = [("", overview) for overview in of_person] + [(model.name, model.overview) for model in models]
    left_out = {name for overview in of_person for name in overview.left_out}
    return rendered(
        "check.html.j2",
        title="Kinertia check",
        headlines=headlines if len(headlines) > 1 else [("", overview) for _, overview in headlines],
        found=FindingView([*of_person, *(_named(model) for model in models)]),
        files=[
            *(_recording(check, f"recording{k}", left_out) for k, check in enumerate(recordings, start=1)),
            *(_checked(model.name, f"model{k}", model.overview.findings) for k, model in enumerate(models, start=1)),
        ],
        most_unfolded=_MOST_UNFOLDED,
        recordings=recordings,
        pictures=[check_figures(check) for check in pictured],
        scenes=view(scenes) if scenes else None,
        most_contacts=MOST_CONTACTS,
        models=models,
    )


def _named(model: ModelOverview) -> Overview:
    """Add the model's file to its findings, since several may be on the page."""
    return replace(model.overview, findings=[finding.in_file(model.name) for finding in model.overview.findings])


def _recording(check: RecordingCheck, anchor: str, left_out: set[str]) -> Checked:
    checked = _checked(check.context.name, anchor, check.findings)
    return replace(checked, verdict=_LEFT_OUT) if checked.name in left_out else checked


def _checked(name: str, anchor: str, findings: Sequence[Finding]) -> Checked:
    overview = Overview(findings, 0, 1)
    found = dict.fromkeys(finding.code for finding in (*overview.waived, *reported(findings)))
    return Checked(name, anchor, overview.verdict, tuple(found))


def check_figures(check: RecordingCheck) -> dict[str, Any]:
    """Draw the pictures of a recording: "forces", "pressure", "gaps"; None where there is nothing to draw."""
    labels = [marker.label for marker in check.markers]
    figures: dict[str, Figure | None] = {
        "forces": force_figure(check),
        "pressure": pressure_figure(check),
        "gaps": gap_figure(check.recording.markers.select(labels), check.windows, check.recording.name),
    }
    return {name: None if figure is None else written(figure) for name, figure in figures.items()}


def force_figure(check: RecordingCheck) -> Figure | None:
    """Draw forces on every plate over time, with contacts by foot and intervals that no fit can use; None without.

    Unloaded plates are left out if others are loaded.
    """
    plates = check.recording.plates
    if plates is None:
        return None
    loaded = [p for p, plate in enumerate(check.plates) if plate.peak_n > LOAD_THRESHOLD_N]
    shown = loaded or list(range(len(plates.names)))
    start, end = float(plates.time[0]), float(plates.time[-1])
    grey = _unmeasured(check, start, end)
    panels = [
        Panel(f"{plates.names[p]} (N)", _forces(plates, p), [*grey, *map(_contact, check.plates[p].contacts)])
        for p in shown
    ]
    occupants = "; ".join(f"{check.plates[p].name}: {check.plates[p].stood_on()}" for p in shown)
    alt = f"Forces on {len(shown)} plates of {check.recording.name} over time, contacts by foot: {occupants}."
    return small_multiples(
        panels, alt, {"title": {"text": "time (s)", "standoff": 2, "font": {"size": 11}}, "range": [start, end]}
    )


def _forces(plates: PlateLoads, p: int) -> list[dict[str, Any]]:
    traces = []
    for name, axis, line in _COMPONENTS:
        values = plates.force[:, p, axis]
        kept = extremes_kept(values, MOST_SAMPLES)
        x, y = compact(plates.time[kept]), compact(values[kept])
        traces.append({"type": "scatter", "mode": "lines", "x": x, "y": y, "name": name, "line": line})
    return traces


def extremes_kept(values: np.ndarray, most: int) -> np.ndarray:
    """Return ascending indices of at most `most` samples, with the smallest and largest of every interval between."""
    if len(values) <= most:
        return np.arange(len(values))
    starts = np.linspace(0, len(values), most // 2, endpoint=False).astype(int)
    ends = [*starts[1:], len(values)]
    found = [
        first + at
        for first, last in zip(starts, ends, strict=True)
        for at in {int(np.argmin(values[first:last])), int(np.argmax(values[first:last]))}
    ]
    return np.sort(np.array(found))


def _unmeasured(check: RecordingCheck, start: float, end: float) -> list[dict[str, Any]]:
    """Shade intervals in which not all ground contact is measured; none where that is unknown."""
    if check.used_set is None or check.travel.kind == "stands still":
        return []
    edges = [start, *(t for window in sorted(check.windows) for t in window), end]
    return [_ground(a, b, UNUSED, 1.0) for a, b in zip(edges[::2], edges[1::2], strict=True) if b > a]


def _contact(contact: Contact) -> dict[str, Any]:
    return _ground(contact.start_s, contact.end_s, _FEET[contact.foot][1], 0.16)


def _ground(start: float, end: float, colour: str, opacity: float) -> dict[str, Any]:
    over = {"type": "rect", "yref": "domain", "x0": start, "x1": end, "y0": 0, "y1": 1, "layer": "below"}
    return {**over, "fillcolor": colour, "opacity": opacity, "line": {"width": 0}}


def pressure_figure(check: RecordingCheck) -> Figure | None:
    """Draw centres of pressure of every contact from above, under the foot in the middle of the contact.

    None where no plate carries anything.
    """
    plates = check.recording.plates
    contacts = [(p, contact) for p, plate in enumerate(check.plates) for contact in plate.contacts]
    if plates is None or not contacts:
        return None
    drawn = sorted(contacts, key=lambda drawn_contact: drawn_contact[1].start_s)[:MOST_CONTACTS]
    outlines = [] if plates.corners is None else [_plate(plates, p) for p in range(len(plates.names))]
    paths = [path for p, contact in drawn if (path := _path(plates, p, contact)) is not None]
    feet = [path for _, contact in drawn if (path := _foot(check, contact)) is not None]
    traces = [*outlines, *feet, *paths]
    if not paths:
        return None
    kinds = [f"{word} foot" if word != "unknown foot" else word for word, _ in _FEET.values()]
    alt = (
        f"Centres of pressure of {len(drawn)} of {len(contacts)} contacts of {check.recording.name}, seen from above, "
        f"under the markers of the foot; by {', '.join(kinds)}."
    )
    return _from_above(traces, alt)


def _from_above(traces: Sequence[dict[str, Any]], alt: str) -> Figure:
    """Make a figure from traces in ground coordinates "X" and "Z" (m), with the longer one across the page."""
    spans = {}
    for axis in "XZ":
        values = np.concatenate([np.asarray(trace[axis], dtype=float) for trace in traces])
        low, high = float(np.nanmin(values)) - 0.1, float(np.nanmax(values)) + 0.1
        spans[axis] = (low, high)
    across, along = ("X", "Z") if spans["X"][1] - spans["X"][0] >= spans["Z"][1] - spans["Z"][0] else ("Z", "X")
    wide, tall = (spans[axis][1] - spans[axis][0] for axis in (across, along))
    data, named = [], set()
    for trace in traces:
        rest = {name: value for name, value in trace.items() if name not in ("X", "Z")}
        first = trace["name"] not in named and trace.get("showlegend", True)
        named.add(trace["name"])
        places = {"x": compact(trace[across]), "y": compact(trace[along])}
        data.append({"type": "scatter", **rest, **places, "legendgroup": trace["name"], "showlegend": first})
    # seen from above, Z is to the right of X: downwards where X goes across the page
    low, high = spans[along]
    axes = {"zeroline": False, "gridcolor": "#EFEFEF", "constrain": "domain"}
    height = {
        key: {"height": 100 + round(min(max(0.9 * px * tall / wide, _LEAST_PX), _MOST_PX))}
        for key, px in _WIDTHS_PX.items()
    }
    layout = base_layout(alt) | {
        "height": height["3"]["height"],
        "meta": {"alt": alt, "arrangements": height},
        "margin": {"t": 56, "b": 44, "l": 56, "r": 14},
        "xaxis": {**axes, "range": list(spans[across]), "title": {"text": f"{across} (m)"}},
        "yaxis": {
            **axes,
            "range": [high, low] if across == "X" else [low, high],
            "title": {"text": f"{along} (m)"},
            "scaleanchor": "x",
            "scaleratio": 1,
        },
    }
    return Figure(data, layout)


def _plate(plates: PlateLoads, p: int) -> dict[str, Any]:
    assert plates.corners is not None
    ring = plates.corners[p][[0, 1, 2, 3, 0]]
    look = {"mode": "lines", "line": {"color": GREY, "width": 1.5}, "fill": "toself", "fillcolor": "#F3F3F3"}
    return {
        "X": ring[:, 0],
        "Z": ring[:, 2],
        "name": "plate",
        "showlegend": False,
        "text": plain(plates.names[p]),
        "hoverinfo": "text",
    } | look


def _path(plates: PlateLoads, p: int, contact: Contact) -> dict[str, Any] | None:
    """Draw the centre of pressure of one contact; None where its load is always too small."""
    inside = (plates.time >= contact.start_s) & (plates.time <= contact.end_s)
    inside &= plates.force[:, p, 1] > FIRM_LOAD_N
    if not inside.any():
        return None
    wrench = plates.wrench[inside, p]
    height_m = 0.0 if plates.corners is None else float(plates.corners[p, :, 1].mean())
    at = centre_of_pressure(wrench[:: -(-len(wrench) // 200)], height_m)
    word, colour = _FEET[contact.foot]
    text = f"{plain(plates.names[p])}, {contact.start_s:.2f} to {contact.end_s:.2f} s"
    line = {"mode": "lines", "line": {"color": colour, "width": 3}, "text": text, "hoverinfo": "text"}
    return {"X": at[:, 0], "Z": at[:, 2], "name": f"centre of pressure, {word}", **line}


def _foot(check: RecordingCheck, contact: Contact) -> dict[str, Any] | None:
    """Draw the markers of the foot in the middle of the contact; None where they are unknown."""
    if check.used_set is None or contact.foot is None:
        return None
    markers: Markers = check.recording.markers
    worn = [label for label in check.used_set.foot_labels()[contact.foot] if label in markers.labels]
    frame = int(nearest_samples(markers.time, np.array([0.5 * (contact.start_s + contact.end_s)]))[0])
    at = markers.select(worn).positions[frame][:, [0, 2]]
    seen = np.isfinite(at).all(axis=1)
    if not seen.any():
        return None
    around = at[seen] - at[seen].mean(axis=0)
    order = np.argsort(np.arctan2(around[:, 1], around[:, 0]))
    ring = at[seen][[*order, order[0]]]
    names = [worn[k] for k in np.flatnonzero(seen)]
    word, colour = _FEET[contact.foot]
    return {
        "X": ring[:, 0],
        "Z": ring[:, 1],
        "name": f"markers of the {word} foot",
        "mode": "lines+markers",
        "line": {"color": colour, "width": 1, "dash": "dot"},
        "marker": {"color": colour, "size": 6, "symbol": "circle-open"},
        "text": [plain(names[k]) for k in [*order, order[0]]],
        "hoverinfo": "text",
    }
