"""What is found of where loads and feet are, and when."""

from dataclasses import replace

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.registry import PLACE_CHECKS
from kinertia.diagnostics.runner import asked, explained
from kinertia.findings.finding import Severity
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import PlateLoads
from recordings import marker_set_for

COMPETING = ("P204", "P241", "P242", "P243", "P244", "T201", "T211", "T212")


def feet_of(recording):
    """Labels on the right ("r") and left ("l") foot of a recording, those that it has."""
    labels = recording.markers.labels
    feet = marker_set_for(labels).foot_labels()
    return {side: [label for label in of_side if label in labels] for side, of_side in feet.items()}


def context_of(recording, feet=None, **more):
    """Of a recording with the markers of a preset, or with these labels on its feet ("r" and "l")."""
    if feet is None:
        return RecordingContext(recording, choose_marker_set(recording.markers.labels), **more)
    segments = {f"foot_{side}": tuple(labels) for side, labels in feet.items()}
    return RecordingContext(recording, MarkerSet("feet", {}, segments, {}), **more)


def on_one_plate(recording):
    """The recording with all its loads on one plate."""
    plates = recording.plates
    force, moment = (part.sum(axis=1, keepdims=True) for part in (plates.force, plates.moment))
    return replace(recording, plates=PlateLoads(plates.time, ("belt",), force, moment, (None,)))


def place_findings(recording, feet=None, context=None, **more):
    """What all questions of places find, with causes over their consequences."""
    return explained(asked(PLACE_CHECKS, context or context_of(recording, feet, **more)))


def doubted(recording, feet=None, **more):
    """Codes of what is not explained by another finding and above CORRECTED."""
    found = place_findings(recording, feet, **more)
    return [finding.code for finding in found if finding.is_open and finding.severity > Severity.CORRECTED]


def error_of(recording, feet=None, **more):
    """The ERROR of the competition of places, rates and delays, or None."""
    found = [
        finding
        for finding in place_findings(recording, feet, **more)
        if finding.code in COMPETING and finding.muted_by is None
    ]
    errors = [finding for finding in found if finding.severity is Severity.ERROR]
    assert len({finding.code for finding in errors}) <= 1
    return errors[0] if errors else None
