"""Lists the cost terms of the simultaneous estimate. A new unknown is a new term."""

from kinertia.estimation.simultaneous.terms.cost_term import CostTerm
from kinertia.estimation.simultaneous.terms.instrument_term import InstrumentErrors, MissingLoads
from kinertia.estimation.simultaneous.terms.marker_terms import Markers
from kinertia.estimation.simultaneous.terms.model_terms import (
    BodySegments,
    MarkerPositions,
    Skin,
    StaticCoordinates,
    TaskMasses,
)
from kinertia.estimation.simultaneous.terms.motion_terms import JointRanges, Start
from kinertia.estimation.simultaneous.terms.root_loads import RootLoads, TrunkBending

TERMS: tuple[type[CostTerm], ...] = (
    StaticCoordinates,
    InstrumentErrors,
    MissingLoads,
    TrunkBending,
    MarkerPositions,
    Skin,
    BodySegments,
    TaskMasses,
    Markers,
    JointRanges,
    Start,
    RootLoads,
)
"""Sorted by their `order`. The last takes about as long as all others together, so that two threads can share the work
of short trials.
"""
