"""Does a plate stand in the file more than once? Programs combine plates into further ones, and export them beside."""

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity
from kinertia.trial.data import LOAD_THRESHOLD_N, FloatArray, PlateLoads

_EQUAL = 0.03
"""RMS difference of two forces over their peak. Both feet in a squat, which load two plates alike, differ by 0.1, since
each pushes outwards."""
_OF_VARIATION = 0.3
"""The same over the variation of the force under load: a person who stands evenly loads two plates alike, and sways
from one to the other."""
_PROPORTIONAL, _SAME_PLACE_M = 0.99, 0.02
_LOADED_N = 5 * LOAD_THRESHOLD_N
_FEWEST = 20
"""Samples under load."""


def repeated_plates(context: RecordingContext) -> Iterator[Finding]:
    """Report P287: the load of a plate is another plate's, or two others' together."""
    plates = context.recording.plates
    if plates is None:
        return
    used = [p for p in range(len(plates.names)) if (plates.force[:, p, 1] > _LOADED_N).sum() >= _FEWEST]
    repeated: dict[int, tuple[tuple[int, ...], float]] = {}
    for p in used:
        others = [other for other in used if other != p and p not in repeated.get(other, ((),))[0]]
        single = [(other,) for other in others if other < p and other not in repeated]
        for parts in (*single, *combinations([one for one in others if one not in repeated], 2)):
            difference = _difference(plates, p, parts)
            if difference < _EQUAL or _at_the_same_place(plates, p, parts):
                repeated[p] = parts, difference
                break
    own = ", ".join(f'"{plates.names[p]}"' for p in used if p not in repeated)
    for p, (parts, difference) in repeated.items():
        yield finding(
            "P287",
            context.at(plate=plates.names[p]),
            difference=Quantity(difference, "1", limit=_EQUAL),
            others=Quantity(" and ".join(plates.names[part] for part in parts)),
            names=Quantity(own),
        )


def _difference(plates: PlateLoads, p: int, parts: tuple[int, ...]) -> float:
    """Return the RMS difference of a plate's force from the sum of others', over its peak; infinite where one of them
    is unloaded while the plate is loaded, or where the forces vary differently.
    """
    force, total = plates.force[:, p], plates.force[:, list(parts)].sum(axis=1)
    loaded = (force[:, 1] > _LOADED_N) | (total[:, 1] > _LOADED_N)
    if any((plates.force[loaded, part, 1] > _LOADED_N).sum() < _FEWEST for part in parts):
        return np.inf
    off, varying = force[loaded] - total[loaded], force[loaded] - force[loaded].mean(axis=0)
    rms, variation = (float(np.sqrt(np.square(each).sum(axis=1).mean())) for each in (off, varying))
    return rms / float(force[:, 1].max()) if rms < _OF_VARIATION * variation else np.inf


def _at_the_same_place(plates: PlateLoads, p: int, parts: tuple[int, ...]) -> bool:
    """Decide whether a plate is at the place of one other, and its load is proportional to that one's."""
    if len(parts) != 1 or plates.corners is None:
        return False
    (other,) = parts
    one, two = (plates.force[:, each, 1] for each in (p, other))
    loaded = (one > _LOADED_N) | (two > _LOADED_N)
    middles: FloatArray = plates.corners[[p, other]].mean(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        alike = np.corrcoef(one[loaded], two[loaded])[0, 1] > _PROPORTIONAL
    return bool(alike and np.linalg.norm(middles[0] - middles[1]) < _SAME_PLACE_M)
