"""A person whose mass is known walks (synthetic): what do forces and markers alone show of it?"""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.ambiguous_loads import Overhang
from kinertia.diagnostics.evidence.force_mass import force_mass
from kinertia.diagnostics.evidence.landmarks import owners_of
from kinertia.diagnostics.runner import explained
from kinertia.diagnostics.subject.mass import masses_of_trials, stated_mass
from kinertia.findings.finding import Severity
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.settings import Attached
from kinertia.synthetic.walk import walk, walking_subject
from kinertia.trial.data import FootLoads, Trial
from kinertia.trial.plate_signals import UnloadedReading
from people import codes, person
from recordings import LONG_WALKS, RUNS, SQUATS, WALKS

MASS_KG = {"synthetic": 72.6, "synthetic c3d": 72.6, "gait2354": 72.6, "rajagopal": 85.0}
POUND = 0.45359


@pytest.fixture(scope="module")
def made():
    return walk(walking_subject(), 1.2)


def trial(made, force=lambda time, force: force, name="walk") -> Trial:
    loads = np.array(made.foot_loads)
    loads[..., :3] = force(made.time[:, None, None], loads[..., :3])
    return Trial(
        name, made.markers, FootLoads(made.time, loads[..., :3], loads[..., 3:]), np.ones(len(made.time), bool)
    )


def mass_of(made, recorded):
    return force_mass(owners_of(made.skeleton), recorded)


def test_it_is_the_mass_of_the_body(made):
    mass = mass_of(made, trial(made))
    assert mass.mass_kg == pytest.approx(made.bsp.total_mass_kg, abs=2 * mass.sd_kg)
    assert 0.002 < mass.sd_kg / mass.mass_kg < 0.03
    np.testing.assert_allclose(mass.supported_kg, mass.mass_kg, rtol=0.15)


def test_markers_on_bodies_of_no_segment_are_left_out(made):
    """Backpacks and sockets of prostheses have markers, too."""
    owners, recorded = owners_of(made.skeleton), trial(made)
    carried = next(label for label, owner in owners.items() if owner == "torso")
    mass = force_mass({**owners, carried: "backpack"}, recorded)
    assert mass.mass_kg == pytest.approx(force_mass({**owners, carried: ""}, recorded).mass_kg, rel=1e-9)


def test_no_motion_of_ours_is_asked(made):
    """Markers of which no pose makes sense say the same as long as their centre moves as it does."""
    turned = replace(made.markers, positions=made.markers.positions[:, :, [2, 1, 0]])
    fine, odd = (mass_of(made, replace(trial(made), markers=markers)) for markers in (made.markers, turned))
    assert odd.mass_kg == pytest.approx(fine.mass_kg, rel=1e-9)


def test_gaps_change_little(made):
    positions = made.markers.positions.copy()
    positions[::7] = np.nan
    mass = mass_of(made, replace(trial(made), markers=replace(made.markers, positions=positions)))
    assert mass.mass_kg == pytest.approx(mass_of(made, trial(made)).mass_kg, rel=0.01)


def test_too_short_a_window_shows_nothing(made):
    short = replace(trial(made), measured=np.arange(len(made.time)) < 8)
    assert mass_of(made, short) is None


def test_velocity_at_the_ends_of_a_window_is_less_certain_where_a_body_moves_fast(made):
    """In runs it is wrong by up to 0.8 m/s, for which a sound mass of 72.8 kg was called 68.0 +- 1.3 kg."""
    bounced = made.markers.positions + [0.0, 0.1, 0.0] * np.sin(2.0 * np.pi * 2.0 * made.time)[:, None, None]
    of_part = replace(trial(made), measured=(made.time > 0.3) & (made.time < 0.65))
    masses = [
        mass_of(made, replace(of_part, markers=replace(made.markers, positions=positions)))
        for positions in (made.markers.positions, bounced)
    ]
    assert {mass.over for mass in masses} == {"the whole window"}
    walked, ran = (mass.sd_kg / mass.mass_kg for mass in masses)
    assert ran > 2.0 * walked


