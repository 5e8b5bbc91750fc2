"""Makes a trial of which only the markers are used."""

import numpy as np

from kinertia.trial.data import FootLoads, Recording, Trial
from kinertia.trial.sampled_time import within


def trial_without_forces(recording: Recording, window_s: tuple[float, float] | None = None) -> Trial:
    """Return the trial without plates; every frame counts, or only frames of the window (s) that the user states.

    Examples:
        >>> from kinertia.trial.without_forces import trial_without_forces
        >>> recording = kinertia.read_recording("lab/walk.trc", "lab/walk_grf.mot")
        >>> trial_without_forces(recording).loads.plates
        ()
    """
    time = recording.markers.time
    zero = np.zeros((len(time), 2, 3))
    used = np.ones(len(time), dtype=bool) if window_s is None else within(time, *window_s)
    return Trial(
        recording.name,
        recording.markers,
        FootLoads(time, zero, zero, plates=()),
        used,
        recording.notes,
        recording.virtual_sd_m,
        recording.belt,
        vertical=recording.vertical,
        events=recording.events,
    )
