import base64
from dataclasses import replace

import numpy as np

from kinertia.report.figures.skeleton_view import packed, scene, semi_axes


def test_scene_has_everything_where_it_is(fit):
    trial = fit.trials[0]
    shown = scene(fit, trial, 1000)
    pose = fit.skeleton.pose(trial.motion.q)
    torso = fit.skeleton.segments.index("torso")
    com = fit.estimate.com_m[fit.estimate.segments.index("torso")]
    np.testing.assert_allclose(
        shown.com[:, fit.estimate.segments.index("torso")],
        pose.rotation[:, torso] @ com + pose.translation[:, torso],
        atol=1e-12,
    )
    shift = (
        fit.estimate.com_m[fit.estimate.segments.index("torso")]
        - fit.literature.com_m[fit.literature.segments.index("torso")]
    )
    row = fit.estimate.segments.index("torso")
    np.testing.assert_allclose(
        shown.com[:, row] - shown.com_before[:, row], pose.rotation[:, torso] @ shift, atol=1e-12
    )
    distance = np.linalg.norm(shown.measured - shown.modelled, axis=2)
    np.testing.assert_allclose(
        np.sqrt(np.nanmean(distance**2)), np.sqrt(np.nanmean(trial.marker_errors_m["final"] ** 2)), rtol=1e-9
    )
    assert shown.bones.max() < shown.points.shape[1]
    assert len(shown.sides) == len(shown.bones)
    assert set(shown.sides) == {"r", "l", ""}


def test_arrows_stand_in_the_centre_of_pressure_and_show_the_force(fit):
    trial = fit.trials[0]
    arrows, loads = scene(fit, trial, 1000).arrows, trial.kinematics.foot_loads
    loaded = loads[:, :, 1] > 20
    assert (np.isfinite(arrows).all(axis=(2, 3)) == loaded).all()
    at, force = arrows[:, :, 0][loaded], loads[..., :3][loaded]
    np.testing.assert_allclose(np.cross(at, force)[:, [0, 2]], loads[..., 3:][loaded][:, [0, 2]], atol=1e-9)
    np.testing.assert_allclose(arrows[:, :, 1][loaded] - at, 1e-3 * force, atol=1e-12)


def test_the_page_carries_the_scene_to_half_a_millimetre(fit):
    shown = scene(fit, fit.trials[0], 1000)
    hidden = shown.measured.copy()
    hidden[3, 1] = np.nan
    content = packed(replace(shown, measured=hidden))
    back = {
        name: np.frombuffer(base64.b64decode(text), "<i2").reshape(len(content["time"]), content["count"][name], 3)
        for name, text in content["data"].items()
    }
    place = shown.centre.mean(axis=0) * [1, 0, 1]
    np.testing.assert_allclose(back["points"] / 1e3 + place, shown.points, atol=0.0011)
    assert (back["measured"][3, 1] == -32768).all()
    assert (back["measured"] == -32768).sum() == np.isnan(hidden).sum()


def test_long_trials_are_thinned(fit):
    assert len(scene(fit, fit.trials[0], 30).time) <= 30


def test_ellipsoids_have_the_mass_and_the_inertia_of_their_segments(fit):
    """A uniform ellipsoid with semi-axes a has the second moment of mass sum(a a^T) m / 5."""
    axes = semi_axes(fit.estimate)
    second = np.einsum("ska,skb,s->sab", axes, axes, fit.estimate.mass_kg / 5)
    inertia = np.trace(second, axis1=1, axis2=2)[:, None, None] * np.eye(3) - second
    np.testing.assert_allclose(inertia, fit.estimate.inertia_kgm2, atol=1e-12)


def test_a_body_that_cannot_be_has_no_ellipsoid(fit):
    impossible = fit.estimate.inertia_kgm2.copy()
    impossible[2] = np.diag([0.01, 0.01, 0.05])
    masses = fit.estimate.mass_kg.copy()
    masses[4] = 0.0
    axes = semi_axes(replace(fit.estimate, inertia_kgm2=impossible, mass_kg=masses))
    assert np.flatnonzero(np.isnan(axes).any(axis=(1, 2))).tolist() == [2, 4]


def test_ellipsoids_turn_with_their_segments(fit):
    trial = fit.trials[0]
    shown = scene(fit, trial, 1000)
    row = fit.estimate.segments.index("thigh_r")
    rotation = fit.skeleton.pose(trial.motion.q).rotation[:, fit.skeleton.segments.index("thigh_r")]
    turned = np.einsum("nij,kj->nki", rotation, semi_axes(fit.estimate)[row])
    np.testing.assert_allclose(shown.ellipsoids[:, row], turned, atol=1e-12)
