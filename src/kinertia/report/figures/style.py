"""Defines colours and lines of all figures: Okabe and Ito's palette for colour-blind people, on white."""

BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION = "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00"
GREY, PALE, UNUSED = "#6B6B6B", "#C8C8C8", "#E9E9E9"

SIDES = {"r": ("right", BLUE), "l": ("left", VERMILION), "": ("", BLACK)}
"""Word and colour by the suffix of a coordinate's name; "" where it has no side."""
COMPARED = (BLACK, ORANGE, "#CC79A7", SKY, GREY, GREEN)
"""Colours of results that are compared: none is a side's."""
SIDE_COLOURS = {"r": (BLUE, "blue"), "l": (VERMILION, "vermilion")}
"""Colour of each side, and its name."""

STAGES = {
    "literature": {"color": GREY, "dash": "dot", "width": 1.5},
    "corrected": {"color": ORANGE, "dash": "dash", "width": 1.5},
    "estimate_full": {"color": SKY, "dash": "solid", "width": 1},
    "estimate": {"color": BLUE, "dash": "solid", "width": 2},
}
"""Line of each stage of the residuals."""

FONT = "system-ui, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"


def faded(colour: str, opacity: float) -> str:
    """Convert the colour "#rrggbb" to "rgba(...)"."""
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return f"rgba({red},{green},{blue},{opacity:g})"


def between(first: str, second: str, share: float) -> str:
    """Return the colour at this share (0 to 1) of the way from one "#rrggbb" to another."""
    parts = [[int(colour[k : k + 2], 16) for k in (1, 3, 5)] for colour in (first, second)]
    return "#" + "".join(f"{round(a + share * (b - a)):02X}" for a, b in zip(*parts, strict=True))
