"""Reports the effect of an upper body without markers.

The figures are differences of the joint moments (RMS over the window) with and without the markers of arms and head, or
of all of the upper body, in the walks of gait2354 and of Rajagopal's model: 1 to 7 N m in the legs and 3 to 11 N m at
the lumbar joint without trunk markers, 0.1 to 5 and 1 to 8 N m without those of the arms; all within their error bars.
"""

from collections.abc import Iterator

from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.model.gait27 import ARM_COORDINATES, VIRTUAL_TRUNK
from kinertia.model.marker_set import in_words
from kinertia.model.skeleton import Skeleton

_UPRIGHT = "upright on the pelvis, with literature values"
_HANGING = "hanging straight down from the trunk, which carries them"


def unobserved_segments(skeleton: Skeleton) -> Iterator[Finding]:
    """Report R401: trunk or arms without enough markers, in a 27-DOF model that was adapted to its trials."""
    locked = {name for name in ARM_COORDINATES if name in skeleton.locked}
    joined = len(locked) == len(ARM_COORDINATES)
    if VIRTUAL_TRUNK[0].label in skeleton.labels:
        yield _unobserved("trunk, arms and head" if joined else "trunk", _UPRIGHT, (1.0, 7.0))
    elif joined:
        yield _unobserved("arms", _HANGING, (0.1, 5.0))
    if locked and not joined:
        for side in "rl":
            own = {name.removesuffix(f"_{side}") for name in locked if name.endswith(f"_{side}")}
            if own:
                part = in_words(f"{'forearm' if own == {'elbow_flex'} else 'arm'}_{side}")
                yield _unobserved(part, _HANGING.replace("them", "it"), (0.0, 5.0))


def _unobserved(part: str, assumed: str, change_nm: tuple[float, float]) -> Finding:
    return finding("R401", Where(part=part), moment_change_nm=Quantity(change_nm, "N m"), assumed=Quantity(assumed))
