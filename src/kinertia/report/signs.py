"""Defines the signs of clinical angles and joint moments in reports: three conventions.

Files are not affected: names in tables state the positive direction themselves (`knee_flexion_joint_moment`).
"""

from collections.abc import Mapping

from kinertia.estimation.result import Fit
from kinertia.model.skeleton import Skeleton
from kinertia.motion.model_outputs import CLINICAL_ANGLES
from kinertia.report.coordinate_titles import joint_moment_words, panels_of
from kinertia.settings import SignConvention

_CLINICAL = dict(
    zip(
        CLINICAL_ANGLES,
        (
            "Pelvic tilt, anterior +",
            "Pelvic obliquity, this side up +",
            "Pelvic rotation, this side forward +",
            "Hip flexion +",
            "Hip adduction +",
            "Hip internal rotation +",
            "Knee flexion +",
            "Ankle dorsiflexion +",
            "Foot progression, toes inward +",
        ),
        strict=True,
    )
)
_OF_ISB = {
    "pelvis_tilt_clinical": "Pelvic tilt, posterior +",
    "pelvis_obliquity_clinical": "Pelvic obliquity, this side down +",
}
"""Angles whose signs are opposite by ISB (`model_outputs`)."""
_OPPOSITE = {
    "flexion": "extension",
    "adduction": "abduction",
    "internal rotation": "external rotation",
    "dorsiflexion": "plantarflexion",
    "inversion": "eversion",
}
_COORDINATES = {
    "hip_flexion": "hip_flexion",
    "hip_adduction": "hip_adduction",
    "hip_rotation": "hip_rotation",
    "knee_flexion": "knee_angle",
    "ankle_flexion": "ankle_angle",
}
"""Coordinates of OpenSim's models that turn about the axes of joint moments."""

Signs = Mapping[str, float]
"""Sign by quantity with which a curve is drawn; 1 for those that are not among them."""


def convention_of(fit: Fit) -> SignConvention:
    """Return the convention that is stated; by default an OpenSim model's own signs, those of clinics otherwise."""
    return fit.settings.convention or ("clinical" if fit.file is None else "opensim")


def signed_angles(convention: SignConvention) -> dict[str, tuple[str, float]]:
    """Return title and sign of the nine clinical angles by quantity."""
    flipped = _OF_ISB if convention == "isb" else {}
    return {name: (flipped.get(name, title), -1.0 if name in flipped else 1.0) for name, title in _CLINICAL.items()}


def signed_joint_moment(name: str, skeleton: Skeleton, convention: SignConvention) -> tuple[str, float]:
    """Return title and sign of a three-dimensional joint moment, which is internal; the trunk's has one sign only.

    By clinical convention extension, abduction, external rotation, plantarflexion and eversion are positive, as in
    Plug-in Gait: the external moment of the opposite direction has the same sign.
    """
    joint, words = joint_moment_words(name)
    opposite = _OPPOSITE.get(words, "") if joint != "Trunk" else ""
    turned = convention == "clinical" or (convention == "opensim" and _is_turned(name, opposite, skeleton))
    return (f"{joint} {opposite} +", -1.0) if opposite and turned else (f"{joint} {words} +", 1.0)


def _is_turned(name: str, opposite: str, skeleton: Skeleton) -> bool:
    """Return whether the coordinate about the moment's axis is positive in the opposite direction."""
    titles = {one.name: one.title for one in panels_of(skeleton)}
    return bool(opposite) and f" {opposite} +" in titles.get(_COORDINATES.get(name, ""), "")
