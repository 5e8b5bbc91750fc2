"""Is the stated mass the one that the plates measure?

Every occasion on which the plates support all of the person is compared: each trial, by whole strides where it has
them, and recordings of standing. Whether the mass or the plates are wrong shows in their differences: all plates and
all trials contradict a wrong mass or an undeclared load, but only one of two plates with different gains does.

On fault-free trials two plates agree on the mass within 2 %. In walking, a constant support of 50 N and a gain of 7 %
differ by 10 N, less than the marker-based centre can show, so they look the same.
"""

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from kinertia.diagnostics.context import PersonContext, odd_ones
from kinertia.diagnostics.evidence.force_mass import MISSING, MOSTLY, UNMEASURED_S, ForceMass, UnmeasuredSupport
from kinertia.diagnostics.runner import check
from kinertia.estimation.prepared import TotalMass
from kinertia.findings.finding import Finding, Severity, finding, with_evidence
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.trial.data import PlateLoads

WARNING_SHARE, ERROR_SHARE, AGREED_SHARE = Limit(0.02), Limit(0.10), Limit(0.05)
"""Stated mass and vertical force may differ by this share and twice the SD of the difference; by the last one, where
several occasions agree that they do."""
_SAME = 0.04
"""Share by which two plates, or a plate and the stated mass, may differ and still agree: usual are 2 %."""
_MOSTLY_MISSING = Limit(0.5)
_REPEATED = 0.005
"""SD, as a share, of a mass by the same plates from one occasion to another."""
_SAME_PLACE_M = 1e-3
"""Corners of the same plate in two files."""
_SINGLE_SUPPORT = 0.04
"""SD of a mass by one single support, as a share: velocities of the marker-based centre at its ends are known to 0.14
m/s."""
_LOAD_KG = 2.0
"""Smallest surplus that may be something worn or carried."""
_POUND, _UNIT_OFF = 0.45359, Limit(0.1)
"""A ratio of force to stated mass within this share of a ratio of units is likelier that of units than of people."""
_FORCE_UNITS = {"kilograms-force": 1.0 / GRAVITY_M_S2, "pounds-force": 0.2248, "kN": 0.001}

_STATED, _STATED_OVER_POUND = "a wrong stated mass", "a stated mass in kg that was divided by 2.2 once more"
_LOAD = "a load that was worn or carried and not declared as [[attached]]"
_SUPPORT = "support that no plate measures, like a handrail, a chair, a walker or a foot beside the plates"
_PLATES = "gain or zero of the plates"
_MASS_ACTIONS = ("Correct the mass", "correct the mass", "Give the mass in kg")
"""Actions with which the stated mass is to be replaced by the plates'."""


@dataclass(frozen=True)
class _Occasion:
    """A mass from forces, and its trial; None for all `count` occasions together."""

    trial: str | None
    mass_kg: float
    sd_kg: float
    over: str
    standing: bool = False
    count: int = 1

    @property
    def error_share(self) -> float:
        """Share by which the stated mass may differ before nothing is computed with it."""
        return ERROR_SHARE if self.count == 1 else AGREED_SHARE

    def allowed_kg(self, total: TotalMass, share: float) -> float:
        """Return by how much (kg) the stated mass may differ."""
        return share * total.total_kg + 2.0 * float(np.hypot(self.sd_kg, total.sd_kg))

    def differs(self, total: TotalMass, share: float) -> bool:
        """Return whether the stated mass differs by more than allowed."""
        return abs(self.mass_kg - total.total_kg) > self.allowed_kg(total, share)


@check(
    "S111",
    "S112",
    "P202",
    "P281",
    share=WARNING_SHARE,
    error=ERROR_SHARE,
    agreed=AGREED_SHARE,
    unit=_UNIT_OFF,
    missing=MISSING,
    missing_for=UNMEASURED_S,
    complete=MOSTLY,
)
def stated_mass(context: PersonContext) -> Iterator[Finding]:
    """Report S111, S112 and P281: S111 and S112 where the stated mass contradicts the plates, P281 where part of the
    weight is off the plates for a while.
    """
    total = context.total_mass
    if total is None:
        return
    known = _known(context)
    apart = _apart(context, total)
    for name, found in apart.items():
        missing, complete = Quantity(found.missing, "1", limit=MISSING), Quantity(found.complete, "1")
        yield finding("P281", Where(trial=name, span_s=found.span_s), missing=missing, complete=complete)
    yield from _ends_of_steps(known, total)
    whole, standing = _whole(context, apart), [*_standing(context)]
    partly = [_occasion(name, known[name]) for name in apart]
    for occasion in [*_together([*whole, *standing]), *partly]:
        if occasion.differs(total, WARNING_SHARE):
            # nothing is computed from the forces of a person who stands
            most = Severity.ERROR if not occasion.standing else Severity.INFO if known else Severity.WARNING
            witnesses = standing or [other for other in whole if other.trial != occasion.trial]
            for contradiction in _contradiction(context, occasion, total, witnesses):
                yield contradiction.at(min(contradiction.severity, most))


