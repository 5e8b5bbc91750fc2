"""Lists the questions of where loads act and when: plates, rates and delays compete as explanations."""

from __future__ import annotations

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.plates.cop_on_plate import cop_on_plate
from kinertia.diagnostics.plates.cop_positions import loads_and_feet
from kinertia.diagnostics.plates.cop_progression import cop_progression
from kinertia.diagnostics.plates.ground_contact import both_feet, complete_contact, plate_edges
from kinertia.diagnostics.runner import Question

_NOT_UNDER_FEET = ("P201", "P202", "P203", "P204", "P24", "T20", "T21")
"""ERRORs after which it is not known where on a foot a load acts."""

PLACE_QUESTIONS: tuple[Question[RecordingContext], ...] = (
    Question("P24", loads_and_feet, unless=("P201", "P202", "P203", "P107")),
    Question("P24", cop_on_plate, unless=("P204",)),
    Question("P25", cop_progression, unless=_NOT_UNDER_FEET),
    Question("P28", plate_edges, unless=_NOT_UNDER_FEET),
    Question("P27", both_feet, unless=_NOT_UNDER_FEET),
    Question("P27", complete_contact),
)
