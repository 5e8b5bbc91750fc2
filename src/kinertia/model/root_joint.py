"""Defines `Root`: the free joint between ground and the root segment.

It has three translations, then three rotations about body-fixed perpendicular axes: tilt (z), list (x), rotation (y) in
the 27-DOF model, any such triple in an OpenSim model. "Residual" always means force (N) in ground axes and moment (N m)
about the centre of these rotations (the pelvis origin, unless the model defines another point), in ground axes.
"""

import warnings
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation


@dataclass(frozen=True, eq=False)
class Root:
    """Position and axes of the free joint.

    Attributes:
        rotation, translation: (3, 3) and (3,) m, the joint's frame in ground.
        slides: (3, 3) columns are the directions of the three translations, in the joint's frame.
        turns: (3, 3) columns are the axes of the three rotations at zero, in the joint's frame.
        child_rotation, child_translation: the joint's far frame in the root segment's frame.
    """

    rotation: np.ndarray
    translation: np.ndarray
    slides: np.ndarray
    turns: np.ndarray
    child_rotation: np.ndarray
    child_translation: np.ndarray

    def centre(self, q: np.ndarray) -> np.ndarray:
        """Return the centre (n, 3) m of the rotations in ground, at the root coordinates q (n, 6 or more)."""
        result: np.ndarray = self.translation + q[:, :3] @ self._slides.T
        return result

    @property
    def moves(self) -> np.ndarray:
        """Directions (3, 3), in rows and in ground, in which the first three coordinates move the centre."""
        return np.ascontiguousarray(self._slides.T)

    @property
    def _slides(self) -> np.ndarray:
        result: np.ndarray = self.rotation @ self.slides
        return result

    def axes(self, q: np.ndarray) -> np.ndarray:
        """Return the axes (n, 3, 3) of the three rotations in ground, in columns; omega = A * angle rates."""
        first, second, third = (self.rotation @ self.turns).T
        c1, s1, c2, s2 = np.cos(q[:, 3, None]), np.sin(q[:, 3, None]), np.cos(q[:, 4, None]), np.sin(q[:, 4, None])
        about_2 = c1 * second + s1 * np.cross(first, second)
        # the third axis, rotated by the second angle, then by the first
        along = float(np.cross(second, third) @ first)
        about_3 = c2 * (c1 * third + s1 * np.cross(first, third)) + s2 * along * first
        return np.stack([np.broadcast_to(first, about_2.shape), about_2, about_3], axis=-1)

    def about_centre(self, q: np.ndarray, load: np.ndarray) -> np.ndarray:
        """Convert a load (n, 6: force, moment about the ground origin) to moments about the centre."""
        force, moment = load[:, :3], load[:, 3:]
        return np.concatenate([force, moment - np.cross(self.centre(q), force)], axis=1)

    def centre_moves(self, load: np.ndarray) -> np.ndarray:
        """Return d x force (n, 3, 3) of a load (n, 6), a column for each direction d of the centre's translation."""
        return np.stack([np.cross(direction, load[:, :3]) for direction in self._slides.T], axis=-1)

    def coordinates(self, rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
        """Return root coordinates (n, 6) for these rotations (n, 3, 3) and translations (n, 3) of the root segment."""
        centre = translation + rotation @ self.child_translation
        turned = self.rotation.T @ rotation @ self.child_rotation
        with warnings.catch_warnings(action="ignore"):  # at gimbal lock one of the possible triples will do
            angles = Rotation.from_matrix(turned).as_davenport(self.turns.T, "intrinsic")
        slides = np.linalg.solve(self._slides, (centre - self.translation).T).T
        return np.hstack([slides, angles])
