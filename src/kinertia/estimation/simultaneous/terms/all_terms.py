"""Lists the cost terms of the simultaneous estimate. A new unknown is a new term."""

from kinertia.estimation.simultaneous.terms.bsp_term import BodySegments
from kinertia.estimation.simultaneous.terms.cost_term import CostTerm
from kinertia.estimation.simultaneous.terms.instrument_term import InstrumentErrors
from kinertia.estimation.simultaneous.terms.marker_positions import MarkerPlaces
from kinertia.estimation.simultaneous.terms.marker_terms import Markers
from kinertia.estimation.simultaneous.terms.missing_loads import MissingLoads
from kinertia.estimation.simultaneous.terms.range_terms import JointRanges
from kinertia.estimation.simultaneous.terms.root_loads import RootLoads
from kinertia.estimation.simultaneous.terms.skin_term import Skin
from kinertia.estimation.simultaneous.terms.start_terms import Start
from kinertia.estimation.simultaneous.terms.static_coordinates import StaticCoordinates
from kinertia.estimation.simultaneous.terms.task_masses import TaskMasses
from kinertia.estimation.simultaneous.terms.trunk_bending import TrunkBending

TERMS: tuple[type[CostTerm], ...] = (
    StaticCoordinates,
    InstrumentErrors,
    MissingLoads,
    TrunkBending,
    MarkerPlaces,
    Skin,
    BodySegments,
    TaskMasses,
    Markers,
    JointRanges,
    Start,
    RootLoads,
)
"""In the order in which their entries are shown. The last takes about as long as all others together, so that two
threads can share the work of short trials.
"""
