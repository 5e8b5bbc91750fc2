"""Are a model's masses and inertias those of a person? Findings and verdicts in words, against the literature."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from kinertia.diagnostics.model.density import HEAVY_KG, points
from kinertia.diagnostics.model.mirrored_joints import mirrored_joints_doubts
from kinertia.diagnostics.model.model_doubts import model_doubts
from kinertia.diagnostics.model.person_size import size_trouble
from kinertia.diagnostics.result.verdict import Verdict
from kinertia.diagnostics.result.warnings import FORCE_MASS_TOLERANCE
from kinertia.diagnostics.subject.force_mass import CONTRADICTING_MASS
from kinertia.estimation.prior import literature_prior
from kinertia.model.anatomy import ModelSegments, model_segments
from kinertia.model.anthropometry import BodyGeometry, check_subject, literature_bsp
from kinertia.model.bsp import PARAMETERS, BodySegmentParameters, impossible_segments
from kinertia.model.skeleton import Skeleton

ARMS_IN_TORSO = 0.42
"""Torso's moment about its long axis over the mean of the other two: 0.25-0.32 in the literature for the torso with the
head, 0.5 where the arms hang beside it and are counted in (gait2354, whose torso the models with arms took over)."""
LARGEST_RADIUS_M = 0.6
"""No part of a person has a larger radius of gyration (a rod of 2 m has 0.58 m)."""
_NEGLIGIBLE_KG = 0.1
_OUTLYING_SD = 2.0
_SIDE_MASS, _SIDE_COM_M, _SIDE_MOMENT = 0.01, 0.005, 0.05
"""Left and right differ worth a look: share of the mass, distance of the CoM, share of a moment."""
_COLUMNS = ("mass\n(kg)", "CoM x\n(mm)", "y", "z", "Ixx\n(kg m2)", "Iyy", "Izz")


@dataclass(frozen=True, eq=False)
class ModelCheck:
    """Findings about one model.

    Attributes:
        name: the model's.
        bsp: of its bodies, as the file has them.
        segments: the bodies combined by segment, in ISB axes.
        literature: "de Leva" and "Dumas" for the same segments; empty where the person is not known. Values that the
            tables cannot give for this model are NaN.
        symmetric: whether left mirrors right.
        verdicts: whether one can simulate with this model.
        left_out: checks that were not made, and why; one sentence each.

    Examples:
        >>> subject = kinertia.walking_subject()
        >>> check = kinertia.check_model(subject.skeleton, subject.literature, 72.6, 1.803, "male")
        >>> any(verdict.level == "fail" for verdict in check.verdicts)
        False
    """

    name: str
    bsp: BodySegmentParameters
    segments: ModelSegments
    literature: Mapping[str, Mapping[str, np.ndarray]]
    symmetric: bool
    verdicts: tuple[Verdict, ...]
    left_out: tuple[str, ...]

    def facts(self) -> list[tuple[str, str]]:
        """What the model is, as pairs of a name and a sentence."""
        massless = [name for name, mass in zip(self.bsp.segments, self.bsp.mass_kg, strict=True) if mass == 0]
        facts = [
            ("model", self.name),
            ("bodies", f"{len(self.bsp.segments)}, total mass {self.bsp.total_mass_kg:.2f} kg"),
        ]
        if massless:
            facts.append(("without mass", ", ".join(massless)))
        joined = [f"{name}: {' + '.join(own)}" for name, own in self.segments.bodies.items() if len(own) > 1]
        return [*facts, *([("combined", "; ".join(joined))] if joined and self.literature else [])]

    @property
    def columns(self) -> tuple[str, ...]:
        """Headings of `rows`."""
        return ("segment" if self.literature else "body", "", *_COLUMNS)

    def rows(self) -> list[tuple[str, ...]]:
        """Every segment next to the literature in ISB axes, or every body as in the file; a "-" is unknown.

        Where left mirrors right, the right segments stand for both.
        """
        if not self.literature:
            return [(name, "", *_cells(row)) for name, row in zip(self.bsp.segments, self.bsp.table(), strict=True)]
        rows = []
        for name, row in zip(self.segments.bsp.segments, self.segments.bsp.table(), strict=True):
            if self.symmetric and name.endswith("_l"):
                continue
            rows.append((name, "model", *_cells(row)))
            rows += [("", source, *_cells(table[name])) for source, table in self.literature.items()]
        return rows


def check_model(
    skeleton: Skeleton,
    bsp: BodySegmentParameters,
    mass_kg: float | None = None,
    height_m: float | None = None,
    sex: str | None = None,
) -> ModelCheck:
    """Look at the mass properties of a model.

    Args:
        skeleton, bsp: of the model; all bodies.
        mass_kg: by the scale; the model's own total is taken for the literature if None.
        height_m, sex: of the person; without both there is no comparison with the literature.

    Raises:
        SubjectError: mass, height or sex cannot be true.
    """
    total = bsp.total_mass_kg
    check_subject(70.0 if mass_kg is None else mass_kg, 1.7 if height_m is None else height_m, sex or "male")
    segments = model_segments(skeleton, bsp, height_m or 1.7, sex or "male")
    literature: dict[str, dict[str, np.ndarray]] = {}
    left_out, outliers = [], []
    wanted = [option for option, value in (("--height", height_m), ("--sex", sex)) if value is None]
    if height_m is None or sex is None:
        left_out.append(f"no comparison with the literature; it needs {' and '.join(wanted)}")
    elif segments.geometry is None:
        left_out.append(
            "no comparison with the literature; a joint of trunk or legs was not found by the bodies' names"
        )
    else:
        person_kg = total if mass_kg is None else mass_kg
        literature, sd = _literature(segments, segments.geometry, person_kg, height_m, sex)
        outliers = _outliers(segments.bsp, literature, sd)
        if not _has_arms(segments):
            left_out.append("the model has no arms: only the mass of its torso was compared, with torso and arms")
    if mass_kg is None:
        left_out.append("the total mass was not compared; give --mass")
    if segments.unknown:
        left_out.append(f"bodies of unknown segment, not compared: {', '.join(segments.unknown)}")
    odd = _sides(bsp)
    verdicts = [
        *_person_size(skeleton, bsp),
        *_possible(bsp),
        *_sizes(bsp),
        *_without_inertia(bsp),
        *_doubts(skeleton, bsp),
        *_total(total, mass_kg),
        *_placeholders(bsp),
        _symmetry(odd, bool(mirrored_joints_doubts(skeleton))),
        *_arms_in_torso(segments),
        *outliers,
        *_markers(skeleton),
    ]
    return ModelCheck(skeleton.name, bsp, segments, literature, not odd, tuple(verdicts), tuple(left_out))


def check_model_of_subject(skeleton: Skeleton, bsp: BodySegmentParameters) -> ModelCheck | None:
    """What a fit with this model would warn of, for a check of all that a subject file names; None if nothing is."""
    doubts = [*_person_size(skeleton, bsp), *_doubts(skeleton, bsp)]
    if not doubts:
        return None
    whole = check_model(skeleton, bsp)
    return replace(whole, verdicts=tuple(doubts), left_out=("masses and inertias; give the model to kinertia check",))


def _person_size(skeleton: Skeleton, bsp: BodySegmentParameters) -> list[Verdict]:
    trouble = size_trouble(skeleton, bsp)
    return [Verdict("fail", trouble)] if trouble else []


def _doubts(skeleton: Skeleton, bsp: BodySegmentParameters) -> list[Verdict]:
    return [Verdict("caution", sentence) for sentence in model_doubts(skeleton, bsp)]


def _markers(skeleton: Skeleton) -> list[Verdict]:
    """A fit needs the model's markers, a simulation does not."""
    if skeleton.markers:
        return []
    advice = "kinertia fit refuses it; scale the model with OpenSim's Scale tool, which places them"
    return [Verdict("caution", f"no markers in the model: {advice}")]


