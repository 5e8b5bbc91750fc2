"""Finds landmarks of a standing person, and the markers of the segments between them."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import linear_sum_assignment

from kinertia.io.marker_positions.standing_body import (
    ACROMION_FROM_ASIS,
    ANKLE_FROM_KNEE,
    ASIS,
    ASIS_APART,
    C7_FROM_ACROMIA,
    ELBOW_FROM_ACROMION,
    FOOT,
    FOUND,
    INNER_ANKLE,
    INNER_ELBOW,
    INNER_KNEE,
    KNEE_FROM_ASIS,
    NOTCH_FROM_ACROMIA,
    PSIS_FROM_ASIS,
    SACRUM_FROM_ASIS,
    WRIST_FROM_ELBOW,
    StandingBody,
    by_distance,
)
from kinertia.trial.data import FloatArray

_SQUARE = 0.85
"""Cosine of the most that a pelvis is turned against the rest of the body."""
_FOREFOOT = (0.03, 0.17)
_FOOT_HEIGHT, _FOOT_BREADTH = 0.075, 0.09
_WRIST_APART = (0.02, 0.06)
"""Distance of the two markers of a wrist, as shares of the stature."""
_KNEE_BAND, _ANKLE_BAND = 0.02, 0.012
"""Band (shares of stature) around a joint's height in which a marker that is no landmark is on it: a kneecap."""
_BELOW_PELVIS, _ON_PELVIS, _LUMBAR = -0.025, 0.018, 0.075
"""Heights of a pelvis' markers over its front and its back, and from which on over the front the torso begins."""
_PELVIS_BREADTH, _LEG_BREADTH, _TRUNK_BREADTH = 0.095, 0.075, 0.135
_AHEAD_OF_ANKLE = 0.02
WAND_BONUS_M = 0.1
_ARM_BREADTH, _ALONG = 0.07, (-0.05, 1.1)
_OF = {
    "asis": "pelvis",
    "psis": "pelvis",
    "sacrum": "pelvis",
    "knee": "thigh",
    "ankle": "shank",
    "heel": "foot",
    "metatarsal": "foot",
    "toe": "foot",
    "acromion": "torso",
    "c7": "torso",
    "sternal": "torso",
    "elbow": "upper_arm",
    "wrist": "forearm",
}


@dataclass(frozen=True)
class Found:
    """Landmarks found so far, with their markers and scores.

    Attributes:
        markers: landmark -> index of the marker; names such as `metatarsal_inner_r` are parts of one.
        scores: landmark -> how well it fits, above zero.
    """

    markers: dict[str, int] = field(default_factory=dict)
    scores: dict[str, float] = field(default_factory=dict)

    @property
    def score(self) -> float:
        """Sum of all scores."""
        return sum(self.scores.values())

    def drop(self, *landmarks: str) -> None:
        """Remove these landmarks."""
        for landmark in landmarks:
            self.markers.pop(landmark, None)
            self.scores.pop(landmark, None)

    def add(self, landmark: str, marker: int, score: float) -> None:
        """Assign a marker to a landmark if it fits."""
        if score > 0 and marker not in self.markers.values():
            self.markers[landmark], self.scores[landmark] = marker, float(score)


def find_legs(body: StandingBody) -> Found:
    """Find the leg landmarks with this heading and stature; none without the front of a pelvis."""
    found = Found()
    _pelvis(body, found)
    if "asis_r" in found.markers:
        for side in "rl":
            _joints(body, found, side)
            if f"ankle_lateral_{side}" in found.markers:
                _foot(body, found, side)
    return found


def _pelvis(body: StandingBody, found: Found) -> None:
    """Find both ASIS and behind them, in their axes, both PSIS or the sacrum."""
    free = ASIS.score(body.places, body.stature_m) + body.named("asis")
    best: tuple[float, dict[str, tuple[int, float]]] = (0.0, {})
    for right, left in np.argwhere(free[:, None] + free[None] > 0):
        across = (body.places[right] - body.places[left]) * [1.0, 0.0, 1.0]
        width = float(np.linalg.norm(across))
        if right == left or across[2] <= _SQUARE * width:
            continue
        front = float(
            free[right] + free[left] + ASIS_APART.score(body.places[right] - body.places[left], body.stature_m)
        )
        z = across / width
        local = (body.places - (body.places[right] + body.places[left]) / 2) @ np.array(
            [[z[2], 0.0, -z[0]], [0.0, 1.0, 0.0], z]
        ).T
        back = _back_of_pelvis(body, local, (int(right), int(left)))
        if not back:
            continue
        total = front + sum(score for _, score in back.values())
        if total > best[0]:
            best = (total, {"asis_r": (int(right), front / 2), "asis_l": (int(left), front / 2), **back})
    for landmark, (marker, score) in best[1].items():
        found.add(landmark, marker, max(score, 0.1))


