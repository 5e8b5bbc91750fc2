"""Body segment parameters from gait: motion-capture markers and ground reaction forces in, BSPs out.

What a notebook needs first; every step of `estimate_bsp` is a function of its own module.
"""

from importlib.metadata import version

__version__ = version("kinertia")

# `kinertia.report.files` writes the version, so it must be there before the imports
from kinertia.errors import KinertiaError
from kinertia.estimation.estimate import Fit, TrialFit, estimate_bsp
from kinertia.estimation.prepare import TrialInput
from kinertia.io.recording import read_recording
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.marker_set import read_marker_set
from kinertia.report.files import save_fit
from kinertia.settings import Settings, Subject, read_subject

__all__ = [
    "BodySegmentParameters",
    "Fit",
    "KinertiaError",
    "Settings",
    "Subject",
    "TrialFit",
    "TrialInput",
    "estimate_bsp",
    "read_marker_set",
    "read_recording",
    "read_subject",
    "save_fit",
]
