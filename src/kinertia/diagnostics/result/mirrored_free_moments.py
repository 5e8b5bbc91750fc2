"""Free moments under right and left foot that are off like mirror images.

In some measured walks the motion needs other free moments than the plates measure, by 3 to 6 N m/kN, to one side under
the right foot and to the other under the left; in single stance the vertical moment is off by 1 to 3 N m before the
estimate, too, likewise. Where turning their sign does not explain it (`free_moment_sign`), two plates have no reason to
err like that; the body has: it is what legs, trunk and arms that turn against one another would need if their angular
momentum were wrong by some tenths of a kg m2/s, as a trunk that bends, or skin over pelvis and shoulders, may make it.
A plate that is wrong shows under one foot, or under both to the same side, as does the mean over whole strides
(`trial.free_moment`).
"""

from __future__ import annotations

from collections.abc import Mapping

from kinertia.estimation.simultaneous.instrument_warnings import mirrored_free_moments


def mirrored_free_moments_warning(calibration: Mapping[str, Mapping[str, float | str]]) -> str:
    """A sentence where free moments are off like mirror images, else "".

    >>> entry = {"prior_sd": 0.0007, "sd": 0.002, "unit": "N m/N"}
    >>> named = {"plate 1: free moment": {"value": 0.005, **entry}, "plate 2: free moment": {"value": -0.006, **entry}}
    >>> mirrored_free_moments_warning(named).partition(":")[0]
    'the motion needs other free moments than measured, +5.0 (plate 1), -6.0 (plate 2) N m/kN'
    """
    lacking = mirrored_free_moments(calibration)
    if not lacking:
        return ""
    listed = ", ".join(f"{value * 1e3:+.1f} ({plate})" for plate, value in lacking.items())
    return (
        f"the motion needs other free moments than measured, {listed} N m/kN: mirror images, so rather a trunk that is "
        f"not rigid, or skin, than the plates; moments about the long axes of foot and leg are as uncertain"
    )