def _back_of_pelvis(body: StandingBody, local: FloatArray, taken: tuple[int, int]) -> dict[str, tuple[int, float]]:
    """Find both PSIS, else the sacrum, in axes of the pelvis (m, 3) m; each with its score."""
    back: dict[str, tuple[int, float]] = {}
    for side, sign in (("r", 1.0), ("l", -1.0)):
        scores = PSIS_FROM_ASIS.score(local * [1.0, 1.0, sign], body.stature_m) + body.named("psis")
        scores[[*taken, *(marker for marker, _ in back.values())]] = -np.inf
        back[f"psis_{side}"] = (int(np.argmax(scores)), float(scores.max()))
    if min(score for _, score in back.values()) > 0:
        return back
    scores = SACRUM_FROM_ASIS.score(local, body.stature_m) + body.named("sacrum")
    scores[list(taken)] = -np.inf
    return {"sacrum": (int(np.argmax(scores)), float(scores.max()))} if scores.max() > 0 else {}


def _joints(body: StandingBody, found: Found, side: str) -> None:
    """Find lateral and medial markers of knee and ankle."""
    asis = {leg: body.outward[leg][found.markers[f"asis_{leg}"]] for leg in "rl"}
    anchor = np.array([*((asis["r"] + asis["l"]) / 2)[:2], asis[side][2]])
    knees = _hinges(body, body.scores(KNEE_FROM_ASIS, side, anchor, "knee_lateral"), "knee", side, found)
    best: tuple[float, dict[str, tuple[int, float]]] = (0.0, {})
    for score, knee in knees:
        at = body.outward[side][knee[f"knee_lateral_{side}"][0]]
        ankles = _hinges(body, body.scores(ANKLE_FROM_KNEE, side, at, "ankle_lateral"), "ankle", side, found)
        below, ankle = max(ankles, key=lambda candidate: candidate[0], default=(0.0, {}))
        if score + below > best[0]:
            best = (score + below, knee | ankle)
    for landmark, (marker, score) in best[1].items():
        found.add(landmark, marker, score)


def _hinges(
    body: StandingBody, outer: FloatArray, joint: str, side: str, found: Found
) -> list[tuple[float, dict[str, tuple[int, float]]]]:
    """List scores and markers of candidate lateral sides of a joint, each with the best matching medial one."""
    usual = INNER_KNEE if joint == "knee" else INNER_ANKLE
    taken = list(found.markers.values())
    hinges = []
    for lateral in map(int, np.flatnonzero(outer > 0)):
        if lateral in taken:
            continue
        hinge = {f"{joint}_lateral_{side}": (lateral, float(outer[lateral]))}
        inner = body.scores(usual, side, body.outward[side][lateral], f"{joint}_medial")
        inner[[lateral, *taken]] = -np.inf
        best = int(np.argmax(inner))
        if inner[best] > 0:
            hinge[f"{joint}_medial_{side}"] = (best, float(inner[best]))
        hinges.append((sum(score for _, score in hinge.values()), hinge))
    return hinges


def _foot(body: StandingBody, found: Found, side: str) -> None:
    """Find heel, metatarsal heads and toe, each with its own marker, in axes along the foot."""
    ankle = body.outward[side][found.markers[f"ankle_lateral_{side}"]]
    offsets = (body.outward[side] - ankle) / body.stature_m
    low = (body.outward[side][:, 1] < _FOOT_HEIGHT * body.stature_m) & (np.abs(offsets[:, 2]) < _FOOT_BREADTH)
    low[list(found.markers.values())] = False
    low &= np.isfinite(body.trust)
    ahead = low & (offsets[:, 0] > _FOREFOOT[0]) & (offsets[:, 0] < _FOREFOOT[1])
    low_markers = np.flatnonzero(low)
    if not ahead.any():
        return
    toes = np.add(offsets[ahead].mean(axis=0), (0.0, 0.0, 0.02))  # the foot is on the inner side of the outer ankle
    turn = np.arctan2(toes[2], toes[0])
    c, s = np.cos(turn), np.sin(turn)
    along = offsets[low_markers] @ np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]).T
    scores = {
        name: usual.score(along, 1.0) + body.named(name.split("_")[0])[low_markers] for name, usual in FOOT.items()
    }
    wide = _assigned({name: score for name, score in scores.items() if name != "metatarsal_middle"})
    if not {"metatarsal_inner", "metatarsal_outer"} <= set(wide):
        narrow = _assigned({name: scores[name] for name in ("heel", "metatarsal_middle", "toe")})
        wide = narrow if "metatarsal_middle" in narrow else wide
    for name, row in wide.items():
        found.add(f"{name}_{side}", int(low_markers[row]), float(scores[name][row]))


