"""Cases of limits of findings about results and models; `marker_limits` says what a case is."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

import upright_model as upright
from kinertia.diagnostics.model import geometry, model_on_person
from kinertia.diagnostics.model.mass_properties import inertia_size, mass_unit, missing_inertia, model_mass, sides
from kinertia.diagnostics.model.model_on_person import model_and_trials
from kinertia.diagnostics.result import plate_errors, residuals, soundness
from kinertia.diagnostics.result.corrections import delays, session_contradictions, zero_offsets
from kinertia.diagnostics.result.residuals import moved_markers, residuals_of
from kinertia.estimation.prepared import TotalMass
from kinertia.estimation.simultaneous.instruments.instrument_errors import (
    DELAY,
    FREE_MOMENT,
    GAIN,
    POSITION,
    ROTATION,
    ZERO,
)
from kinertia.estimation.simultaneous.instruments.priors import (
    DELAY_PRIOR_S,
    FLOOR_PRIOR,
    PLATE_PRIOR,
    TRIAL_DELAY_PRIOR_S,
    TRIAL_GAIN_PRIOR,
    ZERO_PRIOR_N,
    InstrumentPrior,
)
from kinertia.findings.quantity import Where
from kinertia.model.bsp import PARAMETERS, BodySegmentParameters
from kinertia.model.marker_set import MarkerSet
from kinertia.synthetic.walk import walking_subject
from kinertia.trial.data import Markers
from people import UNMOVED, with_model
from results import PartOfFit, context, error, walking


def estimated_mass(total_kg):
    ready = SimpleNamespace(total_mass=TotalMass(70.0, 70.0, 1.0))
    fit = SimpleNamespace(estimate=SimpleNamespace(total_mass_kg=total_kg))
    return soundness.total_mass(SimpleNamespace(fit=fit, ready=ready))


def mass_of_the_motion(mass_kg, patched):
    patched.setattr(soundness, "mass_from_force_kg", lambda literature, trial: mass_kg)
    fit = SimpleNamespace(trials=[SimpleNamespace(name="walk")])
    by_markers = {"walk": SimpleNamespace(mass_kg=70.0, sd_kg=0.5)}
    ready = SimpleNamespace(literature=None)
    return soundness.forces_of_the_motion(SimpleNamespace(fit=fit, ready=ready, force_masses=by_markers))


def item(mass_in_sds):
    estimate = SimpleNamespace(segments=("bag",), mass_kg=np.array([mass_in_sds]))
    fit = SimpleNamespace(estimate=estimate, posterior=SimpleNamespace(sd=np.array([[1.0]])))
    ready = SimpleNamespace(attached=[SimpleNamespace(name="bag", mass_kg=None)])
    return soundness.attached_items(SimpleNamespace(fit=fit, ready=ready))


def residual(size, column, peak=False, external_n=1e6, mass_kg=0.0):
    """Always of this size, or in one frame of ten thousand; of a body without mass none of it is harmless."""
    left = np.zeros((10_000, 6))
    left[: 1 if peak else None, column] = size
    loads = np.zeros((10_000, 2, 6))
    loads[:, 0, 1] = external_n
    stages = {"estimate": left}
    kinematics = SimpleNamespace(foot_loads=loads, complete=True)
    trial = SimpleNamespace(name="walk", residuals=stages, full_residuals=stages, kinematics=kinematics, motion_hz=6.0)
    return residuals_of(trial, mass_kg)


def marker_errors(size_m):
    """Every marker of the synthetic walker is this far from the model."""
    skeleton = walking_subject().skeleton
    labels = tuple(marker.label for marker in skeleton.markers)
    kinematics = SimpleNamespace(ik=SimpleNamespace(labels=labels))
    errors = {"final": np.full((20, len(labels)), size_m)}
    trial = SimpleNamespace(name="walk", marker_errors_m=errors, kinematics=kinematics, skeleton=skeleton)
    return residuals._markers(SimpleNamespace(fit=SimpleNamespace(file=None, skeleton=skeleton)), trial)


def fitted():
    posterior = SimpleNamespace(instruments=None)
    plate = {"turn": SimpleNamespace(sd=0.05)}
    ready = SimpleNamespace(uncertainty=SimpleNamespace(instruments=SimpleNamespace(plate=plate)))
    fit = SimpleNamespace(posterior=posterior)
    return SimpleNamespace(fit=fit, ready=ready, along=lambda axis, plate: Where(plate=plate, axis=axis), errors=())


def displaced(detectable_m, patched):
    patched.setattr(plate_errors, "smallest_detectable", lambda *known: detectable_m)
    return [*plate_errors.common_offset(fitted())][:1]


def undetectable(all_rad, one_rad, patched):
    for name, angle in (("smallest_detectable", all_rad), ("smallest_detectable_of_one", one_rad)):
        patched.setattr(plate_errors, name, lambda *known, angle=angle: angle)
    patched.setattr(plate_errors, "equal", lambda *rotations: False)
    patched.setattr(plate_errors, "corrected", lambda *rotations: ())
    return plate_errors.plate_rotation(fitted())


def both(name):
    """Prior SD of a plate's own error and that of all plates."""
    return float(np.hypot(PLATE_PRIOR[name].sd, FLOOR_PRIOR[name].sd))


