"""L106, L20 and S311: do the labels make a body that faces and walks one way? Left, right, front, back, lateral.

The heading is known from the feet and the pelvis, whatever their sides; then every pair of landmarks shows whether its
right one is on the right, and every joint whether its lateral landmark is outside. What is already explained by a swap
is not examined further. Directions are medians over the frames: a few bad frames do not count.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.landmarks import CLEAR, cosine, horizontal, most_forwards, unit
from kinertia.diagnostics.runner import NEEDS_AXES, check
from kinertia.findings.finding import Finding, Severity, finding, with_evidence
from kinertia.findings.quantity import Limit, Quantity
from kinertia.model.marker_set import MarkerSet, in_words
from kinertia.trial.data import FloatArray

_UP = np.array([0.0, 1.0, 0.0])
_OPPOSED = 0.2
"""Cosine; the sides of a pelvis are up to 70 degrees apart, those of one with a side reversed 110 or more."""
_BELOW_M = 0.05
_BEHIND, _BEYOND = Limit(-0.1, usual=(0.22, 0.48)), Limit(1.1)
"""Position of an ankle as a share of the distance from heel to toes; from 12 people."""
_BENT = 0.35
"""Sine of 20 degrees: beyond it, an elbow's bend is clear."""
_PAIRS = ("asis", "psis", "knee_lateral", "ankle_lateral", "heel", "metatarsal", "acromion")
_STANDING_PAIRS = ("knee_medial", "ankle_medial", "toe")
"""Legs that move may cross."""
_ASIS = ("asis_r", "asis_l")


@dataclass(frozen=True, eq=False)
class _Body:
    """Landmarks (n, 3) m of a recording, and which of them findings already explain.

    Attributes:
        places: positions by landmark name.
        blamed: landmarks that a finding explains.
    """

    context: RecordingContext
    marker_set: MarkerSet
    places: Mapping[str, FloatArray]
    blamed: set[str] = field(default_factory=set)

    def shows(self, *landmarks: str) -> bool:
        """Return whether these landmarks are known and not explained yet."""
        return set(landmarks) <= set(self.places) and not self.blamed & set(landmarks)

    def found(self, code: str, *landmarks: str, **evidence: Quantity) -> Finding:
        """Return the finding that the labels of these landmarks are swapped."""
        self.blamed.update(landmarks)
        labels = [label for name in landmarks for label in self.marker_set.landmarks.get(name, ())]
        return with_evidence(code, self.context.at(markers=tuple(dict.fromkeys(labels))), evidence)


@check("L201", "L202", "L203", "L205", "L206", "L207", "L208", unless=NEEDS_AXES, behind=_BEHIND, beyond=_BEYOND)
def anatomy(context: RecordingContext) -> Iterator[Finding]:
    """Report L201 to L208: labels that contradict a person's anatomy, of a person upright, standing or moving, with Y
    up."""
    if context.marker_set is None or not context.marker_set.landmarks:
        return
    body = _Body(context, context.marker_set, context.landmark_positions)
    yield from _reversed_parts(body, context.headings)
    known = {name: heading for name, heading in context.headings.items() if not _blamed_part(body, name)}
    if len(known) < 2 and (travel := _travel(context, known)) is not None:
        known["travel"] = travel
    if len(known) < 2:
        return
    right = np.cross(_mean_heading(known), _UP)
    sides = list(_swapped_sides(body, right))
    yield from sides
    if any(side.code == "L201" for side in sides):
        return
    yield from _order(body)
    yield from _ankles(body)
    yield from _thighs(body)
    yield from _lateral(body, right)
    yield from _elbows(body, right)


def _mean_heading(known: Mapping[str, FloatArray]) -> FloatArray:
    """Return the mean of the known headings (n, 3) in each frame; NaN where none is known."""
    units = np.array([unit(heading) for heading in known.values()])
    seen = np.isfinite(units)
    count = seen.sum(axis=0)
    return horizontal(np.where(seen, units, 0.0).sum(axis=0) / np.where(count > 0, count, np.nan))


def _travel(context: RecordingContext, known: Mapping[str, FloatArray]) -> FloatArray | None:
    """Return the direction of travel (n, 3) where the only known heading agrees with it, and so is confirmed."""
    if context.travel.kind != "walks" or not known:
        return None
    angle = np.radians(context.travel.direction_deg)
    way = np.broadcast_to([np.cos(angle), 0.0, -np.sin(angle)], context.all_markers.positions[:, 0].shape)
    return way if all(cosine(heading, way) > CLEAR for heading in known.values()) else None


