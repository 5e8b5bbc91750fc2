"""A gain that all plates have alike: what the scale did not weigh, or what the plates did not carry.

The estimate knows a gain by the scale alone: plates that read a tenth more than the stated mass may read too much, or
carry a tenth more. Two plates have two amplifiers and two calibrations, and a person has one mass, so that what both
lack alike is the mass's, or what was carried, before it is the plates'.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from kinertia.diagnostics.subject.force_mass import CARRIED_HINT, UNMEASURED_HINT, ForceMass
from kinertia.estimation.carried_mass import CarriedMass
from kinertia.estimation.simultaneous.instrument_warnings import GAIN, common


def common_gain_warning(
    calibration: Mapping[str, Mapping[str, float | str]], by_force: Sequence[ForceMass], carried: CarriedMass
) -> str:
    """A sentence where all plates have the same gain, else "".

    Args:
        calibration: what a fit found of plates and clock.
        by_force: body mass by the forces, of each trial that tells it.
        carried: what was stated.
    """
    gains = common(calibration, GAIN)
    if not gains:
        return ""
    listed = ", ".join(f"{100 * gain:+.1f} % ({plate})" for plate, gain in gains.items())
    masses = ", ".join(f"{one.mass_kg:.1f} kg ({one.trial})" for one in by_force)
    beside = f"the mean vertical force corresponds to {masses}; stated mass {carried}" if by_force else ""
    if len(by_force) == 1:
        beside += f" ({100 * (by_force[0].mass_kg / carried.total_kg - 1):+.1f} %)"
    more = next(iter(gains.values())) < 0.0
    advice = f"{CARRIED_HINT}; else correct the mass" if more else f"correct the mass, {UNMEASURED_HINT}"
    return (
        f"all plates read {'more' if more else 'less'} than the stated mass, and alike (gains that would put it right: "
        f"{listed}){'; ' if beside else ''}{beside}; {advice}; least likely, the plates' common amplifier, "
        "calibration or unit is wrong"
    )
