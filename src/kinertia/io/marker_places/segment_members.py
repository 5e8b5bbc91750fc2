"""Assigns the markers of a standing person to segments, by the landmarks around them."""

from collections.abc import Mapping

import numpy as np

from kinertia.io.marker_places.landmark_search import Found
from kinertia.io.marker_places.standing_body import StandingBody
from kinertia.trial.data import FloatArray

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
    asis = {one: body.outward[one][found[f"asis_{one}"]] for one in "rl"}
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
    joints = [body.outward[side][one] for one in (knee, ankle)]
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
    known = [body.places[one] for one in ends if one is not None]
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
                for marker, own in members.items()
                if own == f"{segment}_{side}"
                and marker not in found.markers.values()
                and np.isfinite(body.trust[marker])
            }
            if beyond and max(beyond.values()) > -_LEG_BREADTH / 3 * body.stature_m:
                chosen[f"{segment}_wand_{side}"] = [max(beyond, key=lambda marker: beyond[marker])]
    return chosen
