"""Lists all checks of recordings, persons and models, in the order in which they run.

A check of a result is in `result/registry`. Positions of plates, rates and delays compete as explanations.
"""

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.labels.anatomy import anatomy, direction_of_travel, heading
from kinertia.diagnostics.labels.landmarks import landmarks
from kinertia.diagnostics.labels.marker_set_match import labels_match
from kinertia.diagnostics.labels.segment_rigidity import rigidity
from kinertia.diagnostics.labels.swapped_markers import label_swaps
from kinertia.diagnostics.markers.axes_and_floor import floor_slope, unit_and_vertical
from kinertia.diagnostics.markers.computed_markers import computed_markers
from kinertia.diagnostics.markers.frames import frames
from kinertia.diagnostics.markers.over_smoothed import over_smoothed
from kinertia.diagnostics.markers.trajectories import precision, trajectories, visible
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
from kinertia.diagnostics.plates.plate_height import plate_heights
from kinertia.diagnostics.plates.plate_positions import repeated_plates
from kinertia.diagnostics.plates.signals import dead_moments, mains_interference, quantisation, signals, spikes
from kinertia.diagnostics.plates.zeros import unloaded_levels, zeros, zeros_under_load
from kinertia.diagnostics.runner import Check
from kinertia.diagnostics.subject.body_data import absent_markers, population, stated_and_filed, stature
from kinertia.diagnostics.subject.camera_scale import trial_scales
from kinertia.diagnostics.subject.mass import masses_of_trials, stated_mass
from kinertia.diagnostics.subject.movements import informative_movements
from kinertia.diagnostics.subject.same_person import repeated_trials, static_and_trials, trials_of_one_person
from kinertia.diagnostics.subject.stance_coverage import stance_coverage
from kinertia.diagnostics.subject.standing import flat_feet, floor, no_static, standing
from kinertia.diagnostics.timing.belt_speed import belt_speed
from kinertia.diagnostics.timing.file_events import file_events
from kinertia.diagnostics.timing.force_timing import force_rate, plate_delay, trial_delays
from kinertia.diagnostics.timing.interchanged_forces import interchanged_forces

_SIZE = "M141"
"""In another unit of length no limit in metres means anything."""
_MADE_UP = "M123"
"""Where frames were interpolated, steps from frame to frame mean nothing."""

MARKER_STATIC_CHECKS: tuple[Check[RecordingContext], ...] = (
    Check("M10", visible),
    Check("M14", unit_and_vertical),
    Check("M11", trajectories, unless=(_SIZE,)),
)
MARKER_MOTION_CHECKS: tuple[Check[RecordingContext], ...] = (
    Check("M10", visible),
    Check("M14", unit_and_vertical),
    Check("M12", frames, unless=(_SIZE,)),
    Check("M13", precision, unless=(_SIZE, _MADE_UP)),
    Check("M11", trajectories, unless=(_SIZE, _MADE_UP)),
    Check("M14", floor_slope, unless=("M14",)),
    Check("M15", computed_markers, unless=(_SIZE,)),
)
_AXES = ("M141", "M142")
"""Without a vertical and a unit of length, nothing is above or beside anything."""

_BOTH: tuple[Check[RecordingContext], ...] = (
    Check("L10", labels_match),
    Check("L10", heading),
    Check("L20", anatomy, unless=_AXES),
)
LABEL_STATIC_CHECKS: tuple[Check[RecordingContext], ...] = (*_BOTH, Check("L10", landmarks, unless=("L106", "M104")))
LABEL_MOTION_CHECKS: tuple[Check[RecordingContext], ...] = (
    *_BOTH,
    Check("S31", direction_of_travel, unless=(*_AXES, "L20")),
    Check("L21", label_swaps, unless=("M141", "M123")),
    Check("L21", rigidity, unless=("M141",)),
)
_NOT_UNDER_FEET = ("P201", "P202", "P203", "P204", "P24", "T20", "T21")
"""ERRORs after which it is not known where on a foot a load acts."""

