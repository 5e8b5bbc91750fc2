"""Lists all checks of recordings, persons and models, by what they are asked of.

Their order follows from what they need (`runner.in_order`). Checks of a result are in `result/registry`.
"""

from kinertia.diagnostics.context import PersonContext, RecordingContext
from kinertia.diagnostics.markers.axes_and_floor import floor, floor_slope, unit_and_vertical
from kinertia.diagnostics.markers.label_anatomy import anatomy, direction_of_travel, heading
from kinertia.diagnostics.markers.marker_set import labels_match, landmarks
from kinertia.diagnostics.markers.swapped_markers import label_swaps, rigidity
from kinertia.diagnostics.markers.trajectories import absent_markers, over_smoothed, precision, trajectories, visible
from kinertia.diagnostics.markers.unmeasured_data import computed_markers, frames
from kinertia.diagnostics.model.geometry import length_unit, mirrored_joints, subtalar_axis
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
from kinertia.diagnostics.plates.cop_positions import cop_on_plate, cop_progression, loads_and_feet
from kinertia.diagnostics.plates.force_directions import axes_and_units, force_directions, vertical_signs
from kinertia.diagnostics.plates.force_timing import belt_speed, file_events, force_rate, plate_delay, trial_delays
from kinertia.diagnostics.plates.free_moments import free_moments, vertical_moment
from kinertia.diagnostics.plates.gains import gains
from kinertia.diagnostics.plates.ground_contact import (
    both_feet,
    compared_with_motion,
    complete_contact,
    foreign_load,
    plate_edges,
    stance_coverage,
    stray_loads,
)
from kinertia.diagnostics.plates.plate_positions import plate_heights, repeated_plates
from kinertia.diagnostics.plates.signals import (
    dead_moments,
    low_passed,
    mains_interference,
    quantisation,
    signals,
    spikes,
)
from kinertia.diagnostics.plates.zeros import unloaded_levels, zeros, zeros_under_load
from kinertia.diagnostics.runner import Check
from kinertia.diagnostics.subject.body_data import population, stated_and_filed, stature
from kinertia.diagnostics.subject.mass import masses_of_trials, stated_mass
from kinertia.diagnostics.subject.movements import flat_feet, informative_movements, no_static, standing
from kinertia.diagnostics.subject.same_person import repeated_trials, static_and_trials, trials_of_one_person
from kinertia.diagnostics.subject.same_session import interchanged_forces, trial_scales

MARKER_STATIC_CHECKS: tuple[Check[RecordingContext], ...] = (
    visible,
    unit_and_vertical,
    trajectories,
)
MARKER_MOTION_CHECKS: tuple[Check[RecordingContext], ...] = (
    visible,
    unit_and_vertical,
    frames,
    precision,
    trajectories,
    floor_slope,
    computed_markers,
)

_BOTH: tuple[Check[RecordingContext], ...] = (
    labels_match,
    heading,
    anatomy,
)
LABEL_STATIC_CHECKS: tuple[Check[RecordingContext], ...] = (*_BOTH, landmarks)
LABEL_MOTION_CHECKS: tuple[Check[RecordingContext], ...] = (
    *_BOTH,
    direction_of_travel,
    label_swaps,
    rigidity,
)

PLACE_CHECKS: tuple[Check[RecordingContext], ...] = (
    loads_and_feet,
    cop_on_plate,
    cop_progression,
    plate_edges,
    stray_loads,
    foreign_load,
    both_feet,
    complete_contact,
)

SIGNAL_CHECKS: tuple[Check[RecordingContext], ...] = (
    axes_and_units,
    repeated_plates,
    signals,
    dead_moments,
    quantisation,
    low_passed,
    mains_interference,
    zeros,
    free_moments,
    vertical_signs,
)
STANDING_CHECKS: tuple[Check[RecordingContext], ...] = (spikes, unloaded_levels)
LOADED_CHECKS: tuple[Check[RecordingContext], ...] = (
    over_smoothed,
    force_rate,
    plate_delay,
    force_directions,
    gains,
    zeros_under_load,
    vertical_moment,
)
TIMING_CHECKS: tuple[Check[RecordingContext], ...] = (belt_speed, file_events)

TIMING_PERSON_CHECKS: tuple[Check[PersonContext], ...] = (
    interchanged_forces,
    trial_delays,
    compared_with_motion,
)
SUBJECT_STATIC_CHECKS: tuple[Check[RecordingContext], ...] = (
    standing,
    flat_feet,
    stature,
)
SUBJECT_CHECKS: tuple[Check[PersonContext], ...] = (
    stated_and_filed,
    absent_markers,
    no_static,
    floor,
    plate_heights,
    static_and_trials,
    trials_of_one_person,
    trial_scales,
    repeated_trials,
    stated_mass,
    masses_of_trials,
    informative_movements,
    population,
    stance_coverage,
)
MODEL_CHECKS: tuple[Check[PersonContext], ...] = (
    markers_and_feet,
    impossible_inertia,
    missing_inertia,
    inertia_size,
    mass_unit,
    degenerate_inertia,
    placeholders,
    unlike_tables,
    model_mass,
    sides,
    arms_in_torso,
    length_unit,
    mirrored_joints,
    subtalar_axis,
    model_and_trials,
    unmatched_markers,
    compared_with_tables,
)
STATIC_CHECKS: tuple[Check[RecordingContext], ...] = (
    *MARKER_STATIC_CHECKS,
    *LABEL_STATIC_CHECKS,
    *SUBJECT_STATIC_CHECKS,
    *STANDING_CHECKS,
)
"""Of a static trial."""
MOTION_CHECKS: tuple[Check[RecordingContext], ...] = (
    *MARKER_MOTION_CHECKS,
    *LABEL_MOTION_CHECKS,
    *SIGNAL_CHECKS,
    *TIMING_CHECKS,
    *PLACE_CHECKS,
    *LOADED_CHECKS,
)
"""Of the recording of a motion."""
PERSON_CHECKS: tuple[Check[PersonContext], ...] = (*SUBJECT_CHECKS, *MODEL_CHECKS, *TIMING_PERSON_CHECKS)
"""Of a person with all recordings."""
