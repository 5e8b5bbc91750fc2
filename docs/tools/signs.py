"""Draw the pages' pictures of signs, one per joint, `docs/figures/signs-*.svg`, with the words of the report's titles.

    python docs/tools/signs.py

A test compares the pictures with what this draws.
"""

from html import escape
from math import cos, radians, sin
from pathlib import Path
from typing import Any, NamedTuple

from kinertia.report.figures.coordinate_titles import signed_angles, signed_joint_moment

FIGURES = Path(__file__).resolve().parents[1] / "figures"
_WIDTH, _HEIGHT, _LENGTH, _TURN = 250, 270, 70, 38
_BACK = 26
_ANGLE, _MOMENT, _BONE, _MOVED = "#0072B2", "#B3470B", "#444", "#9aa4ad"


class View(NamedTuple):
    """One panel: how it is seen, from where the moving segment points, how the movement turns it on the page.

    Attributes:
        seen: view in words.
        movement: its name, one of the words in the report's titles.
        along: direction of the moving segment, x to the right and y down the page.
        clockwise: 1 if the movement turns it clockwise on the page, else -1.
        segments: the fixed segment, which is not drawn from above, and the moving one.
        angle, moment: names of the curves; empty where there is none.
    """

    seen: str
    movement: str
    along: tuple[int, int]
    clockwise: int
    segments: tuple[str, str]
    angle: str
    moment: str


_RIGHT, _FRONT, _ABOVE = "from the right", "right leg, from the front", "right leg, from above; front is up"
_TOP = "from above; front is up"
JOINTS = {
    "pelvis": (
        View(_RIGHT, "anterior", (0, -1), 1, ("legs", "pelvis"), "pelvis_tilt_clinical", ""),
        View("from the front", "this side up", (-1, 0), 1, ("legs", "right side"), "pelvis_obliquity_clinical", ""),
        View(
            "from above; front is up",
            "this side forward",
            (1, 0),
            -1,
            ("", "right side"),
            "pelvis_rotation_clinical",
            "",
        ),
    ),
    "hip": (
        View(_RIGHT, "flexion", (0, 1), -1, ("pelvis", "thigh"), "hip_flexion_clinical", "hip_flexion"),
        View(_FRONT, "adduction", (0, 1), -1, ("pelvis", "thigh"), "hip_adduction_clinical", "hip_adduction"),
        View(_ABOVE, "internal rotation", (0, -1), -1, ("", "thigh, knee"), "hip_rotation_clinical", "hip_rotation"),
    ),
    "knee": (
        View(_RIGHT, "flexion", (0, 1), 1, ("thigh", "shank"), "knee_flexion_clinical", "knee_flexion"),
        View(_FRONT, "adduction", (0, 1), -1, ("thigh", "shank"), "", "knee_adduction"),
        View(_ABOVE, "internal rotation", (0, -1), -1, ("", "shank"), "", "knee_rotation"),
    ),
    "ankle": (
        View(_RIGHT, "dorsiflexion", (1, 0), -1, ("shank", "foot"), "ankle_dorsiflexion_clinical", "ankle_flexion"),
        View(_FRONT, "inversion", (1, 0), -1, ("shank", "foot"), "", "ankle_adduction"),
        View(_ABOVE, "internal rotation", (0, -1), -1, ("", "foot"), "", "ankle_rotation"),
    ),
}


def directions(view: View) -> dict[str, dict[str, str]]:
    """Positive direction of the panel's angle and internal moment by convention, in the words of the report."""
    found: dict[str, dict[str, str]] = {"angle": {}, "moment": {}}
    no_model: Any = None  # of which only the convention "opensim" asks
    for convention in ("clinical", "isb"):
        if view.angle:
            found["angle"][convention] = signed_angles(convention)[view.angle][0]
        if view.moment:
            found["moment"][convention] = signed_joint_moment(view.moment, no_model, convention)[0]
    return {
        what: {quantity: _direction(title) for quantity, title in titles.items()}
        for what, titles in found.items()
        if titles
    }


def _direction(title: str) -> str:
    """The direction in a title: "Pelvic tilt, anterior +" and "Knee extension +"."""
    bare = title.removesuffix(" +")
    return bare.partition(", ")[2] or bare.partition(" ")[2]


def _point(centre: tuple[float, float], along: tuple[int, int], degrees: float, length: float) -> tuple[float, float]:
    x, y, turn = *along, radians(degrees)
    return centre[0] + length * (x * cos(turn) - y * sin(turn)), centre[1] + length * (x * sin(turn) + y * cos(turn))


