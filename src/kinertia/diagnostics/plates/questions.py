"""Lists the questions about plates: their signals, the loads sorted by foot, and where loads act and when.

Plates, rates and delays compete as explanations.
"""

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.markers.over_smoothed import over_smoothed
from kinertia.diagnostics.plates.axes_and_units import axes_and_units
from kinertia.diagnostics.plates.cop_path import cop_on_plate, cop_progression
from kinertia.diagnostics.plates.cop_positions import loads_and_feet
from kinertia.diagnostics.plates.force_directions import force_directions, vertical_signs
from kinertia.diagnostics.plates.free_moments import free_moments, vertical_moment
from kinertia.diagnostics.plates.gains import gains
from kinertia.diagnostics.plates.ground_contact import (
    both_feet,
    complete_contact,
    foreign_load,
    plate_edges,
    stray_loads,
)
from kinertia.diagnostics.plates.repeated_plates import repeated_plates
from kinertia.diagnostics.plates.signals import dead_moments, mains_interference, quantisation, signals, spikes
from kinertia.diagnostics.plates.zeros import unloaded_levels, zeros, zeros_under_load
from kinertia.diagnostics.runner import Question
from kinertia.diagnostics.timing.delays import plate_delay
from kinertia.diagnostics.timing.force_rate import force_rate

_NOT_UNDER_FEET = ("P201", "P202", "P203", "P204", "P24", "T20", "T21")
"""ERRORs after which it is not known where on a foot a load acts."""

PLACE_QUESTIONS: tuple[Question[RecordingContext], ...] = (
    Question("P24", loads_and_feet, unless=("P201", "P202", "P203", "P107")),
    Question("P24", cop_on_plate, unless=("P204",)),
    Question("P25", cop_progression, unless=_NOT_UNDER_FEET),
    Question("P28", plate_edges, unless=_NOT_UNDER_FEET),
    Question("P28", stray_loads),
    Question("P28", foreign_load, unless=("P201", "P202", "P203", "P204")),
    Question("P27", both_feet, unless=_NOT_UNDER_FEET),
    Question("P27", complete_contact),
)
_OTHER_AXES = ("P201",)
"""ERROR after which there is no vertical force to judge by."""
_NO_VELOCITY = ("L20", "M12", "M14", "P10", "P11", "P20", "P24", "T201", "T211", "T212")
"""ERRORs after which markers, forces or their times do not belong to one moving body."""

SIGNAL_QUESTIONS: tuple[Question[RecordingContext], ...] = (
    Question("P20", axes_and_units),
    Question("P28", repeated_plates),
    Question("P10", signals, unless=_OTHER_AXES),
    Question("P11", dead_moments, unless=_OTHER_AXES),
    Question("P10", quantisation, unless=_OTHER_AXES),
    Question("P10", mains_interference, unless=_OTHER_AXES),
    Question("P21", zeros, unless=_OTHER_AXES),
    Question("P26", free_moments, unless=_OTHER_AXES),
    Question("P23", vertical_signs, unless=_OTHER_AXES),
)
STANDING_QUESTIONS: tuple[Question[RecordingContext], ...] = (Question("P10", spikes), Question("P21", unloaded_levels))
LOADED_QUESTIONS: tuple[Question[RecordingContext], ...] = (
    Question("M13", over_smoothed, unless=_NO_VELOCITY),
    Question("T20", force_rate, unless=_NO_VELOCITY),
    Question("T21", plate_delay, unless=_NO_VELOCITY),
    Question("P23", force_directions, unless=_NO_VELOCITY),
    Question("P22", gains, unless=_NO_VELOCITY),
    Question("P21", zeros_under_load, unless=_NO_VELOCITY),
    Question("P26", vertical_moment, unless=_NO_VELOCITY),
)