def instrument(check, quantity, prior_sd, unit, **where):
    """What is found of an error of one plate, by its size."""
    return lambda size: check(context(error(quantity, size, prior_sd, 1e-3 * prior_sd, unit, **where)))


def one_of_two(size):
    """What is found of a rotation of one plate, where the other is right."""
    rotations = [error(ROTATION, value, both("turn"), 1e-4, "rad", plate=f"plate {value}") for value in (0.0, size)]
    return plate_errors.plate_rotation(context(*rotations))


def ambiguous(patched, difference_m=0.05, apart_m=0.001, each_m=0.01):
    patched.setattr(plate_errors, "position_deviations", lambda *known: (apart_m, each_m))
    errors = [error(POSITION, size, 0.005, 0.001, "m", plate=f"plate {size}") for size in (0.0, difference_m)]
    made = context(*errors, prior=InstrumentPrior())
    return plate_errors._ambiguous(made, "x", errors)


def reversed_moments(share, patched):
    for name in ("residual_moments_nm", "residual_moments_without_offsets_nm"):
        patched.setattr(plate_errors, name, lambda left, loads: (1.0, share))
    kinematics = SimpleNamespace(complete=True, foot_loads=None)
    trial = SimpleNamespace(name="walk", kinematics=kinematics, residuals={"literature": np.zeros((2, 6))})
    return plate_errors.reversed_sign(trial)


def marker_off(distance_m, at_shoulder=False):
    label = next(iter(shoulders()) if at_shoulder else iter({"LTHI", *walking_subject().skeleton.labels} - shoulders()))
    return moved_markers(
        context(
            marker_distances_m=({label: distance_m},),
            marker_noise=(SimpleNamespace(sd_m={label: 0.01}, drifting=()),),
        )
    )


def shoulders():
    from kinertia.diagnostics.result.residuals import _at_shoulders

    return _at_shoulders(walking_subject().skeleton)


def far_from_prior(distance, segments=1):
    """The mass of so many segments of the legs is this many prior SDs from what was expected."""
    names = tuple(f"{part}_{side}" for part in ("thigh", "shank", "foot") for side in "rl")
    table, expected = np.zeros((6, 10)), np.zeros((6, 10))
    table[: round(segments), 0] = distance
    body = SimpleNamespace(segments=names, table=lambda: table)
    posterior = SimpleNamespace(prior_sd=np.ones((6, 10)))
    prior = SimpleNamespace(table=lambda: expected)
    return [
        *soundness._far_parameters(
            PartOfFit(estimate=body, expected=prior, posterior=posterior, more_known=True, file=None)
        )
    ][:1]


def centre_off(distance_m):
    moved = SimpleNamespace(segments=("torso",), com_m=np.array([[distance_m, 0.0, 0.0]]))
    fit = PartOfFit(estimate=moved, literature=SimpleNamespace(com_m=np.zeros((1, 3))), more_known=True, file=None)
    return soundness._far_centres(fit)


def unlike_others(size):
    of_person, other = (error(GAIN, value, 0.01, 1.0 / np.sqrt(2.0), "1") for value in (size, 0.0))
    return session_contradictions("person", [of_person], [other])


# models


def of_femur(check, **values):
    return check(with_model(upright.skeleton(), upright.changed("femur_r", **values)))


def massive(mass_kg):
    body = upright.bsp()
    factor = mass_kg / body.total_mass_kg
    bsp = BodySegmentParameters(body.segments, factor * body.mass_kg, body.com_m, factor * body.inertia_kgm2)
    return with_model(upright.skeleton(), bsp)


