"""Truth and errors of joint moments over whole stances, in their smallest form."""

import numpy as np
import pandas as pd
import pytest

pytest.importorskip("opensim")
stance_walks = pytest.importorskip("validation.stance_walks")
whole_stance = pytest.importorskip("validation.whole_stance")


def forces_of(right, left):
    """A forces file whose vertical forces are these, and everything else one."""
    index = pd.Index(0.1 * np.arange(len(right)), name="time")
    columns = [f"ground_{kind}_{side}_{end}" for side in "rl" for kind, end in (("force", "vx"), ("force", "px"))]
    forces = pd.DataFrame(1.0, index, columns)
    return forces.assign(ground_force_r_vy=np.array(right, float), ground_force_l_vy=np.array(left, float))


RIGHT = [0, 50, 50, 0, 0, 50, 50, 0, 0, 0]
LEFT = [50, 50, 0, 0, 50, 50, 0, 0, 50, 50]


def test_plates_take_a_whole_right_step_and_the_next_left_one():
    forces = forces_of(RIGHT, LEFT)
    two, single = (stance_walks.steps_on_plates(forces, steps) for steps in (2, 1))
    assert two["ground_force_r_vy"].tolist() == single["ground_force_r_vy"].tolist() == [0, 50, 50, 0, 0, 0, 0, 0, 0, 0]
    assert two["ground_force_l_vy"].tolist() == [0, 0, 0, 0, 50, 50, 0, 0, 0, 0]
    assert two["ground_force_l_px"].tolist() == [0, 0, 0, 0, 1, 1, 0, 0, 0, 0]
    assert not single.filter(like="_l_").to_numpy().any()
    assert forces["ground_force_l_vy"].tolist() == LEFT  # unchanged
    pd.testing.assert_frame_equal(stance_walks.steps_on_plates(forces, None), forces)


def test_frames_are_sorted_by_what_is_on_plates():
    forces = forces_of(RIGHT, LEFT)
    truth = pd.DataFrame({"knee_r_adduction": 1.0, "lumbar_bending": 2.0}, forces.index)
    values = truth.assign(knee_r_adduction=[4.0, np.nan, 2.0, 2.0, 2.0, 2.0, np.nan, 2.0, 2.0, 4.0])
    measured = np.array([False, False, True, True, False, False, False, False, False, False])
    sd, usual = truth * 0.0 + 0.4, truth + 3.0
    found = stance_walks.compared(values, sd, truth, usual, measured, forces)
    knee = found.loc["knee adduction", "r"]
    assert knee["where"].tolist() == ["inside", "inside", "swing", "stance", "swing", "swing"]  # without both ends
    assert knee["error"].tolist() == [1.0] * 6
    assert set(found.loc["lumbar bending"]["where"]) == {"inside", "outside"}
    rows = found.assign(all_steps=0.5)
    summary = stance_walks.summary(rows.loc[["knee adduction"]])
    assert (summary["error"], summary["usual"], summary["covered"]) == (1.0, 3.0, 0.0)
    assert whole_stance.component_row("knee adduction", summary) == [
        "knee adduction",
        "1.00",
        "0.50",
        "3.00",
        "0.4",
        "0 %",
    ]


def test_page_has_every_component_in_every_place():
    places = {what: ("inside", "stance", "swing") for what in whole_stance.LEG}
    places |= {what: ("inside", "outside") for what in whole_stance.LUMBAR}
    rows = [
        {"laboratory": "knees wrong", "seed": seed, "what": what, "where": where}
        | {"error": 2.0, "sd": 3.0, "usual": 8.0, "all_steps": 1.0, "true": 9.0}
        for seed in (100, 101)
        for what, where_all in places.items()
        for where in where_all
    ]
    page = whole_stance.document(pd.DataFrame(rows))
    assert "2 people" in page
    assert whole_stance.TITLES["knees wrong"] in page
    assert whole_stance.TITLES["two steps"] not in page
    assert page.count("| knee adduction | 2.00 | 1.00 | 8.00 | 1.5 | 100 % |") == 3
    assert page.count("| lumbar bending |") == 2