def test_the_end_of_a_step_weighs_nobody(made):
    """A trial that begins while a foot leaves the plate: forces of 3 to 10 kg were called those of another mass."""
    middle = made.time[0] + np.ptp(made.time) / 2
    tail = mass_of(made, trial(made, lambda time, force: force * np.clip(0.4 - 3.0 * (time - middle + 0.2), 0.0, 0.4)))
    assert not tail.is_borne
    assert mass_of(made, trial(made)).is_borne
    assert mass_of(made, trial(made, lambda time, force: 0.1 * force)).is_borne, "in other units"
    assert not replace(mass_of(made, trial(made)), time=np.linspace(0.0, 0.2, len(made.time))).is_borne, "too short"


def test_a_chair_is_found_though_the_mean_force_hardly_shows_it(made):
    total_kg, middle = made.bsp.total_mass_kg, made.time[0] + np.ptp(made.time) / 2

    def sitting(for_s):
        seat = np.clip(1.5 * for_s / 2 - np.abs(made.time - middle), 0, for_s / 2) / (for_s / 2)
        return trial(made, lambda time, force: force * (1.0 - 0.6 * seat[:, None, None]))

    begins, ends = mass_of(made, sitting(0.35)).unmeasured(total_kg).span_s
    assert begins < middle < ends
    assert ends - begins == pytest.approx(0.35, abs=0.15)
    assert mass_of(made, trial(made)).unmeasured(total_kg) is None
    gain = trial(made, lambda time, force: 0.7 * force)
    assert mass_of(made, gain).unmeasured(total_kg) is None, "all the time is not for a while"


@pytest.mark.parametrize(
    ("files", "mass_kg"),
    [(WALKS[name], mass_kg) for name, mass_kg in MASS_KG.items() if name in WALKS]
    + [(LONG_WALKS["synthetic"], 72.6), (RUNS["synthetic"], 72.6), (SQUATS["synthetic"], 72.6)],
)
def test_recordings_of_people_who_were_weighed(recording_of, files, mass_kg):
    recording = recording_of(*files)
    marker_set = choose_marker_set(recording.markers.labels)
    assert list(stated_mass(person([recording], marker_set=marker_set, mass_kg=mass_kg))) == []


@pytest.fixture
def lab(recording_of):
    """A walk, a static trial that was recorded without plates, and the marker set."""
    walked = recording_of(*WALKS["synthetic"])
    static = recording_of("synthetic/static.trc")
    return walked, static, choose_marker_set(static.markers.labels)


def by_plate(recording, *factors):
    """The recording with each plate's forces times a factor."""
    plates, factor = recording.plates, np.array(factors)[:, None]
    return replace(recording, plates=replace(plates, force=factor * plates.force, moment=factor * plates.moment))


def standing_on_plates(static, walked, mass_kg):
    """The static trial, with plates that carry this mass, half of it each, under the feet."""
    time, middle = static.markers.time, np.nanmean(static.markers.positions, axis=(0, 1))
    feet = [
        np.nanmean(static.markers.arranged(labels), axis=(0, 1))
        for labels in choose_marker_set(static.markers.labels).foot_labels().values()
    ]
    force = np.zeros((len(time), 2, 3))
    force[..., 1] = mass_kg * 9.80665 / 2
    point = np.array([[foot[0], 0.0, foot[2]] for foot in feet]) if len(feet) == 2 else middle
    plates = replace(
        walked.plates,
        time=time,
        force=force,
        moment=np.cross(np.broadcast_to(point, force.shape), force),
        corners=None,
        noise_n=None,
        unloaded=None,
        torques=None,
    )
    return replace(static, plates=plates)


