"""Lists the questions about OpenSim models, alone or with the trials of a person."""

from kinertia.diagnostics.model.length_unit import length_unit
from kinertia.diagnostics.model.mass_properties import (
    degenerate_inertia,
    impossible_inertia,
    inertia_size,
    mass_unit,
    missing_inertia,
)
from kinertia.diagnostics.model.mirrored_joints import mirrored_joints
from kinertia.diagnostics.model.missing_parts import markers_and_feet, unmatched_markers
from kinertia.diagnostics.model.model_on_person import model_and_trials
from kinertia.diagnostics.model.plausible_masses import (
    arms_in_torso,
    compared_with_tables,
    model_mass,
    placeholders,
    sides,
    unlike_tables,
)
from kinertia.diagnostics.model.subtalar_axis import subtalar_axis
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
