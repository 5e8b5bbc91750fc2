"""Lists the questions about the markers of one recording."""

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.markers.axes_and_floor import floor_slope, unit_and_vertical
from kinertia.diagnostics.markers.computed_markers import computed_markers
from kinertia.diagnostics.markers.frames import frames
from kinertia.diagnostics.markers.trajectories import precision, trajectories, visible
from kinertia.diagnostics.runner import Question

_SIZE = "M141"
"""In another unit of length no limit in metres means anything."""
_MADE_UP = "M123"
"""Where frames were interpolated, steps from frame to frame mean nothing."""

STATIC_QUESTIONS: tuple[Question[RecordingContext], ...] = (
    Question("M10", visible),
    Question("M14", unit_and_vertical),
    Question("M11", trajectories, unless=(_SIZE,)),
)
MOTION_QUESTIONS: tuple[Question[RecordingContext], ...] = (
    Question("M10", visible),
    Question("M14", unit_and_vertical),
    Question("M12", frames, unless=(_SIZE,)),
    Question("M13", precision, unless=(_SIZE, _MADE_UP)),
    Question("M11", trajectories, unless=(_SIZE, _MADE_UP)),
    Question("M14", floor_slope, unless=("M14",)),
    Question("M15", computed_markers, unless=(_SIZE,)),
)
