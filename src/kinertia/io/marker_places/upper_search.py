"""Finds landmarks of trunk and arms of a standing person; arms may be anywhere and rely more on labels."""

import numpy as np

from kinertia.io.marker_places.leg_search import Found
from kinertia.io.marker_places.standing_body import StandingBody
from kinertia.io.marker_places.usual_places import (
    ACROMION_FROM_ASIS,
    C7_FROM_ACROMIA,
    ELBOW_FROM_ACROMION,
    FOUND,
    INNER_ELBOW,
    NOTCH_FROM_ACROMIA,
    WRIST_FROM_ELBOW,
    by_distance,
)
from kinertia.trial.data import FloatArray

_WRIST_APART = (0.02, 0.06)
"""Distance of the two markers of a wrist, as shares of the stature."""


def find_upper_body(body: StandingBody, found: Found) -> None:
    """Find acromia, C7, sternal notch, elbows and wrists, and add them."""
    asis = {side: body.outward[side][found.markers[f"asis_{side}"]] for side in "rl"}
    middle = (asis["r"] + asis["l"]) / 2
    for side in "rl":
        anchor = np.array([middle[0], middle[1], asis[side][2]])
        _take(found, f"acromion_{side}", body.scores(ACROMION_FROM_ASIS, side, anchor, "acromion"))
    if not {"acromion_r", "acromion_l"} <= set(found.markers):
        found.drop("acromion_r", "acromion_l")
        shoulders = {}
        between = middle * [1.0, 1.0, 0.0] + np.array(ACROMION_FROM_ASIS.mean) * [1.0, 1.0, 0.0] * body.stature_m
    else:
        shoulders = {side: body.places[found.markers[f"acromion_{side}"]] for side in "rl"}
        between = (shoulders["r"] + shoulders["l"]) / 2
    _take(found, "c7", body.scores(C7_FROM_ACROMIA, "r", between, "c7"))
    _take(found, "sternal_notch", body.scores(NOTCH_FROM_ACROMIA, "r", between, "sternal_notch"))
    for side, shoulder in shoulders.items():
        _arm(body, found, side, shoulder)


def _take(found: Found, landmark: str, scores: FloatArray) -> None:
    """Assign the best marker that is still free to the landmark."""
    scores = scores.copy()
    scores[list(found.markers.values())] = -np.inf
    found.add(landmark, int(np.argmax(scores)), float(scores.max()))


def _arm(body: StandingBody, found: Found, side: str, shoulder: FloatArray) -> None:
    """Find the elbow by its label and its distance from the shoulder; its medial side and the wrist by distance too."""
    own = np.where(body.is_side(side), 0.0, -np.inf)
    from_shoulder = np.linalg.norm(body.places - shoulder, axis=1)
    elbow_scores = by_distance(from_shoulder, ELBOW_FROM_ACROMION, body.stature_m) + body.named("elbow_lateral") - FOUND
    _take(found, f"elbow_lateral_{side}", elbow_scores + own)
    if f"elbow_lateral_{side}" not in found.markers:
        return
    elbow = body.places[found.markers[f"elbow_lateral_{side}"]]
    from_elbow = np.linalg.norm(body.places - elbow, axis=1)
    inner = by_distance(from_elbow, INNER_ELBOW, body.stature_m) + body.named("elbow_medial")
    along = (body.places - elbow) @ (elbow - shoulder) / np.linalg.norm(elbow - shoulder)
    inner -= 0.5 * np.square(along / (0.02 * body.stature_m))
    _take(found, f"elbow_medial_{side}", inner + own - FOUND)
    wrist = by_distance(from_elbow, WRIST_FROM_ELBOW, body.stature_m) + body.named("wrist") + own
    wrist[from_shoulder < from_elbow] = -np.inf
    _take(found, f"wrist_{side}", wrist)
    if f"wrist_{side}" in found.markers:
        apart = np.linalg.norm(body.places - body.places[found.markers[f"wrist_{side}"]], axis=1) / body.stature_m
        wrist[(apart < _WRIST_APART[0]) | (apart > _WRIST_APART[1])] = -np.inf
        _take(found, f"wrist_other_{side}", wrist)