def _assigned(scores: Mapping[str, FloatArray]) -> dict[str, int]:
    """Assign to each name the row that maximises the sum of scores, only where scores are above zero."""
    table = np.stack(list(scores.values()), axis=1)
    rows, columns = linear_sum_assignment(-np.maximum(table, 0.0))
    names = list(scores)
    return {names[k]: int(row) for row, k in zip(rows, columns, strict=True) if table[row, k] > 0}


def metatarsals(found: Mapping[str, int], side: str) -> tuple[list[int], str]:
    """Return the markers whose mean is the middle of the metatarsal heads, and a description."""
    inner, outer, middle = (found.get(f"metatarsal_{which}_{side}") for which in ("inner", "outer", "middle"))
    if inner is not None and outer is not None:
        return [inner, outer], "midpoint of the medial and lateral metatarsal heads"
    if middle is not None:
        return [middle], "a central metatarsal head"
    for head, which in ((inner, "inner"), (outer, "outer")):
        if head is not None:
            return [
                head
            ], f"only a marker of the {which} metatarsal heads: the middle of the foot is a little beside it"
    return [], ""


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
    on_side = np.where(body.is_side(side), 0.0, -np.inf)
    from_shoulder = np.linalg.norm(body.places - shoulder, axis=1)
    elbow_scores = by_distance(from_shoulder, ELBOW_FROM_ACROMION, body.stature_m) + body.named("elbow_lateral") - FOUND
    _take(found, f"elbow_lateral_{side}", elbow_scores + on_side)
    if f"elbow_lateral_{side}" not in found.markers:
        return
    elbow = body.places[found.markers[f"elbow_lateral_{side}"]]
    from_elbow = np.linalg.norm(body.places - elbow, axis=1)
    inner = by_distance(from_elbow, INNER_ELBOW, body.stature_m) + body.named("elbow_medial")
    along = (body.places - elbow) @ (elbow - shoulder) / np.linalg.norm(elbow - shoulder)
    inner -= 0.5 * np.square(along / (0.02 * body.stature_m))
    _take(found, f"elbow_medial_{side}", inner + on_side - FOUND)
    wrist = by_distance(from_elbow, WRIST_FROM_ELBOW, body.stature_m) + body.named("wrist") + on_side
    wrist[from_shoulder < from_elbow] = -np.inf
    _take(found, f"wrist_{side}", wrist)
    if f"wrist_{side}" in found.markers:
        apart = np.linalg.norm(body.places - body.places[found.markers[f"wrist_{side}"]], axis=1) / body.stature_m
        wrist[(apart < _WRIST_APART[0]) | (apart > _WRIST_APART[1])] = -np.inf
        _take(found, f"wrist_other_{side}", wrist)


def segment_members(body: StandingBody, found: Found) -> dict[int, str]:
    """Return marker -> segment, for markers that move with one; others are on joints, on hands, or unknown."""
    members: dict[int, str] = {}
    for landmark, marker in found.markers.items():
        segment = _OF[landmark.split("_")[0]]
        members[marker] = segment if segment in ("pelvis", "torso") else f"{segment}_{landmark[-1]}"
    if "asis_r" not in found.markers:
        return members
    for marker in range(len(body.labels)):
        if marker in members:
            continue
        side = "r" if body.is_side("r")[marker] else "l"
        segment = _arm_of(body, found.markers, side, marker) or _trunk_or_leg(body, found.markers, side, marker)
        hinted = {_OF.get(role.split("_")[0], role) for role in body.meant[marker]}
        if segment and segment in (hinted or {segment}):
            members[marker] = segment if segment in ("pelvis", "torso") else f"{segment}_{side}"
    return members