def _has_arms(segments: ModelSegments) -> bool:
    return {"upper_arm_r", "upper_arm_l"} <= set(segments.bodies)


def _cells(row: np.ndarray) -> tuple[str, ...]:
    """Mass, CoM (mm) and moments of a row of the table of body segment parameters."""
    com = (f"{round(value * 1e3)}" if np.isfinite(value) else "-" for value in row[1:4])
    texts = [f"{row[0]:.2f}", *com, *map(_moment, row[4:7])]
    return tuple("-" if np.isnan(value) else text for text, value in zip(texts, row, strict=False))


def _moment(value: float) -> str:
    """A moment of inertia (kg m2), those of small bodies to two digits."""
    return f"{value:.4f}" if abs(value) >= 1e-3 else f"{value:.2g}"


def _literature(
    segments: ModelSegments, geometry: BodyGeometry, mass_kg: float, height_m: float, sex: str
) -> tuple[dict[str, dict[str, np.ndarray]], dict[str, np.ndarray]]:
    """Rows of the tables by source and segment, and the deviation of people from them by segment."""
    by_source = {}
    for source, name in (("deleva", "de Leva"), ("dumas", "Dumas")):
        bsp = literature_bsp(mass_kg, height_m, sex, geometry, source)
        table = dict(zip(bsp.segments, bsp.table(), strict=True))
        arms = [row for segment, row in table.items() if segment[:-2] in ("upper_arm", "forearm")]
        if not _has_arms(segments):
            # the tables do not say where the arms hang, so only their mass can be counted in
            torso = np.full(10, np.nan)
            torso[0] = table["torso"][0] + sum(row[0] for row in arms)
            table["torso"] = torso
        by_source[name] = {segment: table[segment] for segment in segments.bsp.segments}
    sd = literature_prior(bsp).sd
    return by_source, dict(zip(bsp.segments, sd, strict=True))