@pytest.fixture(scope="module")
def person(measured_folder, tmp_path_factory):
    """The gait2354 model, its walk's coordinates and splines through them."""
    import opensim

    from validation.opensim_runs import inverse_kinematics, quietly, radians
    from validation.truth_person import Person
    from validation.truth_trials import Spline, gait2354

    folder = tmp_path_factory.mktemp("person")
    with quietly(folder / "opensim.log"):
        model = opensim.Model(str(gait2354().model))
        for actuators in (model.updForceSet(), model.updControllerSet()):
            actuators.clearAndDestroy()
        model.finalizeConnections()
        model.printToXML(str(folder / "model.osim"))
        model = opensim.Model(str(folder / "model.osim"))
        model.initSystem()
        inverse_kinematics(model, gait2354().markers, folder / "ik.mot", span_s=gait2354().span_s)
        q = radians(model, folder / "ik.mot")
        return folder, Person(model), Spline(q.index.to_numpy(), q.to_numpy())


@pytest.mark.measured
def test_true_moments_at_hips_are_opensims(person):
    from kinertia.io.text.sto import read_sto, write_sto
    from validation.opensim_runs import inverse_dynamics, quietly
    from validation.truth_moments import three_dimensional_moments
    from validation.truth_trials import gait2354, ground_reactions, write_loads

    folder, model, motion = person
    time = motion.times(100.0)
    with quietly(folder / "opensim.log"):
        forces = ground_reactions(model, motion, read_sto(gait2354().forces))
        write_sto(folder / "forces.mot", forces, False, "forces")
        write_loads(folder / "loads.xml", "forces.mot")
        write_sto(folder / "motion.mot", pd.DataFrame(motion(time)[0], pd.Index(time), model.names), False, "motion")
        expected = inverse_dynamics(
            folder / "model.osim", folder / "motion.mot", folder / "loads.xml", folder / "moments.sto"
        )
        found = three_dimensional_moments(model, motion, forces, time)
    inner = slice(15, -15)  # OpenSim's splines end freely
    for side in "rl":
        for axis in ("flexion", "adduction", "rotation"):
            known, theirs = found[f"hip_{side}_{axis}"], expected[f"hip_{axis}_{side}_moment"]
            assert np.abs(known).max() > 1.0
            np.testing.assert_allclose(known.to_numpy()[inner], theirs.to_numpy()[inner], atol=0.05)
    lumbar, theirs = found["lumbar_flexion"], -expected["lumbar_extension_moment"]
    np.testing.assert_allclose(lumbar.to_numpy()[inner], theirs.to_numpy()[inner], atol=0.05)


@pytest.mark.measured
def test_knees_are_displaced_and_all_else_stays(person):
    import opensim

    from validation.opensim_runs import quietly
    from validation.truth_person import Person
    from validation.wrong_knees import displace_knees

    folder, model, _ = person
    path = folder / "wrong.osim"
    path.write_bytes((folder / "model.osim").read_bytes())
    with quietly(folder / "opensim.log"):
        displace_knees(path, 1)
        wrong = Person(opensim.Model(str(path)))
    places = []
    for posed in (model, wrong):
        posed.pose(np.zeros(len(posed.names)))
        names = [posed.model.getMarkerSet().get(k).getName() for k in range(posed.model.getMarkerSet().getSize())]
        knee = posed.model.getBodySet().get("tibia_r").getTransformInGround(posed.state).p().to_numpy()
        axis = posed.model.getBodySet().get("femur_r").getTransformInGround(posed.state).R()
        places.append((np.array([posed.marker(name)[0] for name in names]), knee, [axis.get(k, 2) for k in range(3)]))
    (markers, knee, axis), (same, moved, turned) = places
    np.testing.assert_allclose(markers, same, atol=1e-9)
    across = moved - knee
    assert 1e-4 < abs(across[2]) < 0.02
    assert np.abs(across[:2]).max() < 0.001
    assert 1e-3 < np.linalg.norm(np.subtract(turned, axis)) < 0.3
