"""Draws where to measure a person: the picture beside the sheet of girths and lengths."""

from html import escape

import numpy as np

from kinertia.model.stadium_body import girths_with_widths, measures, usual_build

LEVELS = {
    "T8": "top of the head",
    "T7": "just above the ears",
    "T6": "just beneath the nose",
    "T5": "acromion; base of the neck",
    "T4": "shoulder joint centre",
    "T3": "nipples",
    "T2": "lowest front rib",
    "T1": "navel",
    "T0": "hip joint centre (greater trochanter); also L0",
    "L1": "crotch",
    "L2": "half-way between crotch and knee",
    "L3": "knee joint centre",
    "L4": "largest girth of the calf",
    "L5": "ankle joint centre",
    "L6": "heel",
    "L7": "arch, half-way between heel and ball",
    "L8": "ball of the foot",
    "L9": "toe nails",
    "A0": "shoulder joint centre, under the armpit",
    "A1": "half-way between shoulder and elbow",
    "A2": "elbow joint centre",
    "A3": "largest girth of the forearm",
    "A4": "wrist joint centre",
    "A5": "base of the thumb",
    "A6": "knuckles",
    "A7": "finger nails",
}
"""Descriptions of the levels, in the order of the picture's labels."""
_SCALE = 5.0
_GAP_CM, _COLUMN_CM, _WIDTH_CM = 4.2, 52.0, 250.0
_ARM_APART_CM, _TOP_CM = 9.0, 18.0
_INK, _SKIN, _LINE = "#333", "#e8ddd0", "#8a8a8a"


def measures_picture() -> str:
    """Draw an SVG file: a person of stadiums from the front, toes pointed, with every level and its name."""
    outlines, ends = _person()
    crown = ends["T8"][1] + _TOP_CM
    labels = {
        **_spread([name for name in LEVELS if name[0] in "TL"], ends),
        **_spread([name for name in LEVELS if name[0] == "A"], ends),
    }
    height = crown - min(*labels.values(), ends["L9"][1]) + _TOP_CM

    def at(x: float, y: float) -> str:
        return f"{_SCALE * (x + _WIDTH_CM / 2.0):.1f},{_SCALE * (crown - y):.1f}"

    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{_SCALE * _WIDTH_CM:.0f}" height="{_SCALE * height:.0f}" '
        f'viewBox="0 0 {_SCALE * _WIDTH_CM:.0f} {_SCALE * height:.0f}" '
        f'font-family="sans-serif" font-size="14" role="img" aria-label="Levels at which a person is measured">',
        '<rect width="100%" height="100%" fill="white"/>',
        f'<g font-size="18" fill="{_INK}"><text x="20" y="30">Girth: tape around, at right angles to the limb. Width: '
        'from side to side. Depth: from front to back.</text><text x="20" y="56">Limbs: the mean of right and left, or '
        "one side.</text></g>",
    ]
    parts += [
        f'<polygon points="{" ".join(at(*point) for point in outline)}" fill="{_SKIN}" stroke="{_INK}"/>'
        for outline in outlines
    ]
    for name, label_y in labels.items():
        x, y, half = ends[name]
        side = 1.0 if name[0] == "A" else -1.0
        bends = (x - side * half, y), (x + side * half, y), (side * _COLUMN_CM, label_y)
        points = " ".join(at(*bend) for bend in bends)
        parts.append(f'<polyline points="{points}" fill="none" stroke="{_LINE}"/>')
        place = at(side * (_COLUMN_CM + 1.0), label_y - 1.0).split(",")
        anchor = "start" if side > 0.0 else "end"
        parts.append(
            f'<text x="{place[0]}" y="{place[1]}" text-anchor="{anchor}" fill="{_INK}">'
            f'<tspan font-weight="bold">{name}</tspan> {escape(LEVELS[name])}</text>'
        )
    return "\n".join([*parts, "</svg>", ""])


def _spread(names: list[str], ends: dict[str, tuple[float, float, float]]) -> dict[str, float]:
    """Spread label heights from the top down, near their levels without overlap."""
    wanted = np.array([ends[name][1] for name in names])
    steps = _GAP_CM * np.arange(len(names))
    down = np.minimum.accumulate(wanted + steps) - steps
    up = np.maximum.accumulate((wanted + steps)[::-1])[::-1] - steps
    return dict(zip(names, (0.5 * (down + up)).tolist(), strict=True))


def _person() -> tuple[list[list[tuple[float, float]]], dict[str, tuple[float, float, float]]]:
    """Return outlines in cm, and by level the middle of its line (x, y) and half its length."""
    cm = dict(zip((measure.key for measure in measures()), 100.0 * usual_build().median_m, strict=True))
    wide = {measures()[girth].key: measures()[width].key for girth, width in girths_with_widths()}

    def half(key: str) -> float:
        width_key = wide.get(key, "")
        return float(0.5 * cm[width_key] if width_key.endswith("w") else cm[key] / (2.0 * np.pi))

    trunk = [(0.0, half("Ls0p")), *((cm[f"Ls{k}L"], half(f"Ls{k}p")) for k in (1, 2, 3))]
    trunk += [(cm["Ls4L"], 0.5 * cm["Ls4w"]), (cm["Ls5L"], 0.5 * cm["Ls4w"] - 2.0)]
    neck = half("Ls5p")
    head = [(cm["Ls5L"] + cm[f"Ls{k}L"], half(f"Ls{k}p")) for k in (6, 7)]
    crown = cm["Ls5L"] + cm["Ls8L"]
    arm = [0.0, 0.5 * cm["La2L"], *(cm[f"La{k}L"] for k in (2, 3, 4)), *(cm["La4L"] + cm[f"La{k}L"] for k in (5, 6, 7))]
    leg = [0.0, cm["Lj1L"], 0.5 * (cm["Lj1L"] + cm["Lj3L"]), *(cm[f"Lj{k}L"] for k in (3, 4, 5))]
    foot = [cm["Lj6L"], 0.5 * (cm["Lj6L"] + cm["Lj8L"]), cm["Lj8L"], cm["Lj9L"]]
    leg += [cm["Lj5L"] + length for length in foot]
    hip, shoulder = 0.5 * half("Ls0p") + 1.0, 0.5 * cm["Ls4w"] + _ARM_APART_CM
    limbs = {
        "A": (shoulder, cm["Ls4L"], arm, [half(f"La{k}p") for k in range(8)]),
        "L": (hip, 0.0, leg, [0.95 * hip, *(half(f"Lj{k}p") for k in range(1, 10))]),
    }
    body = [*trunk, (cm["Ls5L"], neck), *head, (0.5 * (head[-1][0] + crown), 0.9 * head[-1][1]), (crown, 0.0)]
    outlines = []
    ends = {f"T{k}": (0.0, *place) for k, place in enumerate([*trunk, *head])}
    ends["T8"] = (0.0, crown, 4.0)
    for letter, (x, top, down, halves) in limbs.items():
        for sign in (1.0, -1.0):
            edge = list(zip(down, halves, strict=True))
            right = [(sign * x + half_width, top - length) for length, half_width in edge]
            outlines.append(right + [(sign * x - half_width, top - length) for length, half_width in reversed(edge)])
        sign = 1.0 if letter == "A" else -1.0
        ends |= {f"{letter}{k}": (sign * x, top - length, half_width) for k, (length, half_width) in enumerate(edge)}
    outlines.append(
        [(half_width, y) for y, half_width in body] + [(-half_width, y) for y, half_width in reversed(body)]
    )
    return outlines, ends