def dense(density_kg_m3):
    radius_m = (5.0 / (4.0 / 3.0 * np.pi * density_kg_m3)) ** (1.0 / 3.0)
    return inertia_size(
        with_model(upright.skeleton(), upright.with_moments("femur_r", *[2.0 * radius_m**2] * 3, mass=5.0))
    )


def large(radius_m, mass_kg=5.0):
    moment = mass_kg * radius_m**2
    return inertia_size(with_model(upright.skeleton(), upright.with_moments("femur_r", *[moment] * 3, mass=mass_kg)))


def without_inertia(mass_kg):
    return missing_inertia(with_model(upright.skeleton(), upright.with_moments("femur_r", 0.0, 0.0, 0.0, mass=mass_kg)))


def stated(ratio, trials=()):
    body = upright.bsp().total_mass_kg
    return model_mass(replace(with_model(upright.skeleton(), upright.bsp(), mass_kg=body / ratio), trials=trials))


def uneven_sides(name, size):
    """A right femur whose mass, centre or moment differs from the left one's: by a share, or by a distance."""
    body = upright.bsp()
    value = body.table()[body.segments.index("femur_r"), PARAMETERS.index(name)]
    return of_femur(sides, **{name: value + size if name == "com_x" else value * (1.0 + size)})


def mirrored(ratio, patched):
    patched.setattr(model_on_person, "_mirror_ratio", lambda model, person: ratio)
    labels = tuple("ABCDEF")
    seen = Markers(np.zeros(1), labels, np.random.default_rng(100).normal(0.0, 0.15, (1, 6, 3)))
    marker_set = MarkerSet("model", {}, {"pelvis": labels[:3], "torso": labels[3:]}, {}, in_model=seen)
    trial = SimpleNamespace(name="walk", markers=seen)
    return model_and_trials(SimpleNamespace(model=object(), marker_set=marker_set, trials=[trial]))


def calibrated(distance_m):
    before = walking_subject().skeleton
    first = next(marker for marker in before.markers if marker.segment == "shank_r")
    others = [marker for marker in before.markers if marker is not first]
    there = np.add(first.position, (0.0, distance_m, 0.0))
    after = replace(before, markers=(replace(first, position=there), *others))
    return model_on_person.moved_markers(before, after, [SimpleNamespace(labels=(first.label,))])


def long(length_m, patched, extent_m=1.7):
    patched.setattr(geometry, "_lengths", lambda skeleton, bsp: [(length_m, "a thigh")])
    patched.setattr(geometry, "_extent_m", lambda skeleton: extent_m)
    return geometry.length_unit(with_model(upright.skeleton(), upright.bsp()))


def unmirrored(patched, angle_rad=0.0, distance_m=0.0):
    neutral = SimpleNamespace(sideways=2, pairs=(("hip_r", "hip_l"),))
    patched.setattr(geometry, "neutral_joints", lambda skeleton: neutral)
    patched.setattr(geometry, "_axis_angles", lambda *known: [("hip_r", "hip_l", angle_rad)])
    patched.setattr(geometry, "_mismatch_m", lambda *known: distance_m)
    return geometry.mirrored_joints(with_model(upright.skeleton(), upright.bsp()))


def model_of_size(ratio, off_m=0.0):
    """A model whose markers are at this ratio of the distances of the trial's, or so far off in turn."""
    labels = tuple("ABCDE")
    places = np.random.default_rng(100).normal(0.0, 0.15, (1, 5, 3))
    trial = Markers(np.arange(20) / 100, labels, ratio * places.repeat(20, axis=0))
    marker_set = MarkerSet("model", {}, {"pelvis": labels}, {}, in_model=Markers(np.zeros(1), labels, places))
    seen = SimpleNamespace(name="walk", markers=trial)
    return model_and_trials(SimpleNamespace(model=object(), marker_set=marker_set, trials=[seen]))


