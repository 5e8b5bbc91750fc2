"""Do the labels make a body? Left and right, front and back, outside and inside of a person, from the markers alone.

Which way somebody faces is told by the feet and the pelvis, without any side; then every pair of landmarks says whether
its right one is on the right, and every joint whether its outer landmark is outside.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import FloatArray, Markers

_UP = np.array([0.0, 1.0, 0.0])
_CLEAR = 0.5
"""Cosine beyond which a direction is clear: feet turn out and knees turn in by less than 60 degrees."""
_UPRIGHT = 0.5
"""Cosine of 60 degrees: who sits has the pelvis half beside the feet."""
_OPPOSED = 0.2
"""Cosine; the sides of a sound pelvis are up to 70 degrees apart, those of one with a side turned 110 or more."""
_FLAT = 0.8
"""Cosine of 37 degrees."""
_BELOW_M = 0.05
_GOES_M = 0.5
_BEHIND, _BEYOND = -0.1, 1.1
_BENT = 0.35
"""Sine of 20 degrees: beyond it, an elbow's bend is clear."""
_PAIRS = ("asis", "psis", "knee_lateral", "ankle_lateral", "heel", "metatarsal", "acromion")
_OUTER = (("knee_lateral", "knee_medial"), ("ankle_lateral", "ankle_medial"))
_WORDS = {"r": "right", "l": "left"}


def sides_trouble(markers: Markers, marker_set: MarkerSet) -> str:
    """What the labels have the wrong way round, what shows it, and what to do; empty where nothing is.

    Directions are medians over the frames, so that a few bad frames do not count.

    Args:
        markers: of a person upright, standing or walking; Y up.
        marker_set: which label is which landmark.
    """
    places = _landmarks(markers, marker_set)
    if lying := _lying_trouble(places):
        return lying
    fronts = _fronts(places)
    if one_sided := _pelvis_side_trouble(places, fronts, marker_set):
        return one_sided
    if len(fronts) < 2:
        return ""
    turned = _odd_one_out(fronts)
    if turned:
        return _front_trouble(turned, marker_set)
    facing = np.array([_unit(front) for front in fronts.values()])
    known = np.isfinite(facing)
    forward = _level(np.where(known, facing, 0.0).sum(axis=0) / np.where(known.any(axis=0), known.sum(axis=0), np.nan))
    right = np.cross(forward, _UP)
    across = {pair: _cosine(places[f"{pair}_r"] - places[f"{pair}_l"], right) for pair in _both(places)}
    wrong = [pair for pair, cosine in across.items() if cosine < -_CLEAR]
    if wrong and len(wrong) == sum(abs(cosine) > _CLEAR for cosine in across.values()) and len(wrong) > 1:
        return (
            f"all {len(wrong)} pairs of landmarks have left and right the wrong way round, as toes and pelvis face; "
            f"either all left and right labels are swapped, or an axis of the laboratory is mirrored: correct the "
            f"labels, or export in right-handed axes"
        )
    if wrong:
        pairs = ", ".join(_names(marker_set, f"{pair}_r", f"{pair}_l") for pair in wrong)
        return (
            f"left and right look swapped in the labels {pairs}: toes and pelvis face the other way than they say; "
            f"correct the labels"
        )
    return (
        _order_trouble(places, marker_set)
        or _ankle_trouble(places, marker_set)
        or _thigh_trouble(markers, marker_set)
        or _outside_trouble(places, right, marker_set)
        or _elbow_trouble(places, right, marker_set)
    )


def walks_backwards(markers: Markers, marker_set: MarkerSet) -> bool:
    """Whether somebody goes where neither feet nor pelvis point; not if nobody goes anywhere."""
    fronts = _fronts(_landmarks(markers, marker_set))
    shown = np.asarray(np.isfinite(markers.positions).any(axis=(1, 2)))
    middle = np.nanmedian(markers.positions[shown], axis=1)
    if not fronts or len(middle) < 2 or np.linalg.norm(_level(middle[-1] - middle[0])) < _GOES_M:
        return False
    way = np.broadcast_to(middle[-1] - middle[0], markers.positions[:, 0].shape)
    return all(_cosine(front, way) < -_CLEAR for front in fronts.values())