@pytest.mark.parametrize(
    ("stated_kg", "found"),
    [
        (72.6, []),
        (72.6 * 1.02, []),
        (72.6 + 5.0, [("S111", Severity.WARNING)]),
        (72.6 - 5.0, [("S111", Severity.WARNING)]),
        (90.0, [("S111", Severity.ERROR)]),
        (60.0, [("S111", Severity.ERROR)]),
    ],
)
def test_a_stated_mass_that_the_forces_contradict(lab, stated_kg, found):
    walked, _, marker_set = lab
    findings = list(stated_mass(person([walked], marker_set=marker_set, mass_kg=stated_kg)))
    assert [(finding.code, finding.severity) for finding in findings] == found
    for finding in findings:
        assert finding.evidence["mass_by_force_kg"].value == pytest.approx(72.6, abs=1.5)
        assert finding.evidence["stated_kg"].value == stated_kg
        assert any("handrail" in cause for cause in finding.causes) == (stated_kg > 72.6)


def test_a_declared_rucksack_is_not_accused(lab):
    """D6: it was, by the method of `check`."""
    walked, _, marker_set = lab
    pack = Attached(name="rucksack", segment="torso", mass_kg="8 +- 0.2", com_mm=[-200, 300, 0], on_scale=False)
    stated = {"marker_set": marker_set, "mass_kg": 64.6}
    assert codes(stated_mass(person([walked], **stated))) == ["S111"]
    assert codes(stated_mass(person([walked], attached=[pack], **stated))) == []


def test_mass_in_pounds_and_forces_in_other_units(lab):
    walked, _, marker_set = lab
    pounds = explained(stated_mass(person([walked], marker_set=marker_set, mass_kg=72.6 / POUND)))
    assert [finding.code for finding in pounds if finding.is_open] == ["S112"]
    kilograms = explained(
        stated_mass(person([by_plate(walked, 0.10197, 0.10197)], marker_set=marker_set, mass_kg=72.6))
    )
    open_ = [(finding.code, finding.severity) for finding in kilograms if finding.is_open]
    assert open_ in ([], [("P202", Severity.ERROR)]), "hardly a load is left in some"


@pytest.mark.parametrize("mass_kg", [30.0, 72.6, 160.0])
def test_forces_in_percent_of_body_weight_are_no_wrong_mass(lab, mass_kg):
    """All of them correspond to 10.2 kg, and "correct the mass" was the remedy."""
    walked, _, marker_set = lab
    share = 100.0 / (72.6 * GRAVITY_M_S2)
    found = explained(stated_mass(person([by_plate(walked, share, share)], marker_set=marker_set, mass_kg=mass_kg)))
    (unit,) = [finding for finding in found if finding.is_open]
    assert (unit.code, unit.severity, unit.evidence["unit"].value) == ("P202", Severity.ERROR, "% of body weight")


def causes_of(found):
    return found.causes[0], found.remedy


def test_a_wrong_mass_comes_first_where_plates_and_static_trial_agree(lab):
    """Whoever corrects it makes things better."""
    walked, static, marker_set = lab
    stood = standing_on_plates(static, walked, 72.6)
    (found,) = stated_mass(person([walked], stood, marker_set, mass_kg=79.0))
    assert found.where.trial is None, "of all occasions together"
    assert found.evidence["static_kg"].value == pytest.approx(72.6, abs=0.2)
    assert causes_of(found) == ("a wrong stated mass", "Correct the mass.")


def test_the_light_plate_comes_first_where_plates_differ(lab):
    """Whoever corrects the mass makes things worse."""
    walked, _, marker_set = lab
    for factors, name in (((1.0, 0.85), 1), ((0.85, 1.0), 0), ((1.15, 1.0), 0)):
        spoilt = by_plate(walked, *factors)
        (found,) = stated_mass(person([spoilt], marker_set=marker_set, mass_kg=72.6))
        plate = spoilt.plates.names[name]
        assert causes_of(found) == (f"gain or zero of {plate}", f"Check {plate} with a known weight.")


@pytest.mark.parametrize("factor", [0.93, 1.07])
def test_the_plates_come_first_where_the_static_trial_has_the_stated_mass(lab, factor):
    walked, static, marker_set = lab
    stood = standing_on_plates(static, walked, 72.6)
    (found,) = stated_mass(person([by_plate(walked, factor, factor)], stood, marker_set, mass_kg=72.6))
    assert found.where.trial == walked.name
    assert found.causes[0] == "gain or zero of the plates"
    assert "orrect the mass" not in found.remedy


