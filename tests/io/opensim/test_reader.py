from pathlib import Path

import numpy as np
import pytest

from kinertia.errors import FileError, OsimError
from kinertia.io.opensim.reader import read_osim
from kinertia.model.imported_model import OsimModel
from kinertia.motion.dynamics import Motion
from osim_comparison import (
    MODELS,
    N_STATES,
    SLOW_IF_LARGE,
    SMALL,
    assert_opensim_agrees,
    free_dynamics,
    mass_matrices,
    random_states,
)
from osim_text import LINEAR, ZERO, body, coordinate, coupler, custom_root, frame, joint, model, old_model, transform


@pytest.fixture
def written(tmp_path):
    """Writes a model's text and reads it back."""

    def write(text: str) -> tuple[Path, OsimModel]:
        path = tmp_path / "small.osim"
        path.write_text(text)
        return path, read_osim(path)

    return write


# --- whole models


@pytest.mark.parametrize("name", SLOW_IF_LARGE)
def test_opensim_agrees_on_markers_forces_and_mass_matrix(opensim, file_of, name):
    ours = read_osim(file_of(name))
    assert_opensim_agrees(file_of(name), ours)


@pytest.mark.parametrize("name", SMALL)
def test_a_file_that_opensim_converted_is_the_same_model(opensim, file_of, tmp_path, name):
    path = tmp_path / "converted.osim"
    opensim.Model(str(file_of(name))).printToXML(str(path))
    first, second = read_osim(file_of(name)), read_osim(path)
    assert b'Version="40600"' in second.content
    assert [c.name for c in first.coordinates] == [c.name for c in second.coordinates]
    np.testing.assert_array_equal(first.bsp.table(), second.bsp.table())
    assert_opensim_agrees(path, second)


@pytest.mark.parametrize("name", MODELS)
def test_degrees_where_opensim_has_degrees(opensim, file_of, name):
    ours = read_osim(file_of(name))
    theirs = opensim.Model(str(file_of(name)))
    theirs.initSystem()
    coordinate_set = theirs.getCoordinateSet()
    rotational = opensim.Coordinate.Rotational
    assert [c.angle for c in ours.coordinates] == [
        coordinate_set.get(c.name).getMotionType() == rotational for c in ours.coordinates
    ]


# --- one joint at a time

PIN = joint("PinJoint", "between", "/bodyset/pelvis", "leg", "a")

SPLINE = "<x>-2 -1 0 0.7 1.6 3</x><y>0.1 -0.3 0.05 0.2 0.6 0.4</y>"
FUNCTIONS = {
    "Constant": '<Constant name="function"><value>0.3</value></Constant>',
    "LinearFunction": '<LinearFunction name="function"><coefficients>-0.6 0.2</coefficients></LinearFunction>',
    "mirrored": '<LinearFunction name="function"><coefficients>-1 0</coefficients></LinearFunction>',
    "PolynomialFunction": "<PolynomialFunction><coefficients>0.1 -0.2 0.5 0.05</coefficients></PolynomialFunction>",
    "SimmSpline": f'<SimmSpline name="function">{SPLINE}</SimmSpline>',
    "PiecewiseLinearFunction": f"<PiecewiseLinearFunction>{SPLINE}</PiecewiseLinearFunction>",
    "MultiplierFunction": f"<MultiplierFunction><function><SimmSpline>{SPLINE}</SimmSpline></function>"
    "<scale>1.3</scale></MultiplierFunction>",
    "none": "",
}


def custom(axes) -> str:
    coordinates = sorted({c for c, _, _ in axes if c})
    return joint("CustomJoint", "between", "/bodyset/pelvis", "leg", coordinates, transform(axes))


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("moved", [0, 3])
def test_a_function_of_a_coordinate(opensim, written, name, moved):
    """On a rotation or a translation, beside a plain rotation of the same coordinate."""
    axes = [("", axis, ZERO) for axis in ("0.1 0 0.9", "0 1 0", "1 0 0.2") * 2]
    axes[1] = ("bend", "0 1 0", LINEAR)
    axes[moved] = ("bend", axes[moved][1], FUNCTIONS[name])
    assert_opensim_agrees(*written(model(custom_root() + custom(axes))))