def _arrow(centre: tuple[float, float], view: View, radius: float, towards: int, colour: str) -> str:
    """An arc around the joint with its head at the end, from where the segment points."""
    start, end = (_point(centre, view.along, turn, radius) for turn in (0, towards * _TURN))
    path = f"M{start[0]:.1f} {start[1]:.1f} A{radius} {radius} 0 0 {int(towards > 0)} {end[0]:.1f} {end[1]:.1f}"
    dash = ' stroke-dasharray="6 4"' if colour == _MOMENT else ""
    shaft = f'<path d="{path}" fill="none" stroke="{colour}" stroke-width="3"{dash}/>'
    tip = _point(centre, view.along, towards * (_TURN + 9), radius)
    sides = [_point(centre, view.along, towards * (_TURN - 1), radius + by) for by in (-6, 6)]
    corners = " ".join(f"{x:.1f},{y:.1f}" for x, y in (tip, *sides))
    return f'{shaft}<polygon points="{corners}" fill="{colour}"/>'


def _line(start: tuple[float, float], end: tuple[float, float], colour: str, width: int) -> str:
    ends = f'x1="{start[0]:.1f}" y1="{start[1]:.1f}" x2="{end[0]:.1f}" y2="{end[1]:.1f}"'
    return f'<line {ends} stroke="{colour}" stroke-width="{width}" stroke-linecap="round"/>'


def _panel(view: View, left: float) -> list[str]:
    centre = (left + _WIDTH / 2, 118.0)
    fixed, moving = view.segments
    back = _BACK if view.along[0] else 0  # of a foot or a pelvis, which goes on beyond the joint
    parts = [f'<text x="{centre[0]:g}" y="20" text-anchor="middle" font-weight="bold">{escape(view.seen)}</text>']
    if fixed:
        away = -1 if view.along[1] == 1 or moving == "foot" else 1
        end = (centre[0], centre[1] + away * 62)
        parts += [
            _line(centre, end, _BONE, 7),
            f'<text x="{end[0] - 10:g}" y="{end[1] + 4:g}" text-anchor="end" fill="{_BONE}">{fixed}</text>',
        ]
    for turn, colour, width in ((view.clockwise * _TURN, _MOVED, 4), (0, _BONE, 7)):
        ends = [_point(centre, view.along, turn, length) for length in (-back, _LENGTH)]
        parts.append(_line(ends[0], ends[1], colour, width))
    tip = _point(centre, view.along, view.clockwise * _TURN, _LENGTH + 38)
    parts += [
        f'<text x="{tip[0]:.1f}" y="{tip[1]:.1f}" text-anchor="middle" fill="{_BONE}">{moving}</text>',
        f'<circle cx="{centre[0]:g}" cy="{centre[1]:g}" r="7" fill="#fff" stroke="{_BONE}" stroke-width="3"/>',
    ]
    y = 218
    for what, colour, radius in (("angle", _ANGLE, _LENGTH + 12), ("moment", _MOMENT, _LENGTH - 22)):
        named = directions(view).get(what, {})
        if not named:
            continue
        same = named["clinical"] == view.movement
        parts.append(_arrow(centre, view, radius, view.clockwise * (1 if same else -1), colour))
        words = named["clinical"] + ("" if len(set(named.values())) == 1 else f" (ISB: {named['isb']})")
        for text in (f"{'angle' if what == 'angle' else 'internal moment'} +", words):
            parts.append(f'<text x="{centre[0]:g}" y="{y}" text-anchor="middle" fill="{colour}">{escape(text)}</text>')
            y += 17
    return parts


def drawn(joint: str) -> str:
    """The picture of a joint: a panel per component, an arrow in the positive direction of angle and moment."""
    views = JOINTS[joint]
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH * len(views)} {_HEIGHT + 20}" '
        'font-family="sans-serif" font-size="13">',
        f"<title>Positive directions: {joint}</title>",
        f'<rect width="{_WIDTH * len(views)}" height="{_HEIGHT + 20}" fill="#fff"/>',
        *(part for k, view in enumerate(views) for part in _panel(view, k * _WIDTH)),
    ]
    return "\n".join([*parts, "</svg>"]) + "\n"


def picture(joint: str) -> Path:
    """File of a joint's picture."""
    return FIGURES / f"signs-{joint}.svg"


if __name__ == "__main__":
    for joint in JOINTS:
        picture(joint).write_text(drawn(joint), encoding="utf-8")