def _reversed_parts(body: _Body, known: Mapping[str, FloatArray]) -> Iterator[Finding]:
    """Report L203 and L205: a side of the pelvis, the pelvis, or a foot that points backwards compared with the
    others."""
    places, feet = body.places, [heading for name, heading in known.items() if name.startswith("foot")]
    if {"asis_r", "asis_l", "psis_r", "psis_l"} <= set(places):
        sides = {side: horizontal(places[f"asis_{side}"] - places[f"psis_{side}"]) for side in "rl"}
        opposed = cosine(sides["r"], sides["l"])
        if opposed < -_OPPOSED:
            backwards = [
                side for side, along in sides.items() if feet and max(cosine(along, forwards) for forwards in feet) < 0
            ]
            names = [f"{name}_{side}" for side in backwards or "rl" for name in ("asis", "psis")]
            which = Quantity(in_words(f"side_{backwards[0]}") if len(backwards) == 1 else "one side")
            yield body.found("L203", *names, cosine=Quantity(opposed, "1", limit=-_OPPOSED), side=which)
            return
    part, agreement = _odd_one_out(known)
    if part == "pelvis":
        names = [f"{name}_{side}" for name in ("asis", "psis") for side in "rl"]
        evidence = {"cosine": Quantity(agreement, "1", limit=-CLEAR), "side": Quantity("both sides")}
        yield body.found("L203", *names, "sacrum", **evidence)
    elif part:
        names = [f"{name}_{part[-1]}" for name in ("heel", "metatarsal", "toe")]
        yield body.found("L205", *names, cosine=Quantity(agreement, "1", limit=-CLEAR), foot=Quantity(in_words(part)))


def _blamed_part(body: _Body, part: str) -> bool:
    landmarks = ("asis_r", "asis_l") if part == "pelvis" else (f"heel_{part[-1]}",)
    return bool(body.blamed & set(landmarks))


def _odd_one_out(known: Mapping[str, FloatArray]) -> tuple[str, float]:
    """Return the part that points backwards by the other two, and the cosine; of two parts either may be wrong."""
    if len(known) < 3:
        return "", 1.0
    agreed = {(foot, "pelvis"): cosine(known[foot], known["pelvis"]) for foot in ("foot_l", "foot_r")}
    # a runner's feet are hardly ever flat at the same time: each against the pelvis shows where they point
    left, right = (_rotation_from(known["pelvis"], known[foot]) for foot in ("foot_l", "foot_r"))
    agreed["foot_l", "foot_r"] = float((left * right.conjugate()).real)
    for part in known:
        with_it = [cosine_of_pair for pair, cosine_of_pair in agreed.items() if part in pair]
        without = [cosine_of_pair for pair, cosine_of_pair in agreed.items() if part not in pair]
        if max(with_it) < -CLEAR and min(without) > CLEAR:
            return part, max(with_it)
    return "", 1.0


def _rotation_from(vectors: FloatArray, others: FloatArray) -> complex:
    """Return the mean rotation about the vertical from one direction to another, over frames with both, unit number."""
    of_pair, other = (vector[:, 0] + 1j * vector[:, 2] for vector in (vectors, others))
    rotation = other * of_pair.conjugate()
    with np.errstate(invalid="ignore", divide="ignore"):
        rotation /= np.abs(rotation)
    mean = complex(rotation[np.isfinite(rotation)].sum())
    return mean / max(abs(mean), 1e-12)


def _swapped_sides(body: _Body, right: FloatArray) -> Iterator[Finding]:
    """Report L201, or L202 of each pair whose sides are swapped."""
    stands, labels = body.context.travel.kind == "stands still", body.marker_set.landmarks
    of_one_marker = labels.get("toe_r") == labels.get("metatarsal_r")
    more = [name for name in _STANDING_PAIRS if stands and not (name == "toe" and of_one_marker)]
    pairs = [pair for pair in (*_PAIRS, *more) if body.shows(f"{pair}_r", f"{pair}_l")]
    across = {pair: cosine(body.places[f"{pair}_r"] - body.places[f"{pair}_l"], right) for pair in pairs}
    wrong = {pair: cosine_of_pair for pair, cosine_of_pair in across.items() if cosine_of_pair < -CLEAR}
    clear = sum(abs(cosine_of_pair) > CLEAR for cosine_of_pair in across.values())
    if len(wrong) > 1 and len(wrong) == clear:
        count = Quantity(float(len(wrong)), "1")
        mean = Quantity(float(np.mean(list(wrong.values()))), "1", limit=-CLEAR)
        yield finding("L201", body.context.at(), pairs=count, cosine=mean)
        return
    for pair, cosine_of_pair in wrong.items():
        yield body.found("L202", f"{pair}_r", f"{pair}_l", cosine=Quantity(cosine_of_pair, "1", limit=-CLEAR))
    yield from _swapped_labels(body, right)