def _ends_of_steps(known: Mapping[str, ForceMass], total: TotalMass) -> Iterator[Finding]:
    """Report P281 where all the time most of the weight is on no plate: nothing there can be a step."""
    for name, mass in known.items():
        missing = 1.0 - mass.mass_kg / total.total_kg
        if not mass.is_borne and missing > _MOSTLY_MISSING:
            where = Where(trial=name, span_s=(float(mass.time[0]), float(mass.time[-1])))
            share = Quantity(missing, "1", limit=_MOSTLY_MISSING)
            yield finding("P281", where, Severity.ERROR, missing=share, complete=Quantity(0.0, "1"))


def weighed_as_stated(context: PersonContext, other_kg: float) -> bool:
    """Return whether every mass by the plates agrees with the stated one, and is nearer to it than to another."""
    total = context.total_mass
    if total is None:
        return False
    weighed = _together([*_whole(context, _apart(context, total)), *_standing(context)])
    attached_kg = total.total_kg - total.body_kg
    return bool(weighed) and all(
        not occasion.differs(total, WARNING_SHARE)
        and abs(occasion.mass_kg - total.total_kg) < abs(occasion.mass_kg - other_kg - attached_kg)
        for occasion in weighed
    )


@check("S306", share=ERROR_SHARE)
def masses_of_trials(context: PersonContext) -> Iterator[Finding]:
    """Report S306: of two trials whose forces give different masses, the one that static trial, other trials and stated
    mass contradict.
    """
    known = {name: mass for name, mass in _known(context).items() if mass.is_borne}
    standing = [occasion.mass_kg for occasion in _standing(context)]
    for (first, first_mass), (other, others) in combinations(known.items(), 2):
        lighter_kg = min(first_mass.mass_kg, others.mass_kg)
        allowed = ERROR_SHARE * lighter_kg + 2.0 * float(np.hypot(first_mass.sd_kg, others.sd_kg))
        if abs(first_mass.mass_kg - others.mass_kg) <= allowed:
            continue
        further = [mass.mass_kg for name, mass in known.items() if name not in (first, other)]
        stated = [] if context.total_mass is None else [context.total_mass.total_kg]
        witnesses = [(abs(kg - first_mass.mass_kg), abs(kg - others.mass_kg)) for kg in (*standing, *further, *stated)]
        for odd in odd_ones(first, other, witnesses):
            peer = other if odd == first else first
            yield finding(
                "S306",
                Where(trial=odd),
                mass_by_force_kg=Quantity(known[odd].mass_kg, "kg", sd=known[odd].sd_kg),
                other_kg=Quantity(known[peer].mass_kg, "kg", sd=known[peer].sd_kg),
                other_trial=Quantity(peer),
            )


def _occasion(name: str | None, mass: ForceMass, standing: bool = False) -> _Occasion:
    return _Occasion(name, mass.mass_kg, float(np.hypot(mass.sd_kg, _REPEATED * mass.mass_kg)), mass.over, standing)


def _known(context: PersonContext) -> dict[str, ForceMass]:
    """Return the masses of the trials, by name, that forces and markers show."""
    return {trial.name: mass for trial in context.trials if (mass := trial.force_mass) is not None}


def _apart(context: PersonContext, total: TotalMass) -> dict[str, UnmeasuredSupport]:
    """Return the trials by name in which part of the weight is off the plates for a while."""
    return {
        name: found for name, mass in _known(context).items() if (found := mass.unmeasured(total.total_kg)) is not None
    }


def _whole(context: PersonContext, apart: Container[str]) -> list[_Occasion]:
    """Return the masses of the trials in which all of the weight is on the plates."""
    by_plates = _by_plates(context)
    better = {occasion.trial for occasion in by_plates}
    known = ((name, mass) for name, mass in _known(context).items() if name not in apart and name not in better)
    return [*by_plates, *(_occasion(name, mass) for name, mass in known if mass.is_borne)]