PLACE_CHECKS: tuple[Check[RecordingContext], ...] = (
    Check("P24", loads_and_feet, unless=("P201", "P202", "P203", "P107")),
    Check("P24", cop_on_plate, unless=("P204",)),
    Check("P25", cop_progression, unless=_NOT_UNDER_FEET),
    Check("P28", plate_edges, unless=_NOT_UNDER_FEET),
    Check("P28", stray_loads),
    Check("P28", foreign_load, unless=("P201", "P202", "P203", "P204")),
    Check("P27", both_feet, unless=_NOT_UNDER_FEET),
    Check("P27", complete_contact),
)
_OTHER_AXES = ("P201",)
"""ERROR after which there is no vertical force to judge by."""
_NO_VELOCITY = ("L20", "M12", "M14", "P10", "P11", "P20", "P24", "T201", "T211", "T212")
"""ERRORs after which markers, forces or their times do not belong to one moving body."""

SIGNAL_CHECKS: tuple[Check[RecordingContext], ...] = (
    Check("P20", axes_and_units),
    Check("P28", repeated_plates),
    Check("P10", signals, unless=_OTHER_AXES),
    Check("P11", dead_moments, unless=_OTHER_AXES),
    Check("P10", quantisation, unless=_OTHER_AXES),
    Check("P10", mains_interference, unless=_OTHER_AXES),
    Check("P21", zeros, unless=_OTHER_AXES),
    Check("P26", free_moments, unless=_OTHER_AXES),
    Check("P23", vertical_signs, unless=_OTHER_AXES),
)
STANDING_CHECKS: tuple[Check[RecordingContext], ...] = (Check("P10", spikes), Check("P21", unloaded_levels))
LOADED_CHECKS: tuple[Check[RecordingContext], ...] = (
    Check("M13", over_smoothed, unless=_NO_VELOCITY),
    Check("T20", force_rate, unless=_NO_VELOCITY),
    Check("T21", plate_delay, unless=_NO_VELOCITY),
    Check("P23", force_directions, unless=_NO_VELOCITY),
    Check("P22", gains, unless=_NO_VELOCITY),
    Check("P21", zeros_under_load, unless=_NO_VELOCITY),
    Check("P26", vertical_moment, unless=_NO_VELOCITY),
)
TIMING_CHECKS: tuple[Check[RecordingContext], ...] = (Check("T30", belt_speed), Check("T31", file_events))

TIMING_PERSON_CHECKS: tuple[Check[PersonContext], ...] = (
    Check("S30", interchanged_forces),
    Check("T21", trial_delays),
)
SUBJECT_STATIC_CHECKS: tuple[Check[RecordingContext], ...] = (
    Check("S20", standing),
    Check("S20", flat_feet),
    Check("S10", stature),
)
SUBJECT_CHECKS: tuple[Check[PersonContext], ...] = (
    Check("S10", stated_and_filed),
    Check("M10", absent_markers),
    Check("S20", no_static),
    Check("M14", floor),
    Check("P24", plate_heights, unless=("M143",)),
    Check("S20", static_and_trials),
    Check("S30", trials_of_one_person),
    Check("S20", trial_scales),
    Check("S30", repeated_trials),
    Check("S11", stated_mass),
    Check("S30", masses_of_trials),
    Check("S31", informative_movements),
    Check("S40", population),
    Check("P27", stance_coverage),
)
MODEL_CHECKS: tuple[Check[PersonContext], ...] = (
    Check("O10", markers_and_feet),
    Check("O20", impossible_inertia),
    Check("O20", missing_inertia),
    Check("O20", inertia_size),
    Check("O20", mass_unit),
    Check("O20", degenerate_inertia),
    Check("O21", placeholders),
    Check("O21", unlike_tables),
    Check("O21", model_mass),
    Check("O21", sides),
    Check("O21", arms_in_torso),
    Check("O30", length_unit),
    Check("O30", mirrored_joints, unless=("O301",)),
    Check("O30", subtalar_axis, unless=("O301",)),
    Check("O40", model_and_trials),
    Check("O41", unmatched_markers),
    Check("O41", compared_with_tables),
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