def test_a_handrail_for_a_while(lab):
    """It explains why the mass is too small."""
    walked, _, marker_set = lab
    start, end = RecordingContext(walked, marker_set).trial.total_force_windows()[0]
    time, third = walked.plates.time, (end - start) / 3
    held = np.where((time > start + third) & (time < end - third), 0.4, 1.0)[:, None, None]
    plates = replace(walked.plates, force=held * walked.plates.force, moment=held * walked.plates.moment)
    found = explained(stated_mass(person([replace(walked, plates=plates)], marker_set=marker_set, mass_kg=72.6)))
    assert [finding.code for finding in found if finding.is_open] == ["P281"]
    assert found[0].evidence["missing"].value == pytest.approx(0.6, abs=0.2)


def test_where_only_the_end_of_a_step_is_on_a_plate_most_of_the_weight_is_on_none(lab):
    walked, _, marker_set = lab
    start, end = RecordingContext(walked, marker_set).trial.total_force_windows()[0]
    time = walked.plates.time
    left = (0.5 * np.clip((end - time) / (end - start), 0.0, 1.0) ** 6)[:, None, None]
    plates = replace(walked.plates, force=left * walked.plates.force, moment=left * walked.plates.moment)
    (found,) = stated_mass(person([replace(walked, plates=plates)], marker_set=marker_set, mass_kg=72.6))
    assert (found.code, found.severity) == ("P281", Severity.ERROR)
    assert found.evidence["missing"].value > 0.5


def test_a_static_trial_on_plates_is_weighed(lab):
    """Nothing is computed from its forces."""
    walked, static, marker_set = lab
    stood = standing_on_plates(static, walked, 60.0)
    (alone,) = stated_mass(person([], stood, marker_set, mass_kg=72.6))
    assert (alone.code, alone.severity, alone.where.trial) == ("S111", Severity.WARNING, static.name)
    (beside,) = stated_mass(person([walked], stood, marker_set, mass_kg=72.6))
    assert (beside.severity, beside.where.trial) == (Severity.INFO, static.name)


def test_two_occasions_that_agree_are_believed(lab):
    """Plates are not scaled to a mass that static trial and walk contradict by 7 %; one of them alone warns."""
    walked, static, marker_set = lab
    stood = standing_on_plates(static, walked, 72.6)
    (both,) = stated_mass(person([walked], stood, marker_set, mass_kg=67.5))
    (alone,) = stated_mass(person([walked], None, marker_set, mass_kg=67.5))
    assert (both.severity, alone.severity) == (Severity.ERROR, Severity.WARNING)
    assert [both.evidence[name].value for name in ("mass_by_force_kg", "stated_kg")] == [
        pytest.approx(72.6, abs=0.5),
        67.5,
    ]
    assert causes_of(both)[0] in ("a wrong stated mass", "a load that was worn or carried and not declared")


def on_one_plate(stood, level_n=0.0):
    """Both feet on the first plate, which reads so much more, all the time."""
    plates = stood.plates
    level = level_n * np.array([0.0, 1.0, 0.0])
    corners = np.array([[[2.0, 0.0, 2.0], [-2.0, 0.0, 2.0], [-2.0, 0.0, -2.0], [2.0, 0.0, -2.0]]] * 2)
    return replace(
        stood,
        plates=replace(
            plates,
            force=np.stack([plates.force.sum(axis=1) + level, 0.0 * plates.force[:, 0]], axis=1),
            moment=np.stack([plates.moment.sum(axis=1), 0.0 * plates.moment[:, 0]], axis=1),
            corners=corners,
            unloaded=(UnloadedReading((np.nan,) * 3, np.nan, 800.0, 0.0), UnloadedReading((0.0,) * 3, 0.0, 0.0, 0.0)),
        ),
    )


