"""Tabulates a model's masses and inertias, by segment next to the literature."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kinertia.estimation.prior import literature_prior
from kinertia.findings.quantity import Limit
from kinertia.model.anatomy import ModelSegments, model_segments
from kinertia.model.anthropometry import BodyGeometry, check_subject, literature_bsp
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton

SIDE_MASS, SIDE_COM_M, SIDE_MOMENT = Limit(0.01), Limit(0.005, "m"), Limit(0.05)
"""Notable differences of left and right: share of the mass, distance of the CoM, share of a moment."""
_COLUMNS = ("mass\n(kg)", "CoM x\n(mm)", "y", "z", "Ixx\n(kg m2)", "Iyy", "Izz")


@dataclass(frozen=True, eq=False)
class ModelCheck:
    """Mass properties of one model, next to the anthropometric tables.

    Attributes:
        name: name of the model.
        bsp: body segment parameters as in the file.
        segments: the bodies combined by segment, in ISB axes.
        literature: "de Leva" and "Dumas" for the same segments; empty where the person is not known. Values that the
            tables cannot give for this model are NaN.
        spread: (10,) SD of people from the tables, by segment; empty where `literature` is.
        symmetric: whether left mirrors right.

    Examples:
        >>> subject = kinertia.walking_subject()
        >>> check = kinertia.check_model(subject.skeleton, subject.literature, 72.6, 1.803, "male")
        >>> tuple(check.literature)
        ('de Leva', 'Dumas')
    """

    name: str
    bsp: BodySegmentParameters
    segments: ModelSegments
    literature: Mapping[str, Mapping[str, np.ndarray]]
    spread: Mapping[str, np.ndarray]
    symmetric: bool

    @property
    def has_arms(self) -> bool:
        """Whether both arms are bodies of their own."""
        return _has_arms(self.segments)

    def facts(self) -> list[tuple[str, str]]:
        """Return descriptions of the model as pairs of a name and a sentence."""
        massless = [name for name, mass in zip(self.bsp.segments, self.bsp.mass_kg, strict=True) if mass == 0]
        facts = [
            ("model", self.name),
            ("bodies", f"{len(self.bsp.segments)}, total mass {self.bsp.total_mass_kg:.2f} kg"),
        ]
        if massless:
            facts.append(("without mass", ", ".join(massless)))
        joined = [f"{name}: {' + '.join(bodies)}" for name, bodies in self.segments.bodies.items() if len(bodies) > 1]
        return [*facts, *([("combined", "; ".join(joined))] if joined and self.literature else [])]

    @property
    def columns(self) -> tuple[str, ...]:
        """Column headings of `rows`."""
        return ("segment" if self.literature else "body", "", *_COLUMNS)

    def rows(self) -> list[tuple[str, ...]]:
        """Tabulate every segment next to the literature in ISB axes, or every body as in the file; "-" is unknown.

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
    """Compare the mass properties of a model with the anthropometric tables.

    Args:
        skeleton, bsp: all bodies of the model.
        mass_kg: as stated; the model's own total is taken for the literature if None.
        height_m, sex: stature and sex of the person; without both there is no comparison with the literature.

    Raises:
        SubjectError: mass, height or sex cannot be true.
    """
    check_subject(70.0 if mass_kg is None else mass_kg, 1.7 if height_m is None else height_m, sex or "male")
    segments = model_segments(skeleton, bsp, height_m or 1.7, sex or "male")
    literature: dict[str, dict[str, np.ndarray]] = {}
    spread: dict[str, np.ndarray] = {}
    if height_m is not None and sex is not None and segments.geometry is not None:
        person_kg = bsp.total_mass_kg if mass_kg is None else mass_kg
        literature, spread = _literature(segments, segments.geometry, person_kg, height_m, sex)
    return ModelCheck(skeleton.name, bsp, segments, literature, spread, not side_differences(bsp))


class SideDifference(NamedTuple):
    """Deviation of a right body from the left one's mirror image: share of the mass, distance of the CoM, and the
    largest share of a moment of inertia.
    """

    body: str
    mass_share: float
    com_m: float
    moment_share: float


def side_differences(bsp: BodySegmentParameters) -> list[SideDifference]:
    """List pairs of bodies that do not mirror each other."""
    table, other = bsp.table(), bsp.mirrored().table()
    found = []
    for i, name in enumerate(bsp.segments):
        if not name.endswith("_r") or f"{name[:-2]}_l" not in bsp.segments:
            continue
        mean = np.maximum((np.abs(table[i]) + np.abs(other[i])) / 2, 1e-12)
        change = np.abs(table[i] - other[i])
        com_m, moment = float(np.linalg.norm(change[1:4])), float((change[4:7] / mean[4:7]).max())
        difference = SideDifference(name[:-2], float(change[0] / mean[0]), com_m, moment)
        if difference.mass_share > SIDE_MASS or difference.com_m > SIDE_COM_M or difference.moment_share > SIDE_MOMENT:
            found.append(difference)
    return found


def _has_arms(segments: ModelSegments) -> bool:
    return {"upper_arm_r", "upper_arm_l"} <= set(segments.bodies)


def _cells(row: np.ndarray) -> tuple[str, ...]:
    """Format mass, CoM (mm) and moments of one row of the table of body segment parameters."""
    com = (f"{round(value * 1e3)}" if np.isfinite(value) else "-" for value in row[1:4])
    texts = [f"{row[0]:.2f}", *com, *map(_moment, row[4:7])]
    return tuple("-" if np.isnan(value) else text for text, value in zip(texts, row, strict=False))


def _moment(value: float) -> str:
    """Format a moment of inertia (kg m2), small bodies' with two digits."""
    return f"{value:.4f}" if abs(value) >= 1e-3 else f"{value:.2g}"


def _literature(
    segments: ModelSegments, geometry: BodyGeometry, mass_kg: float, height_m: float, sex: str
) -> tuple[dict[str, dict[str, np.ndarray]], dict[str, np.ndarray]]:
    """Return rows of the tables by source and segment, and the SD of people from them by segment."""
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
