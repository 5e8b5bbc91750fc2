"""Reads hints from marker labels: side, landmark, segment, and computed points."""

import re
from collections.abc import Sequence
from functools import cache

from kinertia.io.marker_set_file import preset_names, read_marker_set
from kinertia.model.marker_set import folded

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
        named = {label for own in preset.landmarks.values() for label in own}
        entries = [*preset.landmarks.items(), *preset.segments.items()]
        for entry, own in entries:
            for label in own:
                if entry in preset.segments and label in named:
                    continue
                base = entry[:-2] if entry.endswith(("_r", "_l")) else entry
                found.setdefault(_stem(label, label in pairs), set()).add(base)
    return {stem: frozenset(own) for stem, own in found.items()}