def _outliers(
    bsp: BodySegmentParameters, literature: Mapping[str, Mapping[str, np.ndarray]], sd: Mapping[str, np.ndarray]
) -> list[Verdict]:
    """Mass, CoM and moments farther from both tables than people are."""
    segments: dict[str, list[str]] = {}
    for name, row in zip(bsp.segments, bsp.table(), strict=True):
        tables = np.array([table[name] for table in literature.values()])
        low, high = tables.min(axis=0), tables.max(axis=0)
        beyond = np.maximum(low - row, row - high) / sd[name]
        far = [k for k in range(7) if beyond[k] > _OUTLYING_SD]  # NaN is not
        if far:
            departures = ", ".join(_against_literature(k, row[k], low[k], high[k]) for k in far)
            segments.setdefault(departures, []).append(name)
    return [
        Verdict("caution", f"unlike the literature: {', '.join(names)}: {departures}")
        for departures, names in segments.items()
    ] or [Verdict("pass", f"every segment is within {_OUTLYING_SD:g} SDs of the literature")]


def _against_literature(k: int, value: float, low: float, high: float) -> str:
    name = PARAMETERS[k]
    if name == "mass":
        unit, texts = "kg", [f"{one:.2f}" for one in (value, low, high)]
    elif name.startswith("com"):
        unit, texts = "mm", [f"{one * 1e3:.0f}" for one in (value, low, high)]
    else:
        unit, texts = "kg m2", [_moment(one) for one in (value, low, high)]
    return f"{name} {texts[0]} {unit} (literature {texts[1]} to {texts[2]})"


def _possible(bsp: BodySegmentParameters) -> list[Verdict]:
    impossible = impossible_segments(bsp)
    verdicts = [
        Verdict("fail", f"physically impossible: {sentence.rstrip('.')}")
        for sentence in bsp.inconsistencies()
        if sentence.split(": ", 1)[0] in impossible
    ]
    without = [name for name in points(bsp) if name not in impossible]
    if not verdicts and not without:
        verdicts.append(Verdict("pass", "every body is physically possible"))
    at_fault = ~bsp.physically_consistent() & (bsp.mass_kg > 0)
    thin = [bsp.segments[i] for i in np.flatnonzero(at_fault) if bsp.segments[i] not in (*impossible, *without)]
    if thin:
        verdicts.append(
            Verdict(
                "caution",
                f"without thickness (two moments of inertia add up to the third exactly): {', '.join(thin)}; rounded "
                f"inertias do that",
            )
        )
    return verdicts


def _sizes(bsp: BodySegmentParameters) -> list[Verdict]:
    """Bodies that would have to be larger than a person, as with inertias of 1."""
    verdicts = []
    for name, mass, inertia in zip(bsp.segments, bsp.mass_kg, bsp.inertia_kgm2, strict=True):
        radius = np.sqrt(inertia.diagonal().max() / mass) if mass > 0 else 0.0
        if radius > LARGEST_RADIUS_M:
            body = f"{name}: {mass:g} kg with moments of inertia up to {inertia.diagonal().max():g} kg m2"
            verdicts.append(
                Verdict(
                    "fail" if mass >= _NEGLIGIBLE_KG else "caution",
                    f"{body} would have to be {2 * radius:.1f} m wide or long; the inertia is a placeholder or in "
                    f"another unit",
                )
            )
    return verdicts