def _lying_trouble(places: Mapping[str, FloatArray]) -> str:
    """A pelvis that is beside the feet, or under them: the person is upright, but not along Y."""
    feet = [place for name, place in places.items() if name.startswith(("heel", "ankle_lateral", "metatarsal"))]
    if not feet or not {"asis_r", "asis_l"} <= set(places):
        return ""
    lines = (places["asis_r"] + places["asis_l"]) / 2 - np.mean(feet, axis=0)
    lines = lines[np.isfinite(lines).all(axis=1)]
    if not len(lines):
        return ""
    along = np.median(lines, axis=0)
    length = float(np.linalg.norm(along))
    if along[1] > _UPRIGHT * length:
        return ""
    axis = int(np.argmax(np.abs(along)))
    sign = "-" if along[axis] < 0 else "+"
    return (
        f"from the feet to the pelvis it goes {abs(along[axis]):.2f} m along {sign}{'XYZ'[axis]} and {along[1]:.2f} m "
        f"along +Y, which should be up; turn the file's axes so that {sign}{'XYZ'[axis]} becomes +Y"
    )


def _pelvis_side_trouble(
    places: Mapping[str, FloatArray], fronts: Mapping[str, FloatArray], marker_set: MarkerSet
) -> str:
    """Front and back exchanged on one side of the pelvis: its sides point to the front and to the back."""
    if not {"asis_r", "asis_l", "psis_r", "psis_l"} <= set(places):
        return ""
    sides = {side: _level(places[f"asis_{side}"] - places[f"psis_{side}"]) for side in "rl"}
    if not _cosine(sides["r"], sides["l"]) < -_OPPOSED:
        return ""
    feet = [front for name, front in fronts.items() if name.startswith("foot")]
    backwards = [side for side, along in sides.items() if feet and max(_cosine(along, front) for front in feet) < 0.0]
    which = f"the {_WORDS[backwards[0]]} side" if len(backwards) == 1 else "one side"
    labels = _names(marker_set, *(f"{name}_{side}" for side in backwards or "rl" for name in ("asis", "psis")))
    return f"front and back of the pelvis look swapped on {which}, in the labels {labels}; correct them"


def _landmarks(markers: Markers, marker_set: MarkerSet) -> dict[str, FloatArray]:
    """(n, 3) m of the landmarks whose labels are all there."""
    return {
        name: markers.select(labels).positions.mean(axis=1)
        for name, labels in marker_set.landmarks.items()
        if labels and set(labels) <= set(markers.labels)
    }


