"""Rotation matrices from axes and angles, and back."""

from __future__ import annotations

import numpy as np


def about(axis: np.ndarray, angle: float) -> np.ndarray:
    """(3, 3) the rotation about a unit axis (3,) by an angle in rad (Rodrigues)."""
    x, y, z = axis
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    result: np.ndarray = np.eye(3) + np.sin(angle) * across + (1.0 - np.cos(angle)) * across @ across
    return result


def least_turn(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """(3, 3) the smallest rotation that turns the direction of `start` (3,) into that of `end` (3,)."""
    across = np.cross(start, end)
    sine = float(np.linalg.norm(across))
    if sine == 0.0:  # any axis square to them will do
        across = np.cross(start, np.eye(3)[np.argmin(np.abs(start))])
    return about(across / np.linalg.norm(across), float(np.arctan2(sine, start @ end)))


def three_angles(rotation: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """(..., 3) rad: angles about three body-fixed axes, square to one another, that make up rotations (..., 3, 3).

    Args:
        rotation: a product of turns about the first, the second and the third axis, in this order.
        axes: (3, 3) unit axes in columns; at gimbal lock the third angle is taken as zero.
    """
    first, second, third = axes.T
    handed = float(np.cross(first, second) @ third)
    own = axes * [1.0, 1.0, handed]
    m = own.T @ rotation @ own
    tilt = np.arctan2(m[..., 0, 2], np.hypot(m[..., 0, 0], m[..., 0, 1]))
    locked = np.hypot(m[..., 0, 0], m[..., 0, 1]) < 1e-7
    turn = np.where(locked, np.arctan2(m[..., 2, 1], m[..., 1, 1]), np.arctan2(-m[..., 1, 2], m[..., 2, 2]))
    roll = np.where(locked, 0.0, np.arctan2(-m[..., 0, 1], m[..., 0, 0]))
    return np.stack([turn, tilt, handed * roll], axis=-1)
