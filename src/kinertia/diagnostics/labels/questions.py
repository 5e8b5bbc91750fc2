"""Lists the questions about the labels of one recording."""

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.labels.anatomy import anatomy, direction_of_travel, heading
from kinertia.diagnostics.labels.landmarks import landmarks
from kinertia.diagnostics.labels.marker_set_match import labels_match
from kinertia.diagnostics.labels.segment_rigidity import rigidity
from kinertia.diagnostics.labels.swapped_markers import label_swaps
from kinertia.diagnostics.runner import Question

_AXES = ("M141", "M142")
"""Without a vertical and a unit of length, nothing is above or beside anything."""

_BOTH: tuple[Question[RecordingContext], ...] = (
    Question("L10", labels_match),
    Question("L10", heading),
    Question("L20", anatomy, unless=_AXES),
)
STATIC_QUESTIONS: tuple[Question[RecordingContext], ...] = (*_BOTH, Question("L10", landmarks, unless=("L106", "M104")))
MOTION_QUESTIONS: tuple[Question[RecordingContext], ...] = (
    *_BOTH,
    Question("S31", direction_of_travel, unless=(*_AXES, "L20")),
    Question("L21", label_swaps, unless=("M141", "M123")),
    Question("L21", rigidity, unless=("M141",)),
)
