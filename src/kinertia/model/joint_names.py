"""Lists the joints' everyday names, with the coordinates of each."""

from __future__ import annotations

JOINTS = {
    "hip flexion": ("hip_flexion",),
    "hip adduction": ("hip_adduction",),
    "hip rotation": ("hip_rotation",),
    "knee": ("knee",),
    "ankle": ("ankle", "subtalar"),
    "lumbar extension": ("lumbar_extension",),
    "lumbar bending": ("lumbar_bending",),
    "lumbar rotation": ("lumbar_rotation",),
    "arms": ("arm", "elbow"),
}
"""Beginnings of the names of each joint's coordinates, left and right."""