def test_a_custom_joint_of_six_coordinates(opensim, written):
    axes = [
        (name, axis, LINEAR)
        for name, axis in zip("abcdef", ("0 0 1", "1 0 0.1", "0 1 0", "1 0 0", "0 1.2 0", "0.1 0 1"), strict=True)
    ]
    _, ours = written(model(custom_root() + custom(axes)))
    assert_opensim_agrees(ours.path, ours)


JOINTS = {"PinJoint": 1, "SliderJoint": 1, "UniversalJoint": 2, "GimbalJoint": 3, "PlanarJoint": 3, "WeldJoint": 0}


@pytest.mark.parametrize("kind", JOINTS)
def test_a_joint_type(opensim, written, kind):
    tested = joint(kind, "between", "/bodyset/pelvis", "leg", "abc"[: JOINTS[kind]])
    assert_opensim_agrees(*written(model(custom_root() + tested)))


def euler_rates_to_speeds(angles: np.ndarray) -> np.ndarray:
    """(3, 3): angular velocity in the parent's joint frame for body-fixed x-y-z angle rates."""
    from scipy.spatial.transform import Rotation

    first = Rotation.from_euler("X", angles[0]).as_matrix()
    second = first @ Rotation.from_euler("Y", angles[1]).as_matrix()
    return np.column_stack([np.eye(3)[0], first[:, 1], second[:, 2]])


@pytest.mark.parametrize(("root", "kind"), [("FreeJoint", "GimbalJoint"), ("CustomJoint", "BallJoint")])
def test_joints_whose_speeds_are_not_the_rates_of_their_coordinates(opensim, written, root, kind):
    """OpenSim gives moments of Ball and Free joints per angular velocity; here they are per angle rate."""
    from osim_oracle import OsimOracle

    free = joint("FreeJoint", "root", "/ground", "pelvis", ("tilt", "list", "turn", "tx", "ty", "tz"))
    tested = joint(kind, "between", "/bodyset/pelvis", "leg", "abc")
    path, ours = written(model((free if root == "FreeJoint" else custom_root()) + tested))
    oracle = OsimOracle(path, ours)
    motion = random_states(ours, N_STATES, 1.0)
    markers = ours.skeleton.marker_positions(ours.skeleton.pose(motion.q))
    still = np.zeros_like(motion.q)
    weight, mass = free_dynamics(ours, Motion(motion.q, still, still)), mass_matrices(ours, motion.q)
    first = 3 if root == "FreeJoint" else 6
    for k, q in enumerate(motion.q):
        oracle.pose(q, still[k])
        np.testing.assert_allclose(markers[k], oracle.markers(), atol=1e-9)
        speeds = np.eye(9)
        speeds[first : first + 3, first : first + 3] = euler_rates_to_speeds(q[first : first + 3])
        theirs = speeds.T @ oracle.inverse_dynamics(q, still[k], still[k])
        np.testing.assert_allclose(weight[k], theirs, atol=1e-6)
        np.testing.assert_allclose(mass[k], speeds.T @ oracle.mass_matrix(q) @ speeds, atol=1e-9)


@pytest.mark.parametrize("name", ["LinearFunction", "mirrored", "PolynomialFunction", "SimmSpline"])
def test_a_coupled_coordinate(opensim, written, name):
    """The follower moves by a curve of its own, so functions are composed; one more follows the follower."""
    axes = [
        ("a", "0 0 1", LINEAR),
        ("b", "1 0 0", FUNCTIONS["SimmSpline"]),
        ("c", "0 1 0", LINEAR),
        ("b", "1 0 0", FUNCTIONS["mirrored"]),
        ("", "0 1 0", ZERO),
        ("", "0 0 1", ZERO),
    ]
    constraints = coupler(FUNCTIONS["PolynomialFunction"], "c", "b") + coupler(
        FUNCTIONS[name], scale="<scale_factor>0.8</scale_factor>"
    )
    path, ours = written(model(custom_root() + custom(axes), constraints))
    assert ours.skeleton.coordinates[6:] == ("a",)
    assert_opensim_agrees(path, ours, speed=0.0)


