"""Loads a result from its folder, without the recordings that it was estimated from: `load_fit`."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from kinertia.errors import FileError
from kinertia.estimation.identifiability import BaseParameters, Combination
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.trial_fit import JointCurves, TrialFit
from kinertia.estimation.simultaneous.fit import Posterior
from kinertia.estimation.simultaneous.instruments.instrument_errors import CalibrationEntry
from kinertia.estimation.simultaneous.instruments.priors import InstrumentInformation
from kinertia.estimation.simultaneous.markers.marker_noise import MarkerNoise
from kinertia.estimation.simultaneous.uncertainty.curve_deviations import CurveDeviations
from kinertia.estimation.simultaneous.uncertainty.evidence import FreeMomentSign, MissingLoad
from kinertia.estimation.simultaneous.uncertainty.posterior_draws import PosteriorDraws, TrialDraws
from kinertia.estimation.simultaneous.uncertainty.prior_plausibility import MahalanobisDistance, OneSided
from kinertia.findings.finding import Finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.io.object_archive import read_archive, write_archive
from kinertia.io.subject.provenance import Provenance
from kinertia.io.versions import VERSION, versions
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.coordinate_map import Composed, PiecewisePolynomial
from kinertia.model.coordinate_range import Range
from kinertia.model.imported_model import Coupling, OsimCoordinate, OsimJoint, OsimModel
from kinertia.model.skeleton import Axis, Joint, Marker, Skeleton
from kinertia.motion.dynamics import Motion
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.inverse_kinematics import InverseKinematics
from kinertia.motion.joint_moments import JointMoments
from kinertia.motion.kinematics import Kinematics
from kinertia.motion.smoothing import SmoothedSpline
from kinertia.report.pages.truth_comparison import Truth
from kinertia.settings import Overrule, Settings, Subject
from kinertia.trial.data import FootLoads, Markers, Trial
from kinertia.trial.file_contents import Belt, FileEvent, FileOutputs

FIT_FILE = "fit.npz"


@dataclass(frozen=True, eq=False)
class SavedFit:
    """Content of `fit.npz`.

    Attributes:
        fit: the result.
        provenance: command and files of the result, if known.
        versions: versions of the software that computed it.
        truth: truth of a synthetic person.
    """

    fit: Fit
    provenance: Provenance | None
    versions: Mapping[str, str]
    truth: Truth | None = None


_KINDS = (
    SavedFit, Provenance, Truth, Fit, TrialFit, JointCurves, JointMoments, CurveDeviations, Subject, Settings,
    Posterior, InstrumentInformation, MarkerNoise, BaseParameters, Combination, MahalanobisDistance, OneSided,
    CalibrationEntry, FreeMomentSign, MissingLoad, PosteriorDraws, TrialDraws,
    Skeleton, Joint, Axis, Marker, Range, PiecewisePolynomial, Composed, BodySegmentParameters,
    OsimModel, OsimJoint, OsimCoordinate, Coupling,
    Finding, Where, Quantity, Overrule,
    Kinematics, InverseKinematics, SmoothedSpline, Motion, GroundReactions, Trial, Markers, FootLoads, Belt,
    FileEvent,
    FileOutputs,
)  # fmt: skip
"""All that a result is made of. Files use these class names: after a renaming the old one must stay readable."""


def write_fit(fit: Fit, provenance: Provenance | None, path: Path, truth: Truth | None = None) -> None:
    """Write a complete result into one file."""
    write_archive(path, SavedFit(fit, provenance, versions(), truth), _KINDS, {"kinertia": VERSION})


def read_saved(folder: str | Path) -> SavedFit:
    """Read the result in a folder, with its provenance.

    Raises:
        FileError: as `load_fit`.
    """
    path = Path(folder) / FIT_FILE
    if Path(folder).is_file():
        raise FileError(folder, f"is a file; give its folder, {Path(folder).parent}")
    if not Path(folder).is_dir():
        raise FileError(folder, "no such folder; give one that kinertia fit has written")
    if not path.is_file():
        problem = f"holds no {FIT_FILE}: no results of kinertia fit here; give the folder that it wrote"
        raise FileError(folder, problem)
    saved = read_archive(path, _KINDS)
    if not isinstance(saved, SavedFit):
        raise FileError(path, "is not a result of kinertia fit; give another folder")
    return saved


def load_fit(folder: str | Path) -> Fit:
    """Load a result from the folder it was saved to: figures, tables, cycles and `save`, without the recordings.

    Raises:
        FileError: no result is there, or it cannot be read.

    Examples:
        >>> folder = fit.save("results")
        >>> again = kinertia.load_fit(folder)
        >>> bool((again.bsp.estimate == fit.bsp.estimate).all())
        True
    """
    return read_saved(folder).fit