def _trunk_or_leg(body: StandingBody, found: Mapping[str, int], side: str, marker: int) -> str:
    at, stature = body.outward[side][marker], body.stature_m
    asis = {leg: body.outward[leg][found[f"asis_{leg}"]] for leg in "rl"}
    middle, height = (asis["r"] + asis["l"]) / 2, (asis["r"][1] + asis["l"][1]) / 2
    above = (at[1] - height) / stature
    back = max(body.places[found[name]][1] for name in ("psis_r", "psis_l", "sacrum") if name in found)
    if at[1] > max(back, height) + _ON_PELVIS * stature:  # what is on the lumbar spine moves with neither
        return "torso" if above > _LUMBAR and abs(at[2]) < _TRUNK_BREADTH * stature else ""
    if abs(at[2] - middle[2]) > 2 * _TRUNK_BREADTH * stature:
        return ""
    if above > _BELOW_PELVIS and abs(body.places[marker][2]) < _PELVIS_BREADTH * stature:
        return "pelvis"
    knee, ankle = (found.get(f"{joint}_lateral_{side}") for joint in ("knee", "ankle"))
    if knee is None or ankle is None:
        return ""
    joints = [body.outward[side][joint_marker] for joint_marker in (knee, ankle)]
    if at[1] > joints[0][1] + _KNEE_BAND * stature:
        return "thigh" if _beside(at, joints[0], asis[side], stature) else ""
    if at[1] > joints[0][1] - _KNEE_BAND * stature:
        return ""
    ahead = (at[0] - joints[1][0]) / stature
    over = (at[1] - joints[1][1]) / stature
    if over > 2 * _ANKLE_BAND and abs(ahead) < 0.08:
        return "shank" if _beside(at, joints[1], joints[0], stature) else ""
    if ahead > _AHEAD_OF_ANKLE or over < -_ANKLE_BAND:
        return "foot"
    return ""


def _beside(at: FloatArray, lower: FloatArray, upper: FloatArray, stature: float) -> bool:
    """Return whether a marker is near the lateral line of a segment, and not on a hand that hangs beside it."""
    share = np.clip((at[1] - lower[1]) / max(upper[1] - lower[1], 1e-6), 0.0, 1.0)
    return bool(at[2] < (lower + share * (upper - lower))[2] + _LEG_BREADTH * stature)


def _arm_of(body: StandingBody, found: Mapping[str, int], side: str, marker: int) -> str:
    """Return the upper arm or the forearm where a marker is along one of them."""
    ends = [found.get(f"{name}_{side}") for name in ("acromion", "elbow_lateral", "wrist")]
    known = [body.places[arm_marker] for arm_marker in ends if arm_marker is not None]
    if len(known) < 3:
        return ""
    best = ("", _ARM_BREADTH * body.stature_m)
    for segment, upper, lower in zip(("upper_arm", "forearm"), known, known[1:], strict=False):
        along = lower - upper
        share = float((body.places[marker] - upper) @ along / (along @ along))
        if not 0.12 < share < _ALONG[1]:
            continue
        off = float(np.linalg.norm(body.places[marker] - upper - share * along))
        if off < best[1] and abs(body.places[marker][2]) > _PELVIS_BREADTH * body.stature_m:
            best = (segment, off)
    return best[0]


def wands(body: StandingBody, found: Found, members: Mapping[int, str]) -> dict[str, list[int]]:
    """Return the outermost markers of thigh and shank for legs whose knee or ankle has no medial marker: with the
    joint's width they determine the joint centre (Davis et al. 1991).
    """
    chosen = {}
    for segment, joint in (("thigh", "knee"), ("shank", "ankle")):
        for side in "rl":
            lateral = found.markers.get(f"{joint}_lateral_{side}")
            if lateral is None or f"{joint}_medial_{side}" in found.markers:
                continue
            beyond = {
                marker: body.outward[side][marker][2]
                - body.outward[side][lateral][2]
                + WAND_BONUS_M * (f"{segment}_wand" in body.meant[marker])
                for marker, segment_of_marker in members.items()
                if segment_of_marker == f"{segment}_{side}"
                and marker not in found.markers.values()
                and np.isfinite(body.trust[marker])
            }
            if beyond and max(beyond.values()) > -_LEG_BREADTH / 3 * body.stature_m:
                chosen[f"{segment}_wand_{side}"] = [max(beyond, key=lambda marker: beyond[marker])]
    return chosen
