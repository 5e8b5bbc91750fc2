"""Puts the limits of checks into the catalogue's sentences: what a code detects, and when its severity changes.

A text refers to a limit of the check that reports the code by its name there: `{off_plate:%}` is "5 %", `{lever_arm}`
is "150 mm", `{lever_arm.usual}` is the range of recordings without faults, `{lever_arm.least}` and
`{lever_arm.most}` are its ends.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any

from kinertia.diagnostics.markers.swapped_markers import LOST_M
from kinertia.diagnostics.model.model_on_person import AT_LIMIT, BEYOND_RAD, CLAMPED, MOVED_M
from kinertia.diagnostics.registry import MOTION_CHECKS, PERSON_CHECKS, STATIC_CHECKS
from kinertia.diagnostics.result.corrections import APART_SD
from kinertia.diagnostics.result.registry import ESTIMATE_CHECKS, RESULT_CHECKS
from kinertia.diagnostics.runner import Check
from kinertia.estimation.body_measures import FAR_SD
from kinertia.estimation.prepared import CALIBRATED_M, KNOWN_BODY_SD, LIGHT_KG, MODEL_MASS_SHARE
from kinertia.findings.display import exact
from kinertia.findings.quantity import Limit
from kinertia.findings.rule import Rule
from kinertia.io.lab_plates import MOMENTS_FIT
from kinertia.io.recording import FARTHEST_M, STRONGEST_N
from kinertia.io.subject.person_recordings import FASTEST_M_S
from kinertia.io.text.number_table import LARGEST_STEP_S
from kinertia.io.text.trc import RATE_ERROR
from kinertia.model.anthropometry import BODY_MASS_KG, STATURE_M
from kinertia.model.stadium_body import GIRTH_OVER_WIDTH

ALL_CHECKS: tuple[Check[Any], ...] = (*STATIC_CHECKS, *MOTION_CHECKS, *PERSON_CHECKS, *ESTIMATE_CHECKS, *RESULT_CHECKS)
REPORTED_ELSEWHERE: Mapping[str, Mapping[str, Limit]] = {
    "F153": {"misses": Limit(MOMENTS_FIT)},
    "F171": {"farthest": FARTHEST_M},
    "F172": {"strongest": STRONGEST_N},
    "F181": {"fastest": Limit(FASTEST_M_S, "m/s")},
    "M173": {"moved": CALIBRATED_M},
    "O411": {"share": MODEL_MASS_SHARE},
    "O413": {"light": Limit(LIGHT_KG, "kg")},
    "S402": {"distance": KNOWN_BODY_SD},
    "S102": {
        "lightest": BODY_MASS_KG[0],
        "heaviest": BODY_MASS_KG[1],
        "shortest": STATURE_M[0],
        "tallest": STATURE_M[1],
    },
    "S403": {"distance": Limit(FAR_SD), "least": GIRTH_OVER_WIDTH[0], "most": GIRTH_OVER_WIDTH[1]},
    "S404": {"distance": KNOWN_BODY_SD},
    "T103": {"differs": RATE_ERROR},
    "T106": {"step": Limit(LARGEST_STEP_S, "s")},
    "O311": {"clamped": CLAMPED},
    "O312": {"share": AT_LIMIT, "beyond": BEYOND_RAD},
    "O407": {"moved": MOVED_M},
    "R106": {"lost": LOST_M},
    "S501": {"apart": APART_SD},
}
"""Limits of codes that no check of these lists reports, but a stage between them."""
_NAME = re.compile(r"\{(\w+)(?:\.(usual|least|most))?(?::([%]))?\}")


def with_limits(rule: Rule) -> Rule:
    """Return a rule whose texts have its limits in place of their names.

    >>> from kinertia.findings.rule import rule
    >>> with_limits(rule("P245")).detects
    'Centres of pressure outside the corners of the plate for more than 5 % of the load.'
    """
    limits = limits_of(rule.code)
    return replace(rule, detects=_rendered(rule.detects, limits), escalation=_rendered(rule.escalation, limits))


def names_in(rule: Rule) -> set[str]:
    """Return the names of limits in the texts of a rule."""
    return {match.group(1) for text in (rule.detects, rule.escalation) for match in _NAME.finditer(text)}


@cache
def limits_of(code: str) -> Mapping[str, Limit]:
    """Return the limits that decide on a code, by name.

    Raises:
        ValueError: two checks have different limits of that name.
    """
    result: dict[str, Limit] = {}
    declared = [check.limits for check in ALL_CHECKS if code in check.codes]
    for limits in (*declared, REPORTED_ELSEWHERE.get(code, {}), _of_readers(code)):
        for name, limit in limits.items():
            if result.setdefault(name, limit) != limit:
                raise ValueError(f"{code} has two limits {name}: {result[name]:g} and {limit:g}")
    return result


def _of_readers(code: str) -> Mapping[str, Limit]:
    """Return the limits of readers that few people need, and that load slowly."""
    if code == "F122":
        from kinertia.io.c3d.reader import PERSON_M

        return {"smallest": Limit(PERSON_M[0], "m"), "largest": Limit(PERSON_M[1], "m")}
    if code == "F182":
        from kinertia.io.subject.body_files import LONGEST_CM, SHORTEST_CM

        return {"shortest": Limit(SHORTEST_CM / 100.0, "m"), "longest": Limit(LONGEST_CM / 100.0, "m")}
    if code == "O104":
        from kinertia.io.opensim.reader import EARTHS_GRAVITY_M_S2

        return {"least": Limit(EARTHS_GRAVITY_M_S2[0], "m/s2"), "most": Limit(EARTHS_GRAVITY_M_S2[1], "m/s2")}
    return {}


def _rendered(text: str, limits: Mapping[str, Limit]) -> str:
    def limit_text(match: re.Match[str]) -> str:
        name, part, style = match.groups()
        if name not in limits:
            return match.group(0)
        limit = limits[name]
        if part is None:
            return exact(limit, limit.unit, style or "")
        if limit.usual is None:
            raise ValueError(f"what is usual of {name} is not known")
        least, most = limit.usual
        ends: dict[str, float | tuple[float, float]] = {"usual": (least, most), "least": least, "most": most}
        return exact(ends[part], limit.unit, style or "")

    return _NAME.sub(limit_text, text)
