"""Lists the questions about a person: the static trial alone, and all recordings together."""

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.person_context import PersonContext
from kinertia.diagnostics.plates.plate_height import plate_heights
from kinertia.diagnostics.runner import Question
from kinertia.diagnostics.subject.body_data import absent_markers, population, stated_and_filed, stature
from kinertia.diagnostics.subject.camera_scale import trial_scales
from kinertia.diagnostics.subject.mass import masses_of_trials, stated_mass
from kinertia.diagnostics.subject.movements import informative_movements
from kinertia.diagnostics.subject.repeated_trials import repeated_trials
from kinertia.diagnostics.subject.same_person import static_and_trials, trials_of_one_person
from kinertia.diagnostics.subject.stance_coverage import stance_coverage
from kinertia.diagnostics.subject.standing import flat_feet, floor, no_static, standing

STATIC_QUESTIONS: tuple[Question[RecordingContext], ...] = (
    Question("S20", standing),
    Question("S20", flat_feet),
    Question("S10", stature),
)
PERSON_QUESTIONS: tuple[Question[PersonContext], ...] = (
    Question("S10", stated_and_filed),
    Question("M10", absent_markers),
    Question("S20", no_static),
    Question("M14", floor),
    Question("P24", plate_heights, unless=("M143",)),
    Question("S20", static_and_trials),
    Question("S30", trials_of_one_person),
    Question("S20", trial_scales),
    Question("S30", repeated_trials),
    Question("S11", stated_mass),
    Question("S30", masses_of_trials),
    Question("S31", informative_movements),
    Question("S40", population),
    Question("P27", stance_coverage),
)