RESULT_LIMITS = {
    "P215 zero": (instrument(zero_offsets, ZERO, ZERO_PRIOR_N.sd, "N", axis="x"), 4.8, 4.95, [], ["CORRECTED"]),
    "P223 gain": (instrument(plate_errors.gains, GAIN, PLATE_PRIOR["gain"].sd, "1"), 0.0139, 0.0141, [], ["CORRECTED"]),
    "P223 trial_gain": (
        lambda size: plate_errors.gains(
            context(
                error(GAIN, 0.0, 0.007, 0.01, "1"),
                error(
                    GAIN,
                    size,
                    float(np.hypot(PLATE_PRIOR["gain"].sd, TRIAL_GAIN_PRIOR.sd)),
                    1e-5,
                    "1",
                    trial="walk",
                ),
            )
        ),
        0.0355,
        0.036,
        [],
        ["CORRECTED"],
    ),
    "P234 rotation": (
        instrument(plate_errors.plate_rotation, ROTATION, both("turn"), "rad"),
        0.040,
        0.0405,
        [],
        ["CORRECTED"],
    ),
    "P234 largest": (
        instrument(plate_errors.plate_rotation, ROTATION, both("turn"), "rad"),
        0.173,
        0.176,
        ["CORRECTED"],
        ["WARNING"],
    ),
    "P237 rotation": (one_of_two, 0.040, 0.0405, [], ["CORRECTED"]),
    "P237 largest": (one_of_two, 0.173, 0.176, ["CORRECTED"], ["WARNING"]),
    "P235 of_all": (lambda rad, patched: undetectable(rad, 0.01, patched), 0.0345, 0.0355, [], ["INFO"]),
    "P235 of_one": (lambda rad, patched: undetectable(0.01, rad, patched), 0.069, 0.071, [], ["INFO"]),
    "P246 position": (
        instrument(plate_errors.plate_positions, POSITION, both("x"), "m", axis="x"),
        0.0095,
        0.0097,
        [],
        ["CORRECTED"],
    ),
    "P247 difference": (lambda m, patched: ambiguous(patched, difference_m=m), 0.0067, 0.0069, [], ["WARNING"]),
    "P247 better": (lambda share, patched: ambiguous(patched, apart_m=0.01 * share), 0.71, 0.69, [], ["WARNING"]),
    "P247 hardly": (lambda m, patched: ambiguous(patched, each_m=m), 0.0039, 0.0041, [], ["WARNING"]),
    "P248 matters": (displaced, 0.0149, 0.0151, [], ["INFO"]),
    "P265 less": (reversed_moments, 0.81, 0.79, [], ["WARNING"]),
    "P267 error": (
        instrument(plate_errors.free_moments, FREE_MOMENT, PLATE_PRIOR["free moment"].sd, "N m/N"),
        0.00145,
        0.00148,
        [],
        ["CORRECTED"],
    ),
    "T214 delay": (
        instrument(delays, DELAY, DELAY_PRIOR_S.sd, "s", plate=None, moved=0.0),
        0.0069,
        0.0071,
        [],
        ["CORRECTED"],
    ),
    "T215 trial_delay": (
        lambda size: delays(
            context(
                error(DELAY, size, TRIAL_DELAY_PRIOR_S.sd, 1e-6, "s", plate=None, moved=0.0, trial="walk"),
                trials={"walk": walking(), "other": walking()},
            )
        ),
        0.0039,
        0.0041,
        [],
        ["CORRECTED"],
    ),
    "M162 moved": (marker_off, 0.0299, 0.0301, [], ["WARNING"]),
    "M162 at_shoulder": (lambda m: marker_off(m, True), 0.0745, 0.0755, [], ["WARNING"]),
    "S113 share": (estimated_mass, 74.05, 74.15, [], ["WARNING"], lambda share: 70 * (1 + share) + 2),
    "S113 share; lighter": (
        lambda kg: estimated_mass(70.0 - kg),
        4.05,
        4.15,
        [],
        ["WARNING"],
        lambda share: 70 * share + 2,
    ),
    "S407 distance": (item, 2.05, 1.95, [], ["WARNING"]),
    "S501 apart": (unlike_others, 2.95, 3.05, [], ["WARNING"]),
    "R107 share": (mass_of_the_motion, 74.4, 74.6, [], ["WARNING"], lambda share: 70 * (1 + share) + 1),
    "R203 distance": (far_from_prior, 2.95, 3.05, [], ["WARNING"]),
    "R203 plain": (far_from_prior, 3.95, 4.05, ["WARNING"], ["ERROR"]),
    "R203 segments": (lambda count: far_from_prior(3.5, count), 2, 3, ["WARNING"], ["ERROR"]),
    "R203 centre": (centre_off, 0.099, 0.101, [], ["ERROR"]),
    "R301 rms_force": (lambda n: residual(n, 0), 4.9, 5.1, [], ["WARNING"]),
    "R301 acceptable_rms_force": (lambda n: residual(n, 1), 9.9, 10.1, ["WARNING"], ["ERROR"]),
    "R301 peak_force": (lambda n: residual(n, 2, True), 9.9, 10.1, [], ["WARNING"]),
    "R301 acceptable_peak_force": (lambda n: residual(n, 0, True), 24.9, 25.1, ["WARNING"], ["ERROR"]),
    "R301 harmless": (lambda share: residual(7.0, 0, mass_kg=7.0 / share), 0.112, 0.108, ["WARNING"], ["INFO"]),
    "R302 rms_moment": (lambda n: residual(n, 3), 29.9, 30.1, [], ["WARNING"]),
    "R302 acceptable_rms_moment": (lambda n: residual(n, 4), 49.9, 50.1, ["WARNING"], ["ERROR"]),
    "R302 peak_moment": (lambda n: residual(n, 5, True), 49.9, 50.1, [], ["WARNING"]),
    "R302 acceptable_peak_moment": (lambda n: residual(n, 3, True), 74.9, 75.1, ["WARNING"], ["ERROR"]),
    "R303 share": (
        lambda n: residual(n, 0, True, external_n=100.0),
        4.9,
        5.1,
        [],
        ["ERROR"],
        lambda share: 100 * share,
    ),
    "R304 markers": (marker_errors, 0.0119, 0.0121, [], ["WARNING"]),
    "R304 acceptable_markers": (marker_errors, 0.0199, 0.0201, ["WARNING"], ["ERROR"]),
    "O202 heavy": (without_inertia, 0.49, 0.51, ["WARNING"], ["ERROR"]),
    "O203 density": (dense, 4950.0, 5050.0, [], ["WARNING"]),
    "O204 radius": (large, 0.59, 0.61, [], ["ERROR"]),
    "O204 negligible": (lambda kg: large(0.7, kg), 0.099, 0.101, ["WARNING"], ["ERROR"]),
    "O206 heaviest": (lambda kg: mass_unit(massive(kg)), 299.0, 301.0, [], ["ERROR"]),
    "O206 lightest": (lambda kg: mass_unit(massive(kg)), 1.01, 0.99, [], ["ERROR"]),
    "O213 share": (stated, 1.019, 1.021, [], ["WARNING"], lambda share: 1 + share),
    "O213 error": (stated, 1.099, 1.101, ["WARNING"], ["ERROR"], lambda share: 1 + share),
    "O213 error; in a fit": (
        lambda ratio: stated(ratio, [UNMOVED]),
        1.099,
        1.101,
        [],
        ["WARNING"],
        lambda share: 1 + share,
    ),
    "O214 mass": (lambda size: uneven_sides("mass", size), 0.0095, 0.0105, [], ["WARNING"]),
    "O214 com": (lambda size: uneven_sides("com_x", size), 0.0049, 0.0051, [], ["WARNING"]),
    "O214 moment": (lambda size: uneven_sides("ixx", size), 0.047, 0.054, [], ["WARNING"]),
    "O301 farthest": (long, 1.49, 1.51, [], ["ERROR"]),
    "O301 smallest": (lambda m, patched: long(0.5, patched, m), 0.21, 0.19, [], ["ERROR"]),
    "O301 largest": (lambda m, patched: long(0.5, patched, m), 2.99, 3.01, [], ["ERROR"]),
    "O302 axis": (lambda rad, patched: unmirrored(patched, rad), 0.0865, 0.0880, [], ["WARNING"]),
    "O303 position": (lambda m, patched: unmirrored(patched, 0.0, m), 0.0149, 0.0151, [], ["WARNING"]),
    "O402 mirrored": (mirrored, 1.59, 1.61, [], ["ERROR"]),
    "O407 moved": (calibrated, 0.0549, 0.0551, [], ["WARNING"]),
    "O404 share": (model_of_size, 1.024, 1.026, [], ["WARNING"], lambda share: 1 + share),
    "O404 body": (model_of_size, 1.049, 1.051, ["WARNING"], ["ERROR"], lambda share: 1 + share),
    "O401 size": (model_of_size, 4.95, 5.05, [], ["ERROR"]),
}
