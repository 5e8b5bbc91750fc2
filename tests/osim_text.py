"""Small OpenSim models as text, format 4: a pelvis free in ground, and one more body on the joint to be tested."""

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
    places: tuple[tuple[str, str], tuple[str, str]] = (
        ("0.1 -0.05 0.02", "0.1 -0.2 0.3"),
        ("0.02 0.3 -0.04", "0.2 0.1 -0.4"),
    ),
) -> str:
    (here, turned), (there, back) = places
    return (
        f'<{kind} name="{name}"><socket_parent_frame>near</socket_parent_frame>'
        f"<socket_child_frame>far</socket_child_frame>\n"
        f"<coordinates>{''.join(coordinate(c) for c in coordinates)}</coordinates>\n"
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


def coupler(function: str, dependent: str = "b", leader: str = "a", scale: str = "") -> str:
    return (
        f'<CoordinateCouplerConstraint name="pair{dependent}"><coupled_coordinates_function>{function}'
        f"</coupled_coordinates_function><independent_coordinate_names>{leader}</independent_coordinate_names>"
        f"<dependent_coordinate_name>{dependent}</dependent_coordinate_name>{scale}</CoordinateCouplerConstraint>"
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


def old_body(name: str, mass: str, joint_text: str) -> str:
    names = [f"inertia_{axes}" for axes in ("xx", "yy", "zz", "xy", "xz", "yz")]
    moments = zip(names, (0.02, 0.01, 0.03, 0.001, -0.002, 0.003), strict=True)
    tensor = "".join(f"<{tag}>{value}</{tag}>" for tag, value in moments)
    return (
        f'<Body name="{name}"><mass>{mass}</mass><mass_center>0.02 -0.1 0.03</mass_center>{tensor}'
        f"<Joint>{joint_text}</Joint></Body>"
    )


def old_joint(kind: str, name: str, parent: str, coordinates: str, place: str, inside: str = "") -> str:
    held = "".join(
        f'<Coordinate name="{c}"><motion_type>rotational</motion_type><default_value>0</default_value>'
        f"<range>-3 3</range><clamped>false</clamped><locked>false</locked></Coordinate>"
        for c in coordinates.split()
    )
    return (
        f'<{kind} name="{name}"><parent_body>{parent}</parent_body>{place}'
        f'<CoordinateSet name=""><objects>{held}</objects></CoordinateSet><reverse>false</reverse>{inside}</{kind}>'
    )


def old_model() -> str:
    standing = "<location_in_parent>0 0 0</location_in_parent><orientation_in_parent>0 0 0</orientation_in_parent>"
    standing += "<location>0 0 0</location><orientation>0 0 0</orientation>"
    turned = "<location_in_parent>0.1 -0.2 0.3</location_in_parent><orientation_in_parent>0.1 0.2 0.3"
    turned += "</orientation_in_parent><location>0 0.2 0</location><orientation>0.2 -0.1 0</orientation>"
    names = "tilt list turn tx ty tz"
    directions = ("0 0 1", "1 0 0", "0 1 0", "1 0 0", "0 1 0", "0 0 1")
    wrapped = f"<function>{LINEAR}</function>"
    root = transform([(name, axis, wrapped) for name, axis in zip(names.split(), directions, strict=True)])
    bodies = old_body("pelvis", "10", old_joint("CustomJoint", "root", "ground", names, standing, root))
    bodies += old_body("leg", "3", old_joint("PinJoint", "hip", "pelvis", "flexion", turned))
    marker = '<Marker name="M"><body>leg</body><location>0.1 -0.2 0.05</location><fixed>false</fixed></Marker>'
    return f"""<?xml version="1.0" encoding="UTF-8" ?>
<OpenSimDocument Version="30000"><Model name="old"><gravity> 0 -9.81 0</gravity>
<BodySet name=""><objects><Body name="ground"><mass>0</mass><mass_center>0 0 0</mass_center><inertia_xx>0</inertia_xx>
<inertia_yy>0</inertia_yy><inertia_zz>0</inertia_zz><inertia_xy>0</inertia_xy><inertia_xz>0</inertia_xz>
<inertia_yz>0</inertia_yz><Joint /></Body>{bodies}</objects></BodySet>
<ConstraintSet name=""><objects /></ConstraintSet>
<MarkerSet name=""><objects>{marker}</objects></MarkerSet></Model></OpenSimDocument>"""