def _by_plates(context: PersonContext) -> list[_Occasion]:
    """Return masses by plates that support a whole foot, where another foot beyond its plate leaves hardly a window."""
    found = []
    for trial in context.trials:
        weighed = trial.force_mass
        if trial.plates is None or (weighed is not None and weighed.sd_kg < _SINGLE_SUPPORT * weighed.mass_kg):
            continue
        masses_kg = [*trial.whole_plate_masses.values()]
        if masses_kg and trial.plates_reached_beyond:
            mass_kg = float(np.mean(masses_kg))
            sd_kg = _SINGLE_SUPPORT * mass_kg / len(masses_kg) ** 0.5
            found.append(_Occasion(trial.name, mass_kg, sd_kg, "single support"))
    return found


def _standing(context: PersonContext) -> Iterator[_Occasion]:
    """Yield masses while the person stands still with both feet on plates: in static trials, and during others."""
    for recording in (*context.standing, *context.trials):
        still = recording.standing_mass
        other_way = recording.is_static or recording.force_mass is None or recording.travel.kind != "stands still"
        if still is not None and recording.plates is not None and other_way:
            mass_kg = still.mass_kg - _level_kg(context, recording.plates, still.plates)
            sd_kg = float(np.hypot(still.sd_kg, _REPEATED * mass_kg))
            yield _Occasion(recording.name, mass_kg, sd_kg, "standing", True)
        elif recording.is_static and recording.force_mass is not None:
            yield _occasion(recording.name, recording.force_mass, True)


def _level_kg(context: PersonContext, plates: PlateLoads, loaded: Sequence[str]) -> float:
    """Return the unloaded reading (kg) of these plates by trials that show it, where the static trial does not."""
    if plates.unloaded is None or plates.corners is None:
        return 0.0
    level_n = 0.0
    for name, unloaded, corners in zip(plates.names, plates.unloaded, plates.corners, strict=True):
        levels = [
            there.level_n[1]
            for trial in context.trials
            if (trial_plates := trial.plates) is not None
            and trial_plates.unloaded is not None
            and trial_plates.corners is not None
            for same, there, place in zip(trial_plates.names, trial_plates.unloaded, trial_plates.corners, strict=True)
            if same == name and there.subtracted and np.allclose(place, corners, atol=_SAME_PLACE_M)
        ]
        if name in loaded and np.isnan(unloaded.level_n[1]) and levels:
            level_n += float(np.median(levels))
    return level_n / GRAVITY_M_S2


def _together(occasions: Sequence[_Occasion]) -> list[_Occasion]:
    """Combine the masses into one where they agree, else keep each."""
    if len(occasions) < 2:
        return list(occasions)
    weights = np.array([occasion.sd_kg**-2 for occasion in occasions])
    mass_kg = float(weights @ [occasion.mass_kg for occasion in occasions] / weights.sum())
    sd_kg = float(weights.sum() ** -0.5)
    for first, second in combinations(occasions, 2):
        if abs(first.mass_kg - second.mass_kg) > WARNING_SHARE * mass_kg + 2.0 * float(
            np.hypot(first.sd_kg, second.sd_kg)
        ):
            return list(occasions)
    over = " and ".join(dict.fromkeys(occasion.over for occasion in occasions))
    return [_Occasion(None, mass_kg, sd_kg, over, count=len({occasion.trial for occasion in occasions}))]


