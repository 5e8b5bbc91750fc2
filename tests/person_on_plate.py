"""A person standing on a force plate, as a C3D file."""

import numpy as np

from c3d_writer import plate_parameters, write_c3d

CORNERS = np.array([[[0, 500, 0], [500, 500, 0], [500, 0, 0], [0, 0, 0]]], float)  # mm, type 2: z down
SCREEN = {"POINT": {"Y_SCREEN": ["+Z"]}}


def standing(n=20, labels=("RHEE", "RTOE", "RASI", "RFHD")):
    """Points (n, m, 3) mm of somebody upright over the plate, Z up."""
    height = np.linspace(30, 1700, len(labels))
    points = np.column_stack(
        (np.full(len(labels), 250.0) + 20 * np.arange(len(labels)), np.full(len(labels), 240.0), height)
    )
    return np.tile(points, (n, 1, 1)), list(labels)


def stepping(n=20, per_frame=10, vertical=-600.0):
    """Analogs (n * s, 6) N, N mm of a constant load at (300, 200) mm, in plate axes (-X, Y, down)."""
    force = np.array([-30.0, 20.0, vertical])
    point = np.array([-(300 - 250), 200 - 250, 20.0]) * [1, 1, -1]  # from the transducer 20 mm below the surface
    return np.tile(np.concatenate((force, np.cross(point, force))), (n * per_frame, 1))


def plate_file(path, analogs, plate=None, **arguments):
    """The file of somebody `standing`, whose plate has these analogs; `plate` if it is not as `CORNERS` has it."""
    plate = plate_parameters(CORNERS) if plate is None else plate
    return write_c3d(path, *standing(), analogs, {**SCREEN, "FORCE_PLATFORM": plate}, **arguments)


def expect_centre_of_pressure(plates):
    """The only plate's loads act where those of `stepping` do."""
    force = np.tile((30, 600, -20), (len(plates.time), 1))
    np.testing.assert_allclose(plates.force[:, 0], force, atol=1e-4)
    np.testing.assert_allclose(plates.moment[:, 0], np.cross((0.3, 0, -0.2), force), atol=1e-3)
