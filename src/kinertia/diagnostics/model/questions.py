"""Lists the questions about OpenSim models, alone or with the trials of a person."""

from kinertia.diagnostics.model.joint_frames import mirrored_joints, subtalar_axis
from kinertia.diagnostics.model.length_unit import length_unit
from kinertia.diagnostics.model.mass_properties import (
    arms_in_torso,
    compared_with_tables,
    degenerate_inertia,
    impossible_inertia,
    inertia_size,
    mass_unit,
    missing_inertia,
    model_mass,
    placeholders,
    sides,
    unlike_tables,
)
from kinertia.diagnostics.model.model_on_person import markers_and_feet, model_and_trials, unmatched_markers
from kinertia.diagnostics.person_context import PersonContext
from kinertia.diagnostics.runner import Question

PERSON_QUESTIONS: tuple[Question[PersonContext], ...] = (
    Question("O10", markers_and_feet),
    Question("O20", impossible_inertia),
    Question("O20", missing_inertia),
    Question("O20", inertia_size),
    Question("O20", mass_unit),
    Question("O20", degenerate_inertia),
    Question("O21", placeholders),
    Question("O21", unlike_tables),
    Question("O21", model_mass),
    Question("O21", sides),
    Question("O21", arms_in_torso),
    Question("O30", length_unit),
    Question("O30", mirrored_joints, unless=("O301",)),
    Question("O30", subtalar_axis, unless=("O301",)),
    Question("O40", model_and_trials),
    Question("O41", unmatched_markers),
    Question("O41", compared_with_tables),
)