def _contradiction(
    context: PersonContext, occasion: _Occasion, total: TotalMass, witnesses: Sequence[_Occasion]
) -> Iterator[Finding]:
    """Report S111, with the causes that the evidence supports, and the unit that explains it."""
    where, ratio = Where(trial=occasion.trial), occasion.mass_kg / total.total_kg
    stated_kg = context.subject.mass_kg
    if _near(ratio, _POUND):
        pounds = {"ratio": Quantity(ratio, "1")}
        if stated_kg is not None:
            pounds["mass_kg"] = Quantity(stated_kg * _POUND, "kg")
        yield with_evidence("S112", where, pounds)
    percent = {"% of body weight": 100.0 / (total.body_kg * GRAVITY_M_S2)}
    for unit, factor in (_FORCE_UNITS | percent).items():
        if _near(ratio, factor):
            yield finding("P202", where, unit=Quantity(unit), ratio=Quantity(ratio, "1"))
    by_plate: dict[str, float] = {}
    for trial in context.trials:
        by_plate |= trial.whole_plate_masses if occasion.trial in (None, trial.name) else {}
    causes, action = _causes(occasion, total.total_kg, by_plate, witnesses)
    heavier = occasion.mass_kg > total.total_kg
    limit = total.total_kg + (1.0 if heavier else -1.0) * occasion.allowed_kg(total, WARNING_SHARE)
    evidence = {
        "mass_by_force_kg": Quantity(occasion.mass_kg, "kg", limit=limit, sd=occasion.sd_kg),
        "stated_kg": Quantity(total.total_kg, "kg", sd=total.sd_kg),
        "attached_kg": Quantity(total.total_kg - total.body_kg, "kg"),
        "agreeing": Quantity(_agreeing(occasion, total.total_kg, by_plate, witnesses), "1"),
        "method": Quantity(f"marker-based centre of mass over {occasion.over}"),
        "action": Quantity(action),
    }
    if stated_kg is not None and any(words in action for words in _MASS_ACTIONS):
        evidence["mass_kg"] = Quantity(stated_kg + occasion.mass_kg - total.total_kg, "kg", sd=occasion.sd_kg)
    for standing in [witness for witness in witnesses if witness.standing][:1]:
        evidence["static_kg"] = Quantity(standing.mass_kg, "kg", sd=standing.sd_kg)
    if len(by_plate) > 1:
        evidence["plates_kg"] = Quantity(tuple(by_plate.values()), "kg")
    severity = Severity.ERROR if occasion.differs(total, occasion.error_share) else Severity.WARNING
    yield finding("S111", where, severity, causes, **evidence)


def _agreeing(
    occasion: _Occasion, stated_kg: float, by_plate: Mapping[str, float], witnesses: Sequence[_Occasion]
) -> int:
    """Count occasions that agree, or plates that agree on a single occasion that no other contradicts."""
    if occasion.count > 1 or not by_plate:
        return occasion.count
    alike = max(by_plate.values()) <= (1.0 + _SAME) * min(by_plate.values())
    against = any(abs(witness.mass_kg - stated_kg) < abs(witness.mass_kg - occasion.mass_kg) for witness in witnesses)
    return len(by_plate) if alike and not against else 1


def _causes(
    occasion: _Occasion, stated_kg: float, by_plate: Mapping[str, float], witnesses: Sequence[_Occasion]
) -> tuple[tuple[str, ...], str]:
    """Return the causes, likeliest first, and the remedy for the first."""
    heavier = occasion.mass_kg > stated_kg
    second_cause = _LOAD if heavier else _SUPPORT
    if _near(occasion.mass_kg / stated_kg, 1.0 / _POUND):
        return (_STATED_OVER_POUND, _STATED), "Give the mass in kg"
    light, *_, heavy = sorted(by_plate, key=by_plate.__getitem__) if len(by_plate) > 1 else ("", "")
    if light and by_plate[heavy] > (1.0 + _SAME) * by_plate[light]:
        plate, right = (heavy, light) if heavier else (light, heavy)
        if abs(by_plate[right] / stated_kg - 1.0) <= _SAME:
            return (f"gain or zero of {plate}", second_cause, _STATED), f"Check {plate} with a known weight"
    nearer = [abs(witness.mass_kg - occasion.mass_kg) < abs(witness.mass_kg - stated_kg) for witness in witnesses]
    if nearer and 2 * sum(nearer) < len(nearer):
        action = "Check the plates with a known weight, unless something was carried"
        return (_PLATES, second_cause), action if heavier else "Check the plates with a known weight"
    if not nearer and len(by_plate) < 2:
        if heavier and occasion.mass_kg - stated_kg > _LOAD_KG:
            return (
                second_cause,
                _STATED,
                _PLATES,
            ), "Declare what was worn or carried as [[attached]], or correct the mass"
        return (_STATED, _PLATES, second_cause), "Check the mass, and gain and zero of the plates"
    carried = ", or declare what was worn or carried as [[attached]]" if heavier else ""
    return (_STATED, second_cause, _PLATES), f"Correct the mass{carried}"


def _near(ratio: float, wanted: float) -> bool:
    return abs(ratio / wanted - 1.0) <= _UNIT_OFF
