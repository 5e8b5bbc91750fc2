"""Lists the questions of timing: belt and events of one recording, forces of several."""

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.person_context import PersonContext
from kinertia.diagnostics.runner import Question
from kinertia.diagnostics.timing.belt_speed import belt_speed
from kinertia.diagnostics.timing.delays import trial_delays
from kinertia.diagnostics.timing.file_events import file_events
from kinertia.diagnostics.timing.interchanged_forces import interchanged_forces

QUESTIONS: tuple[Question[RecordingContext], ...] = (Question("T30", belt_speed), Question("T31", file_events))
"""Rates and delays compete with positions of plates: `diagnostics.plates.questions`."""

PERSON_QUESTIONS: tuple[Question[PersonContext], ...] = (
    Question("S30", interchanged_forces),
    Question("T21", trial_delays),
)
