"""Finds computed points of a recording, by geometry and by hints in marker labels."""

import re
from collections.abc import Sequence
from functools import cache
from itertools import combinations, permutations

import numpy as np

from kinertia.io.marker_set_file import preset_names, read_marker_set
from kinertia.model.marker_set import folded
from kinertia.trial.data import FloatArray, Markers

_EXACT_M = 1e-4
_ON_FLOOR_M = 2e-3
_SKIN_M = 3e-4
"""Smallest change of distances between markers on the skin of a person who stands still."""
_RIGID_M, _RIGID_SHARE, _LONG_S = 8e-6, 0.05, 2.0
_FEW = 0.3
_NEIGHBOURS, _REACH_M = 8, 0.45
_FRAMES, _FEWEST, _OFTEN = 25, 10, (0.95, 0.75, 0.5)
"""Most and fewest frames compared; shares of frames in which a marker is seen, of which the highest that leaves enough
frames counts."""
_AXES = "OALP"
"""Vicon's bones: origin, anterior, lateral and proximal end."""
_OXFORD = ("HDF", "FOF", "TIB", "HLX", "TPF")
"""Bones of the Oxford foot model, whose origin and axes are numbered 0 to 3; a file that has the first two has them."""
_WORDS = {
    "asis": r"asis?|ias|iasis|sias",
    "psis": r"psis?|ips|ipsis|sips",
    "sacrum": r"v?sac(r|rum|ral)?|s[123]",
    "knee_lateral": r"knee?(lat\w*|out\w*|l)?|knl|latknee|lknee?|lkn|klat|l?lepi(con\w*)?|lf[ec]|lfep|lkjc|f?le|kl",
    "knee_medial": r"knm|knee?(med\w*|in\w*|m)|medknee|mknee?|mkn|kmed|mepi(con\w*)?|mf[ec]|mfep|mkjc|f?me|km",
    "ankle_lateral": r"ank(le)?(lat\w*|out\w*|l)?|anl|latank\w*|lank(le)?|alat|lmal\w*|lm|fal|lajc|al",
    "ankle_medial": r"anm|med|ank(le)?(med\w*|in\w*|m)|medank\w*|man(k|kle)?|amed|mmal?\w*|mm|tam|majc|am",
    "heel": r"heel?\w*|hel|cal(c\w*)?|ca|fcc",
    "metatarsal": r"[pdh]?m(t|th|et\w*)?h?\d|\d(st|nd|rd|th)?m(t|th|et\w*)?|mt|toe(lat|med)?|[vf]mh?|fm\d|[pd][15]mt?",
    "toe": r"toe(tip)?|hal+ux|hlx|iit|bigtoe|ttip|hlux|gto",
    "acromion": r"sho|shoulder|acr?|acromion|acromium|sh|a|cl?a|acrm",
    "c7": r"c7|cv7",
    "sternal_notch": r"clav|ij|sjn|sn|jn|clavicle|sternalnotch|jug\w*|ster?",
    "elbow_lateral": r"elb|elbow|elbl|elblat\w*|elbowlat\w*|latelb\w*|lelb|hle|lel|elbowout\w*",
    "elbow_medial": r"elbm|elbmed\w*|elbowmed\w*|medelb\w*|melb|hme|mel|elbowin\w*",
    "wrist": r"wri?s?|wrist\w*|wr[ab12]|wr(lat|med|ul\w*|rad\w*)|us|rs|usp|rsp|radius|ulna|m?wrist\w*",
    "head_top": r"tophead|htop|vertex|headtop",
}
_PATTERNS = {name: re.compile(f"({words})(study|static)?", re.IGNORECASE) for name, words in _WORDS.items()}
_VIRTUAL = re.compile(
    r"(HJC|KJC|AJC|SJC|EJC|WJC)\d*$|^(fun|reg|v|virtual|proj|g|com|cofm|cop|cofp|cofg|vector|grf)[_\d]"
    r"|CentreOfMass|CenterOfMass|^(r|l)?CoM$|^(proj|Vector|CofP|CofM|virtual)|(COM|Floor|Length|Height)$|_(reg|virtual)$",
)
_LEFT = re.compile(r"^(left|right)(?=[\W_]|[A-Z])|^(left|right)|(left|right)$", re.IGNORECASE)