def _swapped_labels(body: _Body, right: FloatArray) -> Iterator[Finding]:
    """Report L202, as a WARNING, of pairs on head, trunk and pelvis that are not landmarks, in segments that also have
    other markers.

    No one turns the head so far that its right side is on the left of the body.
    """
    markers = body.context.all_markers
    landmarks = {label for labels in body.marker_set.landmarks.values() for label in labels}
    for segment in ("torso", "pelvis"):
        for label in body.marker_set.segments.get(segment, ()):
            left_label = f"{'L' if label[:1].isupper() else 'l'}{label[1:]}"
            if (
                label[:1].upper() != "R"
                or {label, left_label} & landmarks
                or not {label, left_label} <= set(markers.labels)
            ):
                continue
            pair = markers.arranged([label, left_label])
            along = cosine(pair[:, 0] - pair[:, 1], right)
            if along < -CLEAR:
                where = body.context.at(markers=(label, left_label))
                found = finding("L202", where, cosine=Quantity(along, "1", limit=-CLEAR))
                yield replace(found, severity=Severity.WARNING)


def _order(body: _Body) -> Iterator[Finding]:
    """Report L206: knees that are below the ankles, or a pelvis below the knees."""
    for side in "rl":
        for upper, lower in (
            ("knee_lateral", "ankle_lateral"),
            ("knee_medial", "ankle_medial"),
            ("asis", "knee_lateral"),
        ):
            names = (f"{upper}_{side}", f"{lower}_{side}")
            if not body.shows(*names):
                continue
            heights = (body.places[names[1]] - body.places[names[0]])[:, 1]
            heights = heights[np.isfinite(heights)]
            if heights.size and np.median(heights) > _BELOW_M:
                yield body.found("L206", *names, height_m=Quantity(float(np.median(heights)), "m", limit=_BELOW_M))


def _ankles(body: _Body) -> Iterator[Finding]:
    """Report L207: ankles behind the heel, or beyond the toes."""
    for side in "rl":
        toe = next((name for name in (f"metatarsal_{side}", f"toe_{side}") if name in body.places), "")
        heel, ankle = f"heel_{side}", f"ankle_lateral_{side}"
        if not toe or not body.shows(toe, heel, ankle):
            continue
        along = body.places[toe] - body.places[heel]
        with np.errstate(invalid="ignore", divide="ignore"):
            shares = ((body.places[ankle] - body.places[heel]) * along).sum(axis=1) / np.square(along).sum(axis=1)
        shares = shares[np.isfinite(shares)]
        share = float(np.median(shares)) if shares.size else 0.5
        if _BEHIND < share < _BEYOND:
            continue
        other, limit, where = (
            (heel, _BEHIND, "behind the heel") if share <= _BEHIND else (toe, _BEYOND, "beyond the toes")
        )
        yield body.found(
            "L207", ankle, other, share=Quantity(share, "1", limit=limit, usual=_BEHIND.usual), place=Quantity(where)
        )


def _thighs(body: _Body) -> Iterator[Finding]:
    """Report L206: a thigh marker that is below the knee, beside a shank marker that is above it."""
    marker_set, markers = body.marker_set, body.context.all_markers
    joints = {label for name, labels in marker_set.landmarks.items() if "wand" not in name for label in labels}
    for side in "rl":
        knee = marker_set.landmarks.get(f"knee_lateral_{side}", ("",))[0]
        if not body.shows(f"knee_lateral_{side}"):
            continue
        above = {}
        for part in ("thigh", "shank"):
            of_thigh = set(marker_set.segments.get(f"{part}_{side}", ())) - joints
            for label in sorted(of_thigh & set(markers.labels)):
                heights = np.subtract(*markers.select((label, knee)).positions[..., 1].T)
                heights = heights[np.isfinite(heights)]
                above[part, label] = float(np.median(heights)) if heights.size else 0.0
        low = min(((height, label) for (part, label), height in above.items() if part == "thigh"), default=(0.0, ""))
        high = max(((height, label) for (part, label), height in above.items() if part == "shank"), default=(0.0, ""))
        if low[0] < -_BELOW_M and high[0] > _BELOW_M:
            below = Quantity(high[0] - low[0], "m", limit=2 * _BELOW_M)
            yield finding("L206", body.context.at(markers=(low[1], high[1])), height_m=below)