def _without_inertia(bsp: BodySegmentParameters) -> list[Verdict]:
    """Bodies whose whole mass would have to be in a point."""
    verdicts: list[Verdict] = []
    impossible, masses = impossible_segments(bsp), dict(zip(bsp.segments, bsp.mass_kg.tolist(), strict=True))
    without = [name for name in points(bsp) if name not in impossible]
    heavy = [name for name in without if masses[name] >= HEAVY_KG]
    light = [name for name in without if masses[name] < HEAVY_KG]
    if heavy:
        advice = "their inertias were left out: give them (kg m2); kinertia fit refuses such a model"
        verdicts.append(Verdict("fail", f"mass without any moment of inertia: {', '.join(heavy)}; {advice}"))
    if light:
        verdicts.append(Verdict("caution", f"mass without any moment of inertia: {', '.join(light)}; light bodies"))
    return verdicts


def _total(total_kg: float, mass_kg: float | None) -> list[Verdict]:
    if mass_kg is None:
        return []
    off = total_kg / mass_kg - 1
    sentence = f"the bodies weigh {total_kg:.1f} kg together, the person {mass_kg:.1f} kg ({100 * off:+.1f} %)"
    if abs(off) <= FORCE_MASS_TOLERANCE:
        return [Verdict("pass", sentence)]
    return [Verdict("fail" if abs(off) > CONTRADICTING_MASS else "caution", f"{sentence}; scale the model's masses")]


def _placeholders(bsp: BodySegmentParameters) -> list[Verdict]:
    """Inertias that nobody measured: three equal moments, or moments of at most two digits."""
    equal, rounded = [], []
    for name, mass, inertia in zip(bsp.segments, bsp.mass_kg, bsp.inertia_kgm2, strict=True):
        moments = inertia.diagonal()
        if not mass > 0 or not moments.any():
            continue
        if np.ptp(moments) <= 1e-6 * moments.max():
            equal.append(f"{name} ({moments[0]:.3g} kg m2)")
        elif all(float(f"{value:.1e}") == value for value in moments):
            rounded.append(name)
    verdicts = []
    if equal:
        verdicts.append(Verdict("caution", f"three equal moments of inertia, as placeholders have: {', '.join(equal)}"))
    if rounded:
        verdicts.append(Verdict("caution", f"moments of inertia rounded to two digits or less: {', '.join(rounded)}"))
    return verdicts


def _symmetry(odd: list[str], joints_differ: bool) -> Verdict:
    if odd:
        return Verdict("caution", f"left and right differ: {'; '.join(odd)}")
    of_what = "masses and inertias of " if joints_differ else ""
    return Verdict("pass", f"{of_what}left and right mirror each other")


def _sides(bsp: BodySegmentParameters) -> list[str]:
    """Pairs of bodies that do not mirror each other, and in what."""
    table, other = bsp.table(), bsp.mirrored().table()
    odd = []
    for i, name in enumerate(bsp.segments):
        if not name.endswith("_r") or f"{name[:-2]}_l" not in bsp.segments:
            continue
        mean = (np.abs(table[i]) + np.abs(other[i])) / 2
        change = np.abs(table[i] - other[i])
        differences = []
        if change[0] > _SIDE_MASS * mean[0]:
            differences.append(f"mass by {100 * change[0] / mean[0]:.0f} %")
        if (distance := float(np.linalg.norm(change[1:4]))) > _SIDE_COM_M:
            differences.append(f"centre of mass by {distance * 1e3:.0f} mm")
        if (change[4:7] > _SIDE_MOMENT * mean[4:7]).any():
            differences.append(
                f"a moment of inertia by {100 * (change[4:7] / np.maximum(mean[4:7], 1e-12)).max():.0f} %"
            )
        if differences:
            odd.append(f"{name[:-2]} ({', '.join(differences)})")
    return odd


def _arms_in_torso(segments: ModelSegments) -> list[Verdict]:
    """A torso with the arms' inertia in a model whose arms are bodies of their own."""
    if not _has_arms(segments) or "torso" not in segments.bodies:
        return []
    moments = segments.bsp.inertia_kgm2[segments.bsp.segments.index("torso")].diagonal()
    others = moments[[0, 2]].mean()
    ratio = moments[1] / others if others > 0 else 0.0
    if ratio <= ARMS_IN_TORSO:
        return []
    return [
        Verdict(
            "caution",
            f"the torso still seems to include the arms' inertia, although the arms are separate bodies: its moment "
            f"about the long axis is {100 * ratio:.0f} % of the other two (literature: 25 to 32 %); a known problem "
            f"of the models of Hamner (2010) and Rajagopal (2016)",
        )
    ]
