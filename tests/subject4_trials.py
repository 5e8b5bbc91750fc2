"""Trials of one measured person, with forces that are late or another trial's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import Recording, Trial
from kinertia.trial.plate_assignment import build_trial


def trial_of_subject4(
    read: Callable[..., Recording], marker_set: MarkerSet, name: str, forces: str | None = None, late_s: float = 0.0
) -> Trial:
    """The trial of this name.

    Args:
        read: the fixture `recording_of`.
        marker_set: of the person's model.
        name: of the trial.
        forces: the trial whose forces it has; its own if None.
        late_s: by how much they are late.
    """
    recording = read(f"subject4/{name}.trc", f"subject4/{forces or name}_grf.mot")
    feet = {
        side: [one for one in own if one in recording.markers.labels] for side, own in marker_set.foot_labels().items()
    }
    plates = replace(recording.plates, time=recording.plates.time + late_s)
    return build_trial(replace(recording, plates=plates, name=name), feet)