def _lateral(body: _Body, right: FloatArray) -> Iterator[Finding]:
    """Report L208 of knees and ankles: lateral and medial labels are swapped."""
    for joint in ("knee", "ankle"):
        for side, sign in (("r", 1.0), ("l", -1.0)):
            names = (f"{joint}_lateral_{side}", f"{joint}_medial_{side}")
            if not body.shows(*names):
                continue
            outwards = cosine(body.places[names[0]] - body.places[names[1]], sign * right)
            if outwards < -CLEAR:
                yield _other_way_round(body, f"{joint}_{side}", names, outwards)


def _elbows(body: _Body, right: FloatArray) -> Iterator[Finding]:
    """Report L208 of elbows, which bend only forwards: the lateral side of an arm may point anywhere, but in a straight
    arm it is not medial when the arm hangs, nor below when the arm is raised.
    """
    for side, sign in (("r", 1.0), ("l", -1.0)):
        names = [f"{name}_{side}" for name in ("elbow_lateral", "elbow_medial", "acromion", "wrist")]
        if not body.shows(*names):
            continue
        lateral, medial, shoulder, wrist = (body.places[name] for name in names)
        elbow = (lateral + medial) / 2
        upper, fore, out = unit(elbow - shoulder), unit(wrist - elbow), unit(lateral - medial)
        normal = np.cross(upper, fore)
        bent = np.linalg.norm(normal, axis=1) > _BENT
        with np.errstate(invalid="ignore", divide="ignore"):
            by_bend = sign * (normal * out).sum(axis=1) / np.linalg.norm(normal, axis=1)
            outwards = np.where(
                np.abs(upper[:, 1]) > CLEAR, sign * (unit(horizontal(right)) * out).sum(axis=1), out[:, 1]
            )
        shown = np.where(bent, by_bend, outwards)
        shown = shown[np.isfinite(shown)]
        if shown.size and np.median(shown) < -CLEAR:
            yield _other_way_round(body, f"elbow_{side}", names[:2], float(np.median(shown)))


def _other_way_round(body: _Body, joint: str, names: tuple[str, ...] | list[str], outwards: float) -> Finding:
    return body.found("L208", *names, cosine=Quantity(outwards, "1", limit=-CLEAR), joint=Quantity(in_words(joint)))


@check("L106")
def heading(context: RecordingContext) -> Iterator[Finding]:
    """Report L106: the sides of the pelvis are absent, or never visible together."""
    if context.marker_set is None or not context.marker_set.landmarks:
        return
    places = context.landmark_positions
    if set(_ASIS) <= set(places) and np.isfinite(places["asis_r"] - places["asis_l"]).all(axis=1).any():
        return
    labels = tuple(label for name in _ASIS for label in context.marker_set.landmarks.get(name, ()))
    absent = [label for label in labels if label not in context.all_markers.labels]
    yield finding(
        "L106",
        context.at(markers=labels),
        absent=Quantity(float(len(absent)), "1"),
    )


@check("S311", unless=(*NEEDS_AXES, "L20"))
def direction_of_travel(context: RecordingContext) -> Iterator[Finding]:
    """Report S311: the person walks where neither feet nor pelvis point.

    Where no markers show the front of either, the sides of the pelvis decide, whose labels may be swapped as well.
    """
    if context.marker_set is None or not context.marker_set.landmarks:
        return
    places, forwards = context.landmark_positions, context.most_forwards
    causes: tuple[str, ...] = ("walking backwards",)
    if not context.headings and set(_ASIS) <= set(places):
        across = {"pelvis": np.cross([0.0, 1.0, 0.0], places["asis_r"] - places["asis_l"])}
        forwards = most_forwards(context.all_markers, across)
        causes = ("walking backwards", "swapped left and right labels")
    if forwards < -CLEAR:
        yield finding("S311", context.at(), causes=causes, cosine=Quantity(forwards, "1", limit=-CLEAR))