def test_locked_coordinates_stand_at_their_defaults(opensim, written):
    held = "<default_value>0.4</default_value><locked>true</locked>"
    tested = joint("GimbalJoint", "between", "/bodyset/pelvis", "leg", "abc").replace(
        coordinate("b"), coordinate("b", held)
    )
    path, ours = written(model(custom_root() + tested))
    assert ours.skeleton.locked == {"b": 0.4}
    assert_opensim_agrees(path, ours)


@pytest.mark.parametrize("inertia", ["0 0 0 0 0 0", "0.01 0.02 0.02 0 0 0"])
def test_a_massless_body(opensim, written, inertia):
    """Between two others; with inertia all the same, as some have it."""
    between = body("leg", 3.0, "-0.01 -0.2 0.02")
    foot = joint("PinJoint", "below", "/bodyset/leg", "foot", "b")
    text = model(custom_root() + PIN + foot)
    text = text.replace(between, body("leg", 0.0, "-0.01 -0.2 0.02", inertia) + body("foot", 1.0))
    assert_opensim_agrees(*written(text))


def test_frames_on_frames_and_markers_on_frames(opensim, written):
    outer = frame("outer", "/bodyset/pelvis", "0.1 0.2 0.3", "0.3 -0.2 0.5")
    tested = joint("PinJoint", "between", "../outer", "leg", "a").replace("<frames>", f"<frames>{outer}")
    marker = (
        '<Marker name="F"><socket_parent_frame>/jointset/between/outer</socket_parent_frame>'
        "<location>0.1 0 0.2</location></Marker>"
    )
    text = model(custom_root() + tested)
    assert_opensim_agrees(
        *written(
            text.replace('<MarkerSet name="markerset"><objects>', f'<MarkerSet name="markerset"><objects>{marker}')
        )
    )


def test_a_root_on_turned_frames(opensim, written):
    turned = joint(
        "CustomJoint",
        "root",
        "/ground",
        "pelvis",
        ("tilt", "list", "turn", "tx", "ty", "tz"),
        transform(
            [("tilt", "0 0 1", LINEAR), ("list", "-1 0 0", LINEAR), ("turn", "0 1 0", LINEAR)]
            + [(f"t{name}", axis, LINEAR) for name, axis in zip("xyz", ("1 0 0", "0 1 0", "0 0 1"), strict=True)]
        ),
    )
    tested = joint("PinJoint", "between", "/bodyset/pelvis", "leg", "a")
    assert_opensim_agrees(*written(model(turned + tested)))


# --- format 3


def test_format_3(opensim, written):
    path, ours = written(old_model())
    assert ours.skeleton.gravity_m_s2 == 9.81
    assert_opensim_agrees(path, ours)


# --- bad input