def _fronts(places: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """(n, 3): where the right foot, the left foot and the pelvis point, each from its own back to its front; NaN while
    a foot is steep: behind a runner it points down and backwards.
    """
    fronts = {}
    for side in "rl":
        toe = next((f"{name}_{side}" for name in ("metatarsal", "toe") if f"{name}_{side}" in places), "")
        if toe and f"heel_{side}" in places:
            along = places[toe] - places[f"heel_{side}"]
            flat = np.linalg.norm(_level(along), axis=1) > _FLAT * np.linalg.norm(along, axis=1)
            fronts[f"foot_{side}"] = np.where(flat[:, None], _level(along), np.nan)
    back = [places[name] for name in ("psis_r", "psis_l", "sacrum") if name in places]
    if back and {"asis_r", "asis_l"} <= set(places):
        fronts["pelvis"] = _level((places["asis_r"] + places["asis_l"]) / 2 - np.mean(back, axis=0))
    return {name: front for name, front in fronts.items() if np.isfinite(front).all(axis=1).any()}


def _odd_one_out(fronts: Mapping[str, FloatArray]) -> str:
    """The part that points backwards by the other two; of two parts nobody knows which is wrong."""
    if len(fronts) < 3:
        return ""
    agreed = {(foot, "pelvis"): _cosine(fronts[foot], fronts["pelvis"]) for foot in ("foot_l", "foot_r")}
    # a runner's feet are hardly ever flat at the same time: each against the pelvis says where they point by each other
    left, right = (_turn_from(fronts["pelvis"], fronts[foot]) for foot in ("foot_l", "foot_r"))
    agreed["foot_l", "foot_r"] = float((left * right.conjugate()).real)
    for part in fronts:
        with_it = [cosine for pair, cosine in agreed.items() if part in pair]
        without = [cosine for pair, cosine in agreed.items() if part not in pair]
        if max(with_it) < -_CLEAR and min(without) > _CLEAR:
            return part
    return ""


def _turn_from(vectors: FloatArray, others: FloatArray) -> complex:
    """Mean turn about the vertical from one direction to another, over the frames that show both: a unit number."""
    one, other = (each[:, 0] + 1j * each[:, 2] for each in (vectors, others))
    turn = other * one.conjugate()
    with np.errstate(invalid="ignore", divide="ignore"):
        turn /= np.abs(turn)
    mean = complex(turn[np.isfinite(turn)].sum())
    return mean / max(abs(mean), 1e-12)


def _front_trouble(part: str, marker_set: MarkerSet) -> str:
    if part == "pelvis":
        labels = _names(marker_set, *(f"{name}_{side}" for name in ("asis", "psis") for side in "rl"), "sacrum")
        return f"the pelvis points backwards by both feet: front and back look swapped in {labels}; correct the labels"
    side = part[-1]
    labels = _names(marker_set, f"heel_{side}", f"metatarsal_{side}", f"toe_{side}")
    return (
        f"the {_WORDS[side]} foot points backwards by the other foot and the pelvis: heel and toe look swapped in the "
        f"labels {labels}; correct them"
    )


def _outside_trouble(places: Mapping[str, FloatArray], right: FloatArray, marker_set: MarkerSet) -> str:
    for outer, inner in _OUTER:
        for side, sign in (("r", 1.0), ("l", -1.0)):
            names = (f"{outer}_{side}", f"{inner}_{side}")
            if not set(names) <= set(places):
                continue
            outwards = _cosine(places[names[0]] - places[names[1]], sign * right)
            if outwards < -_CLEAR:
                joint = outer.partition("_")[0]
                return (
                    f"the outer marker of the {_WORDS[side]} {joint} is on its inner side: the labels "
                    f"{_names(marker_set, *names)} look swapped; correct them"
                )
    return ""


def _order_trouble(places: Mapping[str, FloatArray], marker_set: MarkerSet) -> str:
    """Knees that are below ankles, the pelvis below knees."""
    for side in "rl":
        for upper, lower in (
            (f"knee_lateral_{side}", f"ankle_lateral_{side}"),
            (f"asis_{side}", f"knee_lateral_{side}"),
        ):
            if not {upper, lower} <= set(places):
                continue
            heights = (places[upper] - places[lower])[:, 1]
            known = heights[np.isfinite(heights)]
            if known.size and np.median(known) < -_BELOW_M:
                return (
                    f"{_names(marker_set, upper)} is {-1e3 * np.median(known):.0f} mm below "
                    f"{_names(marker_set, lower)}: their labels look swapped; correct them"
                )
    return ""


def _ankle_trouble(places: Mapping[str, FloatArray], marker_set: MarkerSet) -> str:
    """Along the line from the heel to the toes ankles are 22 to 48 % of the way (12 people); not behind, nor beyond."""
    for side in "rl":
        toe = next((name for name in (f"metatarsal_{side}", f"toe_{side}") if name in places), "")
        heel, ankle = f"heel_{side}", f"ankle_lateral_{side}"
        if not toe or not {heel, ankle} <= set(places):
            continue
        along = places[toe] - places[heel]
        with np.errstate(invalid="ignore", divide="ignore"):
            shares = ((places[ankle] - places[heel]) * along).sum(axis=1) / np.square(along).sum(axis=1)
        shares = shares[np.isfinite(shares)]
        share = float(np.median(shares)) if shares.size else 0.5
        if _BEHIND < share < _BEYOND:
            continue
        other = heel if share <= _BEHIND else toe
        where = "behind the heel" if share <= _BEHIND else "beyond the toes"
        return (
            f"the labels {_names(marker_set, ankle, other)} look swapped: the {_WORDS[side]} ankle would be {where}, "
            f"at {100 * share:.0f} % of the way from the heel to the toes (20 to 50 % is usual); correct the labels"
        )
    return ""


def _thigh_trouble(markers: Markers, marker_set: MarkerSet) -> str:
    """A marker of the thigh that is below the knee, beside one of the shank that is above it."""
    joints = {label for name, labels in marker_set.landmarks.items() if "wand" not in name for label in labels}
    for side in "rl":
        knee = marker_set.landmarks.get(f"knee_lateral_{side}", ("",))[0]
        if knee not in markers.labels:
            continue
        above = {}
        for part in ("thigh", "shank"):
            own = set(marker_set.segments.get(f"{part}_{side}", ())) - joints
            for label in sorted(own & set(markers.labels)):
                heights = np.subtract(*markers.select((label, knee)).positions[..., 1].T)
                heights = heights[np.isfinite(heights)]
                above[part, label] = float(np.median(heights)) if heights.size else 0.0
        low = min(((height, label) for (part, label), height in above.items() if part == "thigh"), default=(0.0, ""))
        high = max(((height, label) for (part, label), height in above.items() if part == "shank"), default=(0.0, ""))
        if low[0] < -_BELOW_M and high[0] > _BELOW_M:
            return (
                f"{low[1]} of the thigh is {-1e3 * low[0]:.0f} mm below the knee ({knee}), and {high[1]} of the shank "
                f"is {1e3 * high[0]:.0f} mm above it: their labels look swapped; correct them"
            )
    return ""


def _elbow_trouble(places: Mapping[str, FloatArray], right: FloatArray, marker_set: MarkerSet) -> str:
    """An arm may turn its outer side anywhere, but elbows bend forwards only; and the outer side of a straight arm is
    never inside where it hangs, nor below where it is raised.
    """
    for side, sign in (("r", 1.0), ("l", -1.0)):
        names = [f"{name}_{side}" for name in ("elbow_lateral", "elbow_medial", "acromion", "wrist")]
        if not set(names) <= set(places):
            continue
        lateral, medial, shoulder, wrist = (places[name] for name in names)
        elbow = (lateral + medial) / 2
        upper, fore, out = _unit(elbow - shoulder), _unit(wrist - elbow), _unit(lateral - medial)
        normal = np.cross(upper, fore)
        bent = np.linalg.norm(normal, axis=1) > _BENT
        with np.errstate(invalid="ignore"):
            by_bend = sign * (normal * out).sum(axis=1) / np.linalg.norm(normal, axis=1)
            outwards = np.where(
                np.abs(upper[:, 1]) > _CLEAR, sign * (_unit(_level(right)) * out).sum(axis=1), out[:, 1]
            )
        shown = np.where(bent, by_bend, outwards)
        shown = shown[np.isfinite(shown)]
        if shown.size and np.median(shown) < -_CLEAR:
            why = "the elbow would bend backwards" if bent.mean() > 0.5 else "it is on the inner side of the arm"
            return (
                f"the outer and inner elbow markers of the {_WORDS[side]} arm, {_names(marker_set, *names[:2])}, look "
                f"swapped: {why}; correct the labels"
            )
    return ""


def _both(places: Mapping[str, FloatArray]) -> list[str]:
    return [pair for pair in _PAIRS if {f"{pair}_r", f"{pair}_l"} <= set(places)]


def _names(marker_set: MarkerSet, *landmarks: str) -> str:
    labels: Sequence[str] = [label for name in landmarks for label in marker_set.landmarks.get(name, ())]
    return " and ".join(dict.fromkeys(labels))


def _level(vectors: FloatArray) -> FloatArray:
    """The horizontal part."""
    result: FloatArray = vectors * np.array([1.0, 0.0, 1.0])
    return result


def _unit(vectors: FloatArray) -> FloatArray:
    result: FloatArray = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return result


def _cosine(vectors: FloatArray, others: FloatArray) -> float:
    """Median over the frames of the cosine between the horizontal parts; 0 where nothing is seen."""
    with np.errstate(invalid="ignore", divide="ignore"):
        cosines = (_unit(_level(vectors)) * _unit(_level(others))).sum(axis=-1)
    seen = cosines[np.isfinite(cosines)]
    return float(np.median(seen)) if seen.size else 0.0