def unusable_points(markers: Markers) -> dict[str, str]:
    """Return label -> reason for points that are not on the body: ends of bone axes, copies, projections, constants."""
    found = _bone_axes(markers)
    place = _few_frames(markers)
    for label, points in place.items():
        if label not in found and (points == 0.0).all(axis=0).sum() >= 2:
            found[label] = "a number, no place"
    labels = [label for label in place if label not in found]
    for first_label, other in combinations(labels, 2):
        apart = place[other] - place[first_label]
        if other in found or first_label in found or np.abs(apart[:, [0, 2]]).max() > _EXACT_M:
            continue
        if np.abs(apart[:, 1]).max() < _EXACT_M:
            copy, original = (
                (first_label, other)
                if is_named_virtual(first_label) and not is_named_virtual(other)
                else (other, first_label)
            )
            found[copy] = f"the same point as {original}"
        else:
            lower, upper = (first_label, other) if apart[:, 1].mean() > 0 else (other, first_label)
            if np.abs(place[lower][:, 1]).max() < _ON_FLOOR_M:
                found[lower] = f"the point on the floor below {upper}"
    return found


def computed_points(markers: Markers) -> dict[str, str]:
    """Return label -> evidence that a point of the body was computed: its name, or a constant position among others
    within a tenth of a millimetre, which skin does not keep.
    """
    place = _few_frames(markers)
    found = {label: "a computed point by its name" for label in markers.labels if is_named_virtual(label)}
    if len(next(iter(place.values()), ())) < _FEWEST:
        return found
    for label, points in place.items():
        if label in found:
            continue
        if pair := _middle_of(points, {other: at for other, at in place.items() if other != label}):
            found[label] = f"always midway between {pair[0]} and {pair[1]}"
    pairs = sides(list(place))
    hinted = {label: bool(roles(label, label in pairs)) for label in place}
    if markers.time[-1] - markers.time[0] > _LONG_S:  # within less, quiet markers keep their distances by chance
        found |= _rigid_pairs({label: points for label, points in place.items() if label not in found}, hinted)
    for label, points in place.items():
        others = {other: at for other, at in place.items() if other != label and other not in found}
        sources = [] if label in found else _fixed_in(points, others)
        if sources and not (hinted[label] and not all(hinted[source] for source in sources)):
            found[label] = f"fixed to {', '.join(sources)} within {_EXACT_M * 1e3:.1f} mm"
    return found


def _few_frames(markers: Markers) -> dict[str, FloatArray]:
    """Return label -> positions (f, 3) m in a few frames that show all markers but those with gaps."""
    share = markers.seen.mean(axis=0)
    for often in _OFTEN:
        place = _in_common(
            markers, [label for label, label_share in zip(markers.labels, share, strict=True) if label_share > often]
        )
        if len(next(iter(place.values()), ())) >= min(_FEWEST, len(markers.time)):
            return place
    return {}


