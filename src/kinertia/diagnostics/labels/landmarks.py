"""L105: does the static trial show the landmarks that the model's joints need?"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from kinertia.diagnostics.context import RecordingContext
from kinertia.errors import KinertiaError, MarkerSetError
from kinertia.findings.finding import Finding
from kinertia.model.gait27 import build_gait27

_USUAL_HEIGHT_M, _ANY_SEX = 1.7, "male"
"""Whether landmarks suffice depends on neither."""


def landmarks(context: RecordingContext) -> Iterator[Finding]:
    """Why no model can be built from a static trial: the finding of the error (L105, S206).

    Errors that are not about markers are those of stature, which other questions are about.
    """
    if context.marker_set is None or not context.marker_set.landmarks:
        return
    height_m = context.height_m or context.recording.height_m or _USUAL_HEIGHT_M
    try:
        build_gait27(context.recording, context.marker_set, height_m, _ANY_SEX)
    except MarkerSetError as error:
        if error.finding is None:
            raise
        yield replace(error.finding, where=replace(error.finding.where, trial=context.name))
    except KinertiaError:
        return
