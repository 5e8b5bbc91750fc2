"""Small OpenSim models as text, format 4: a pelvis free in ground, and one more body on the joint to be tested."""

from __future__ import annotations

from collections.abc import Sequence

FREE = ("FreeJoint", ("tilt", "list", "turn", "tx", "ty", "tz"), "")


def body(
    name: str, mass: float, centre: str = "0.02 -0.1 0.03", inertia: str = "0.02 0.01 0.03 0.001 -0.002 0.003"
) -> str:
    return (
        f'<Body name="{name}"><mass>{mass}</mass><mass_center>{centre}</mass_center>'
        f"<inertia>{inertia}</inertia></Body>\n"
    )


def coordinate(name: str, extra: str = "") -> str:
    return f'<Coordinate name="{name}"><range>-3 3</range>{extra}</Coordinate>\n'


def frame(name: str, parent: str, translation: str, orientation: str) -> str:
    return (
        f'<PhysicalOffsetFrame name="{name}"><socket_parent>{parent}</socket_parent>'
        f"<translation>{translation}</translation><orientation>{orientation}</orientation></PhysicalOffsetFrame>\n"
    )


def joint(
    kind: str,
    name: str,
    parent: str,
    child: str,
    coordinates: Sequence[str],
    inside: str = "",
    extra: str = "",
    places: tuple[tuple[str, str], tuple[str, str]] = (
        ("0.1 -0.05 0.02", "0.1 -0.2 0.3"),
        ("0.02 0.3 -0.04", "0.2 0.1 -0.4"),
    ),
) -> str:
    (here, turned), (there, back) = places
    return (
        f'<{kind} name="{name}"><socket_parent_frame>near</socket_parent_frame>'
        f"<socket_child_frame>far</socket_child_frame>\n"
        f"<coordinates>{''.join(coordinate(c, extra) for c in coordinates)}</coordinates>\n"
        f"<frames>{frame('near', parent, here, turned)}{frame('far', f'/bodyset/{child}', there, back)}</frames>\n"
        f"{inside}</{kind}>\n"
    )


def transform(axes: Sequence[tuple[str, str, str]]) -> str:
    """SpatialTransform of a CustomJoint: coordinate, axis and function for rotation1 ... translation3."""
    names = [f"{kind}{i}" for kind in ("rotation", "translation") for i in (1, 2, 3)]
    return (
        "<SpatialTransform>"
        + "\n".join(
            f'<TransformAxis name="{name}"><coordinates>{c}</coordinates><axis>{axis}</axis>{function}</TransformAxis>'
            for name, (c, axis, function) in zip(names, axes, strict=True)
        )
        + "</SpatialTransform>"
    )


LINEAR = '<LinearFunction name="function"><coefficients>1 0</coefficients></LinearFunction>'
ZERO = '<Constant name="function"><value>0</value></Constant>'

CUSTOM_ROOT = transform(
    [
        ("tilt", "0 0 1", LINEAR),
        ("list", "1 0 0", LINEAR),
        ("turn", "0 1 0", LINEAR),
        ("tx", "1 0 0", LINEAR),
        ("ty", "0 1 0", LINEAR),
        ("tz", "0 0 1", LINEAR),
    ]
)

STANDING = (("0 0 0", "0 0 0"), ("0 0 0", "0 0 0"))


def custom_root() -> str:
    return joint("CustomJoint", "root", "/ground", "pelvis", FREE[1], CUSTOM_ROOT, places=STANDING)


MARKERS = "".join(
    f'<Marker name="{label}"><socket_parent_frame>/bodyset/{on}</socket_parent_frame>'
    f"<location>{at}</location></Marker>\n"
    for label, on, at in [
        ("P1", "pelvis", "0.1 0.1 0.12"),
        ("P2", "pelvis", "0.1 0.1 -0.12"),
        ("P3", "pelvis", "-0.1 0.12 0.01"),
        ("L1", "leg", "0.05 -0.2 0.02"),
        ("L2", "leg", "-0.05 -0.1 0.07"),
    ]
)


def model(
    joints: str, constraints: str = "", markers: str = MARKERS, version: int = 40000, pelvis_mass: float = 10.0
) -> str:
    return f"""<?xml version="1.0" encoding="UTF-8" ?>
<OpenSimDocument Version="{version}">
<Model name="small">
<gravity>0 -9.8066 0</gravity>
<length_units>meters</length_units>
<BodySet name="bodyset"><objects>
{body("pelvis", pelvis_mass)}{body("leg", 3.0, "-0.01 -0.2 0.02")}</objects><groups /></BodySet>
<JointSet name="jointset"><objects>
{joints}</objects><groups /></JointSet>
<ConstraintSet name="constraintset"><objects>{constraints}</objects><groups /></ConstraintSet>
<MarkerSet name="markerset"><objects>
{markers}</objects><groups /></MarkerSet>
</Model>
</OpenSimDocument>
"""