def test_both_feet_on_one_plate_are_weighed(lab):
    walked, static, marker_set = lab
    stood = on_one_plate(standing_on_plates(static, walked, 60.0))
    (found,) = stated_mass(person([], stood, marker_set, mass_kg=72.6))
    assert found.evidence["mass_by_force_kg"].value == pytest.approx(60.0, abs=0.1)


def test_one_foot_beside_the_plates_is_not_weighed(lab):
    walked, static, marker_set = lab
    stood = standing_on_plates(static, walked, 72.6)
    force, moment = stood.plates.force.copy(), stood.plates.moment.copy()
    force[:, 1], moment[:, 1] = 0.0, 0.0
    stood = replace(stood, plates=replace(stood.plates, force=force, moment=moment))
    assert list(stated_mass(person([], stood, marker_set, mass_kg=72.6))) == []


def test_a_plate_that_is_never_idle_in_the_static_trial_is_in_the_walk(lab):
    """It reads 60 N all day long."""
    walked, static, marker_set = lab
    stood = on_one_plate(standing_on_plates(static, walked, 72.6), level_n=60.0)
    unloaded = UnloadedReading((0.0, 60.0, 0.0), 0.0, 800.0, 0.0, subtracted=True)
    plates = replace(
        walked.plates, names=stood.plates.names, corners=stood.plates.corners, unloaded=(unloaded, unloaded)
    )
    assert list(stated_mass(person([replace(walked, plates=plates)], stood, marker_set, mass_kg=72.6))) == []
    assert codes(stated_mass(person([walked], stood, marker_set, mass_kg=72.6))) == ["S111"]


def test_a_foot_beyond_its_plate_leaves_the_other_plate(lab):
    """Where no window is left that weighs the person, the other foot's single support does."""
    walked, _, marker_set = lab
    context = person([walked], marker_set=marker_set, mass_kg=90.0)
    (trial,) = context.trials
    first, second = walked.plates.names
    trial.__dict__["force_mass"] = None
    trial.__dict__["plate_masses"] = {first: 72.6, second: 60.0}
    assert list(stated_mass(context)) == []
    trial.__dict__["overhangs"] = [Overhang(1, 1, 0.15, (0.5, 1.0), (0.5, 1.0))]
    (found,) = stated_mass(context)
    assert (found.code, found.evidence["mass_by_force_kg"].value) == ("S111", 72.6)
    assert found.where.trial == walked.name
    assert found.evidence["agreeing"].value == 1


def test_how_many_agree(lab):
    """Plates on one occasion, unless another occasion has the stated mass; else occasions."""
    walked, static, marker_set = lab
    stood = standing_on_plates(static, walked, 72.6)

    def agreeing(factors, static, mass_kg):
        (found,) = stated_mass(person([by_plate(walked, *factors)], static, marker_set, mass_kg=mass_kg))
        return found.evidence["agreeing"].value

    assert agreeing((1.0, 1.0), None, 67.5) == 2
    assert agreeing((1.0, 0.85), None, 72.6) == 1, "plates differ"
    assert agreeing((0.93, 0.93), stood, 72.6) == 1, "standing, it is the stated mass"
    assert agreeing((1.0, 1.0), stood, 79.0) == 2


def test_trials_of_different_masses(lab):
    """D11: the one that the others contradict, not the heavier one; both where nothing else is known."""
    walked, _, marker_set = lab
    light, heavy = by_plate(walked, 0.85, 0.85), replace(by_plate(walked, 1.02, 1.02), name="heavy")
    found = list(masses_of_trials(person([light, heavy], marker_set=marker_set)))
    assert [(finding.code, finding.where.trial) for finding in found] == [("S306", light.name), ("S306", "heavy")]
    for third in (replace(walked, name="third"), None):
        trials = [light, heavy, third] if third else [light, heavy]
        stated = {} if third else {"mass_kg": 72.6}
        found = list(masses_of_trials(person(trials, marker_set=marker_set, **stated)))
        assert {finding.where.trial for finding in found} == {light.name}
    assert list(masses_of_trials(person([walked, heavy], marker_set=marker_set))) == []