SOUND = model(custom_root() + PIN)
WELDED_ROOT = joint("WeldJoint", "root", "/ground", "pelvis", ())
TWO_ROOTS = custom_root() + joint("PinJoint", "between", "/ground", "leg", "a")
SPIN = transform([("a", "0 0 1", "<GCVSpline />")] + [("", axis, ZERO) for axis in ("0 1 0", "1 0 0") + ("1 0 0",) * 3])
BAD = {
    "without a free root joint": (model(WELDED_ROOT + PIN), "O103"),
    "a locked root": (
        SOUND.replace(coordinate("tz"), coordinate("tz", "<locked>true</locked>")),
        "O103",
    ),
    "two roots": (model(TWO_ROOTS), "O103"),
    "zero-mass root": (model(custom_root() + PIN, pelvis_mass=0.0), "O103"),
    "unknown joint type": (SOUND.replace("PinJoint", "EllipsoidJoint"), "O102"),
    "unknown function type": (
        model(custom_root() + joint("CustomJoint", "between", "/bodyset/pelvis", "leg", "a", SPIN)),
        "O102",
    ),
    "not XML": (SOUND.replace("</BodySet>", "</BodyST>"), "O101"),
    "another kind of XML": ("<html><body/></html>", "O101"),
    "a newer format": (SOUND.replace("40000", "40700"), "O101"),
    "an ancient format": (SOUND.replace("40000", "10904"), "O101"),
    "a joint to nowhere": (SOUND.replace("/bodyset/leg</socket", "/bodyset/arm</socket", 1), "O103"),
    "a marker on nothing": (
        SOUND.replace(">/bodyset/leg</socket_parent_frame>", ">/bodyset/arm</socket_parent_frame>"),
        "O103",
    ),
    "two markers of one name": (
        SOUND.replace('name="P2"', 'name="L1"'),
        "O105",
    ),
    "a marker twice in one place": (
        SOUND.replace('name="L2"', 'name="L1"').replace("-0.05 -0.1 0.07", "0.05 -0.2 0.02"),
        "O105",
    ),
    "a loop": (
        SOUND.replace(
            "</objects><groups /></JointSet>",
            joint("WeldJoint", "again", "/bodyset/pelvis", "leg", ()) + "</objects><groups /></JointSet>",
        ),
        "O103",
    ),
    "a loose body": (
        SOUND.replace('<BodySet name="bodyset"><objects>', '<BodySet name="bodyset"><objects>' + body("arm", 1.0)),
        "O103",
    ),
    "another constraint": (
        model(custom_root() + PIN, '<PointConstraint name="p"><isEnforced>true</isEnforced></PointConstraint>'),
        "O102",
    ),
    "letters for numbers": (SOUND.replace("<mass>3.0</mass>", "<mass>heavy</mass>"), "O102"),
    "too few numbers": (SOUND.replace("-0.01 -0.2 0.02", "-0.01 -0.2"), "O102"),
    "a negative mass": (SOUND.replace("<mass>3.0</mass>", "<mass>-3</mass>"), "O103"),
    "gravity sideways": (SOUND.replace("0 -9.8066 0", "0 0 -9.8066"), "O104"),
    "gravity of the moon": (SOUND.replace("-9.8066", "-1.62"), "O104"),
    "gravity not quite": (SOUND.replace("-9.8066", "-9.5"), "O104"),
    "gravity in mm": (
        SOUND.replace("-9.8066", "-9806.65"),
        "O104",
    ),
    "a coupling in a circle": (
        model(
            custom_root() + joint("UniversalJoint", "between", "/bodyset/pelvis", "leg", "ab"),
            coupler(LINEAR, "a", "b") + coupler(LINEAR, "b", "a"),
        ),
        "O102",
    ),
    "a coupling of strangers": (model(custom_root() + PIN, coupler(LINEAR, "z", "a")), "O102"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_models_are_refused_in_one_line(written, name):
    text, code = BAD[name]
    with pytest.raises(OsimError) as error:
        written(text)
    assert error.value.finding.code == code
    assert "\n" not in str(error.value)
    assert "small.osim" in str(error.value)


def test_errors_carry_the_element_and_its_line(written):
    with pytest.raises(OsimError) as error:
        written(BAD["unknown joint type"][0])
    assert (error.value.element, error.value.kind) == ("between", "EllipsoidJoint")
    lines = BAD["unknown joint type"][0].splitlines()
    assert "<EllipsoidJoint" in lines[error.value.line - 1]


def test_a_missing_file():
    with pytest.raises(FileError, match="F101"):
        read_osim("nowhere.osim")
