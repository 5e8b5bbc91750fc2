"""Body segment parameters from gait: motion-capture markers and ground reaction forces in, BSPs out.

Everything public is here: `import kinertia` and take it from there. A name is loaded when it is first used (PEP 562),
so that the import itself costs next to nothing.

    import kinertia

    fit = kinertia.fit_subject("subject.toml")
    fit.bsp                # a pandas table
    fit.save("results")
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    __version__: str

    from kinertia.cohort.tables import read_cohort as read_cohort
    from kinertia.diagnostics.model.mass_table import ModelCheck as ModelCheck
    from kinertia.diagnostics.model.mass_table import check_model as check_model
    from kinertia.diagnostics.result.suitability import Suitability as Suitability
    from kinertia.diagnostics.result.suitability import suitability as suitability
    from kinertia.errors import BlockedError as BlockedError
    from kinertia.errors import FileError as FileError
    from kinertia.errors import KinertiaError as KinertiaError
    from kinertia.errors import MarkerSetError as MarkerSetError
    from kinertia.errors import OsimError as OsimError
    from kinertia.errors import SessionError as SessionError
    from kinertia.errors import SettingsError as SettingsError
    from kinertia.errors import SubjectError as SubjectError
    from kinertia.errors import TrialError as TrialError
    from kinertia.estimation.prepared import Prepared as Prepared
    from kinertia.estimation.prior import BspPrior as BspPrior
    from kinertia.estimation.prior import literature_prior as literature_prior
    from kinertia.estimation.result.fit import Fit as Fit
    from kinertia.estimation.result.trial_fit import TrialFit as TrialFit
    from kinertia.estimation.simultaneous.fit import Posterior as Posterior
    from kinertia.findings.extensions import RulePackage as RulePackage
    from kinertia.findings.finding import Finding as Finding
    from kinertia.findings.finding import Severity as Severity
    from kinertia.findings.finding import finding as finding
    from kinertia.findings.quantity import Quantity as Quantity
    from kinertia.findings.quantity import Where as Where
    from kinertia.findings.rule import Rule as Rule
    from kinertia.findings.rule import rule as rule
    from kinertia.io.b3d import read_b3d as read_b3d
    from kinertia.io.marker_set_file import choose_marker_set as choose_marker_set
    from kinertia.io.marker_set_file import read_marker_set as read_marker_set
    from kinertia.io.opensim.reader import read_osim as read_osim
    from kinertia.io.recording import read_recording as read_recording
    from kinertia.io.subject.reader import read_subject as read_subject
    from kinertia.io.subject.tables import SubjectFile as SubjectFile
    from kinertia.model.anthropometry import BodyGeometry as BodyGeometry
    from kinertia.model.anthropometry import literature_bsp as literature_bsp
    from kinertia.model.bsp import BodySegmentParameters as BodySegmentParameters
    from kinertia.model.imported_model import OsimModel as OsimModel
    from kinertia.model.marker_set import MarkerSet as MarkerSet
    from kinertia.model.skeleton import Skeleton as Skeleton
    from kinertia.motion.dynamics import Motion as Motion
    from kinertia.motion.dynamics import inverse_dynamics as inverse_dynamics
    from kinertia.motion.dynamics import residual as residual
    from kinertia.report.comparison.what_changed import compare as compare
    from kinertia.report.comparison.what_changed import compare_group as compare_group
    from kinertia.report.exports.saved_fit import load_fit as load_fit
    from kinertia.settings import Attached as Attached
    from kinertia.settings import Instruments as Instruments
    from kinertia.settings import Overrule as Overrule
    from kinertia.settings import Settings as Settings
    from kinertia.settings import Subject as Subject
    from kinertia.studies.cross_validation import HeldOut as HeldOut
    from kinertia.studies.cross_validation import cross_validate as cross_validate
    from kinertia.studies.plan import Plan as Plan
    from kinertia.studies.plan import plan as plan
    from kinertia.synthetic.walk import SyntheticSubject as SyntheticSubject
    from kinertia.synthetic.walk import SyntheticTrial as SyntheticTrial
    from kinertia.synthetic.walk import walk as walk
    from kinertia.synthetic.walk import walking_subject as walking_subject
    from kinertia.trial.data import FootLoads as FootLoads
    from kinertia.trial.data import Markers as Markers
    from kinertia.trial.data import PlateLoads as PlateLoads
    from kinertia.trial.data import Recording as Recording
    from kinertia.trial.data import Trial as Trial
    from kinertia.trial.plate_assignment import build_trial as build_trial
    from kinertia.trial.trial_input import TrialInput as TrialInput
    from kinertia.workflow.check import PersonCheck as PersonCheck
    from kinertia.workflow.check import RecordingCheck as RecordingCheck
    from kinertia.workflow.check import check_person as check_person
    from kinertia.workflow.check import check_recording as check_recording
    from kinertia.workflow.estimate import estimate as estimate
    from kinertia.workflow.estimate import estimate_bsp as estimate_bsp
    from kinertia.workflow.from_files import fit_subject as fit_subject
    from kinertia.workflow.from_files import prepare_subject as prepare_subject
    from kinertia.workflow.person import Person as Person
    from kinertia.workflow.person import read_person as read_person
    from kinertia.workflow.prepare import prepare as prepare

_ROOMS = {
    "errors": (
        "BlockedError FileError KinertiaError MarkerSetError OsimError SessionError SettingsError SubjectError "
        "TrialError"
    ),
    "findings.extensions": "RulePackage",
    "findings.finding": "Finding Severity finding",
    "findings.quantity": "Quantity Where",
    "findings.rule": "Rule rule",
    "settings": "Attached Instruments Overrule Settings Subject",
    "trial.data": "FootLoads Markers PlateLoads Recording Trial",
    "trial.plate_assignment": "build_trial",
    "trial.trial_input": "TrialInput",
    "model.anthropometry": "BodyGeometry literature_bsp",
    "model.bsp": "BodySegmentParameters",
    "model.imported_model": "OsimModel",
    "model.marker_set": "MarkerSet",
    "model.skeleton": "Skeleton",
    "motion.dynamics": "Motion inverse_dynamics residual",
    "io.b3d": "read_b3d",
    "io.marker_set_file": "choose_marker_set read_marker_set",
    "io.opensim.reader": "read_osim",
    "io.recording": "read_recording",
    "io.subject.reader": "read_subject",
    "io.subject.tables": "SubjectFile",
    "estimation.prepared": "Prepared",
    "estimation.prior": "BspPrior literature_prior",
    "estimation.result.fit": "Fit",
    "estimation.result.trial_fit": "TrialFit",
    "estimation.simultaneous.fit": "Posterior",
    "diagnostics.model.mass_table": "ModelCheck check_model",
    "diagnostics.result.suitability": "Suitability suitability",
    "workflow.estimate": "estimate estimate_bsp",
    "workflow.from_files": "fit_subject prepare_subject",
    "workflow.prepare": "prepare",
    "workflow.check": "PersonCheck RecordingCheck check_person check_recording",
    "workflow.person": "Person read_person",
    "synthetic.walk": "SyntheticSubject SyntheticTrial walk walking_subject",
    "studies.cross_validation": "HeldOut cross_validate",
    "studies.plan": "Plan plan",
    "cohort.tables": "read_cohort",
    "report.comparison.what_changed": "compare compare_group",
    "report.exports.saved_fit": "load_fit",
}
"""Where the public names are, from the lowest room up."""
_HOMES = {name: module for module, names in _ROOMS.items() for name in names.split()}

__all__ = sorted(_HOMES)


if not TYPE_CHECKING:  # a type checker is to know the names above, and no others

    def __getattr__(name: str) -> object:
        """Load a public name when it is first used."""
        if name == "__version__":
            from importlib.metadata import version

            value: object = version("kinertia")
        elif name in _HOMES:
            value = getattr(import_module(f"kinertia.{_HOMES[name]}"), name)
        else:
            raise AttributeError(f"module 'kinertia' has no attribute '{name}'")
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