def _in_common(markers: Markers, labels: Sequence[str]) -> dict[str, FloatArray]:
    """Return label -> positions (f, 3) m in at most `_FRAMES` of the frames that show all of these; empty if none."""
    chosen = markers.select(labels)
    frames = np.flatnonzero(chosen.seen.all(axis=1))
    frames = frames[:: -(-len(frames) // _FRAMES)] if len(frames) else frames
    return {label: chosen.positions[frames, k] for k, label in enumerate(chosen.labels)} if len(frames) else {}


def _bone_axes(markers: Markers) -> dict[str, str]:
    """Find points whose labels end in O, A, L and P, and whose directions are perpendicular, in the frames that show
    them.
    """
    found: dict[str, str] = {}
    labels = set(markers.labels)
    for stem in sorted({label[:-1] for label in labels if label[-1:] in _AXES}):
        if not all(stem + end in labels for end in _AXES):
            continue
        place = _in_common(markers, [stem + end for end in _AXES])
        if not place:
            continue
        origin, *tips = place.values()
        axes = np.stack(tips, axis=1) - origin[:, None]
        axes /= np.maximum(np.linalg.norm(axes, axis=2, keepdims=True), 1e-9)
        off = np.einsum("nij,nkj->nik", axes, axes) - np.eye(3)
        if np.abs(off).max() < 1e-2:
            found |= {stem + end: "an axis of a bone" for end in _AXES}
    numbered = [
        f"{side}{bone}"
        for side in "RL"
        for bone in _OXFORD
        if all(f"{side}{letter}{k}" in labels for letter in _OXFORD[:2] for k in range(1, 4))
    ]
    families = [(f"{stem}_", "XYZ") for stem in {label[:-2] for label in labels if label.endswith(("_X", "_Y", "_Z"))}]
    families = [(stem, ends) for stem, ends in families if all(stem + end in labels for end in ends)]
    for stem, ends in [*families, *((stem, "0123") for stem in numbered)]:
        found |= {stem + end: "an axis of a bone" for end in ends if stem + end in labels}
    return found


def _middle_of(points: FloatArray, place: dict[str, FloatArray]) -> tuple[str, str] | None:
    """Return two other points whose midpoint this point always is."""
    labels = list(place)
    others = np.stack([place[label] for label in labels])
    for k, label in enumerate(labels[:-1]):
        off = np.abs((others[k] + others[k + 1 :]) / 2 - points).max(axis=(1, 2))
        at = int(np.argmin(off))
        if off[at] < _EXACT_M:
            return label, labels[k + 1 + at]
    return None


def _rigid_pairs(place: dict[str, FloatArray], hinted: dict[str, bool]) -> dict[str, str]:
    """Find pairs of points at a constant distance, while others change: both were computed in one segment."""
    labels = list(place)
    if len(labels) < 3:
        return {}
    points = np.stack([place[label] for label in labels], axis=1)
    varies = np.linalg.norm(points[:, :, None] - points[:, None], axis=-1).std(axis=0)
    rows, columns = np.triu_indices(len(labels), 1)
    limit = min(_RIGID_M, _RIGID_SHARE * float(np.median(varies[rows, columns])))
    found: dict[str, str] = {}
    for a, b in zip(rows, columns, strict=True):
        if varies[a, b] < limit:
            for constructed, other in ((labels[a], labels[b]), (labels[b], labels[a])):
                if hinted[other] or not hinted[constructed]:
                    found.setdefault(constructed, f"always equally far from {other}")
    return found if len(found) < _FEW * len(labels) else {}  # whole segments were made rigid


def _fixed_in(points: FloatArray, place: dict[str, FloatArray]) -> Sequence[str]:
    """Return three other points in whose axes this point never moves although they move among themselves."""
    near = sorted((float(np.linalg.norm(at - points, axis=1).mean()), other) for other, at in place.items())
    others = [other for distance, other in near if distance < _REACH_M][:_NEIGHBOURS]
    for three in combinations(others, 3):
        corners = [place[corner] for corner in three]
        sides = [np.linalg.norm(a - b, axis=1).std() for a, b in combinations(corners, 2)]
        if min(sides) < _SKIN_M / 3:
            continue
        for origin, second, third in permutations(corners):
            x = second - origin
            x /= np.linalg.norm(x, axis=1, keepdims=True)
            z = np.cross(x, third - origin)
            size = np.linalg.norm(z, axis=1, keepdims=True)
            if size.min() < 0.02:
                break
            z /= size
            axes = np.stack([x, np.cross(z, x), z], axis=1)
            local = np.einsum("nij,nj->ni", axes, points - origin)
            if local.std(axis=0).max() < min(_EXACT_M / 3, 0.1 * min(sides)):
                return three
    return ()


def is_named_virtual(label: str) -> bool:
    """Return whether a label denotes a joint centre, a projection, a centre of mass or pressure, or a length."""
    return _VIRTUAL.search(label) is not None


def sides(labels: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Return label -> side ("r" or "l") and the opposite label, for labels that come in pairs.

    >>> sides(["RKNE", "LKNE", "R.Heel", "C7"])
    {'RKNE': ('r', 'LKNE'), 'LKNE': ('l', 'RKNE')}
    """
    by_spelling = {_short(label).lower(): label for label in labels}
    found: dict[str, tuple[str, str]] = {}
    for spelling, label in by_spelling.items():
        for at in [k for k, letter in enumerate(spelling) if letter == "r"]:
            other = by_spelling.get(f"{spelling[:at]}l{spelling[at + 1 :]}")
            if other is not None and other not in found and label not in found:
                found[label], found[other] = ("r", other), ("l", label)
    return found


def roles(label: str, is_sided: bool) -> frozenset[str]:
    """Return landmarks (without side) that a label may mean, and segments for markers that are in no preset."""
    stem = _stem(label, is_sided)
    known = _preset_roles().get(stem, frozenset())
    return known | {name for name, pattern in _PATTERNS.items() if pattern.fullmatch(stem)}


def _short(label: str) -> str:
    """Replace right and left by single letters."""
    return _LEFT.sub(lambda found: found.group(0)[0], label)


def _stem(label: str, is_sided: bool) -> str:
    """Return the folded label without its side."""
    short = folded(_short(label))
    if not is_sided:
        return short
    if short[:1] in ("r", "l"):
        return short[1:]
    return short[:-1] if short[-1:] in ("r", "l") else short


@cache
def _preset_roles() -> dict[str, frozenset[str]]:
    found: dict[str, set[str]] = {}
    for preset in map(read_marker_set, preset_names()):
        pairs = sides(preset.labels)
        named = {label for labels in preset.landmarks.values() for label in labels}
        entries = [*preset.landmarks.items(), *preset.segments.items()]
        for entry, labels in entries:
            for label in labels:
                if entry in preset.segments and label in named:
                    continue
                base = entry[:-2] if entry.endswith(("_r", "_l")) else entry
                found.setdefault(_stem(label, label in pairs), set()).add(base)
    return {stem: frozenset(stem_roles) for stem, stem_roles in found.items()}
