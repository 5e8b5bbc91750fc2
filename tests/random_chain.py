"""Random models with ranges, and smooth motions within them: what inverse kinematics must give back."""

import numpy as np
from scipy.spatial.transform import Rotation

from kinertia.model.coordinate_range import Range
from kinertia.model.skeleton import Axis, Joint, Marker, Skeleton

_ROOT = tuple(
    Axis(f"root_{name}", kind, tuple(direction))
    for kind, names in (("translation", ("tx", "ty", "tz")), ("rotation", ("rz", "rx", "ry")))
    for name, direction in zip(
        names, np.eye(3) if kind == "translation" else np.roll(np.eye(3), 1, axis=0), strict=True
    )
)


def random_chain(rng: np.random.Generator, clamped: bool = True) -> Skeleton:
    """A root with three chains of two or three segments, joints of one to three axes, four markers on each segment.

    Ranges are those of human joints: an angle between minus and plus 160 degrees, up to 150 degrees wide.
    """
    joints = [Joint("ground", "root", np.eye(3), np.zeros(3), _ROOT)]
    ranges: dict[str, Range] = {}
    markers = _markers(rng, "root")
    for chain in range(3):
        parent = "root"
        for link in range(rng.integers(2, 4)):
            child = f"body_{chain}_{link}"
            axes = _axes(rng, child, ranges, clamped)
            turned = Rotation.random(random_state=rng).as_matrix()
            joints.append(Joint(parent, child, turned, rng.uniform(-0.4, 0.4, 3), axes))
            markers += _markers(rng, child)
            parent = child
    start = {name: limits.middle for name, limits in ranges.items()}
    return Skeleton("chain", tuple(joints), tuple(markers), ranges=ranges, start=start)


def _axes(rng: np.random.Generator, child: str, ranges: dict[str, Range], clamped: bool) -> tuple[Axis, ...]:
    directions = Rotation.random(random_state=rng).as_matrix()
    count = rng.integers(1, 4)
    axes = tuple(Axis(f"{child}_{k}", "rotation", tuple(directions[k])) for k in range(count))
    for k, axis in enumerate(axes):
        # a joint of three axes is told by a middle angle within a right angle, as anatomists choose them
        widest = 1.5 if count == 3 and k == 1 else 2.8
        width = rng.uniform(0.5, 2.6)
        low = rng.uniform(-widest, max(widest - width, -widest))
        ranges[axis.coordinate] = Range(low, min(low + width, widest), clamped)
    return axes


def _markers(rng: np.random.Generator, segment: str) -> list[Marker]:
    corners = 0.1 * np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)])
    return [Marker(f"{segment}_m{k}", segment, at + rng.uniform(-0.05, 0.05, 3)) for k, at in enumerate(corners)]


def motion_within(rng: np.random.Generator, skeleton: Skeleton, time: np.ndarray) -> np.ndarray:
    """(n, c) coordinates that swing through their ranges, from end to end where they do, at up to 1.5 Hz."""
    q = np.empty((len(time), len(skeleton.coordinates)))
    for column, name in enumerate(skeleton.coordinates):
        free = Range(-0.5, 0.5, clamped=False)
        ends = skeleton.ranges.get(name, free)
        swing = np.sin(2 * np.pi * rng.uniform(0.2, 1.5) * time + rng.uniform(0, 2 * np.pi)) * rng.uniform(0.3, 1.0)
        q[:, column] = ends.middle + (ends.high - ends.low) / 2 * swing
    return q
