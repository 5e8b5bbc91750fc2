import numpy as np
import pandas as pd
import pytest

from kinertia.findings.finding import Severity
from kinertia.io.ground_forces import read_forces, torque_columns
from kinertia.io.text.sto import write_sto
from recordings import here, is_here
from refusals import only, refused

GRAVITY = 9.80665


def plates_of(*files):
    """Plates of a force file, whatever was assumed."""
    return read_forces(*files)[0]


def column_group(force, point, torque, stems=("vx", "px", "mx")):
    """Columns of one plate: 100 samples of constant load, unloaded in the first ten."""
    loaded = np.arange(100) >= 10
    values = {}
    for stem, vector, elsewhere in zip(stems, (force, point, torque), (0.0, 300.0, 0.0), strict=True):
        for axis, value in zip("xyz", vector, strict=True):
            values[stem[:-1] + axis] = np.where(loaded, value, elsewhere)
    return values


FORCE, POINT, TORQUE = (10.0, 700.0, -20.0), (1.0, 0.0, 0.2), (0.0, 3.0, 0.0)
MOMENT = np.cross(POINT, FORCE) + TORQUE


@pytest.fixture
def write(tmp_path):
    def write(*groups, rate_hz=1000.0, **changes):
        columns = {name: values for group in groups for name, values in group.items()}
        table = pd.DataFrame(columns, index=pd.Index(np.arange(100) / rate_hz, name="time"))
        for name, change in changes.items():
            table.loc[table.index[change[0]], name] = change[1]
        path = tmp_path / "grf.mot"
        write_sto(path, table, in_degrees=False, name="grf")
        return path

    return write


EXTERNAL_FORCE = """<ExternalForce name="{name}">
  <applied_to_body>{body}</applied_to_body>
  <force_expressed_in_body>ground</force_expressed_in_body>
  <point_expressed_in_body>ground</point_expressed_in_body>
  <force_identifier>f{name}_v</force_identifier>
  <point_identifier>f{name}_p</point_identifier>
  <torque_identifier>f{name}_m</torque_identifier>
</ExternalForce>"""


@pytest.fixture
def write_xml(tmp_path):
    def write_xml(*names, body="calcn_r", replace=("", ""), datafile="grf.mot"):
        forces = "".join(EXTERNAL_FORCE.format(name=name, body=body) for name in names)
        loads = f"<objects>{forces}</objects><datafile>{datafile}</datafile>"
        document = f"<OpenSimDocument><ExternalLoads>{loads}</ExternalLoads></OpenSimDocument>"
        path = tmp_path / "loads.xml"
        path.write_text(document.replace(*replace) if replace[0] else document)
        return path

    return write_xml


def named(name):
    force = np.add(FORCE, (0.0, ord(name) - ord("A"), 0.0))
    return column_group(force, POINT, TORQUE, (f"f{name}_vx", f"f{name}_px", f"f{name}_mx"))


REAL = {
    "synthetic/walk_grf": ("synthetic/walk_grf.xml", ("r", "l")),
    "gait2354/subject01_walk1_grf": ("gait2354/subject01_walk1_grf.xml", ("r", "l")),
    "rajagopal_walk/grf_walk": ("rajagopal_walk/grf_walk.xml", ("r", "l")),
    "subject4/squats1_grf": ("subject4/squats1_external_forces.xml", ("r", "r", "r")),
    "subject4/walking1_grf": ("subject4/walking1_external_forces.xml", ("r", "r")),
}


@pytest.mark.parametrize("name", [name for name in REAL if is_here(f"{name}.mot")])
def test_whole_files_with_and_without_loads_file(file_of, name):
    xml, feet = REAL[name]
    by_name = plates_of(file_of(f"{name}.mot"))
    by_identifier = plates_of(file_of(f"{name}.mot"), file_of(xml))
    np.testing.assert_array_equal(by_name.force, by_identifier.force)
    np.testing.assert_array_equal(by_name.moment, by_identifier.moment)
    assert by_identifier.declared_feet == feet
    assert len(set(by_name.names)) == len(feet)


WEIGHTS = {
    "synthetic/walk_grf": (1.35, 1.94, 72.6),
    "gait2354/subject01_walk1_grf": (0.0, 2.5, 72.6),
    "rajagopal_walk/grf_walk": (0.6, 1.8, 85.0),
    "subject4/squats1_grf": (0.0, 13.45, 60.0),
    "subject4/static1_grf": (0.0, 5.16, 60.0),
}


@pytest.mark.parametrize("name", [name for name in WEIGHTS if is_here(f"{name}.mot")])
def test_mean_vertical_force_is_body_weight(file_of, name):
    start, end, mass_kg = WEIGHTS[name]
    plates = plates_of(file_of(f"{name}.mot"))
    during = (plates.time >= start) & (plates.time <= end)
    mean = plates.force[during, :, 1].sum(axis=1).mean() / GRAVITY
    assert mean == pytest.approx(mass_kg, rel=0.02)


@pytest.mark.parametrize("name", here(["synthetic/walk_grf.mot", "rajagopal_walk/grf_walk.mot"]))
def test_point_of_application_is_kept_where_loaded(file_of, name):
    plates = plates_of(file_of(name))
    loaded = plates.force[:, 0, 1] > 100
    x = plates.moment[loaded, 0, 2] / plates.force[loaded, 0, 1]
    assert x.min() > -1.0
    assert x.max() < 3.0
    assert not plates.moment[plates.force[..., 1] == 0].any()


STEMS = {
    "ground_force_vx": ("ground_force_vx", "ground_force_px", "ground_torque_x", None),
    "1_ground_force_vx": ("1_ground_force_vx", "1_ground_force_px", "1_ground_torque_x", None),
    "ground_force_r_vx": ("ground_force_r_vx", "ground_force_r_px", "ground_torque_r_x", "r"),
    "ground_force_1_vx": ("ground_force_1_vx", "ground_force_1_px", "ground_force_1_mx", None),
    "ground_moment_1_mx": ("ground_force_1_vx", "ground_force_1_px", "ground_moment_1_mx", None),
    "l_ground_force_vx": ("l_ground_force_vx", "l_ground_force_px", "l_ground_torque_x", "l"),
    "Left_force_vx": ("Left_force_vx", "Left_force_px", "Left_torque_x", "l"),
}


@pytest.mark.parametrize("case", STEMS)
def test_column_names(write, case):
    *stems, foot = STEMS[case]
    plates, findings = read_forces(write(column_group(FORCE, POINT, TORQUE, stems)))
    assert plates.declared_feet == (foot,)
    assert findings == ()
    np.testing.assert_allclose(plates.force[10:, 0], np.tile(FORCE, (90, 1)))
    np.testing.assert_allclose(plates.moment[10:, 0], np.tile(MOMENT, (90, 1)))
    assert not plates.moment[:10].any()


def test_load_below_threshold_is_zero(write):
    group = column_group((1.0, 15.0, 1.0), (300.0, 0.0, 300.0), TORQUE, ("a_vx", "a_px", "a_mx"))
    plates, findings = read_forces(write(group))
    assert not plates.force.any()
    assert not plates.moment.any()
    assert findings == ()


def test_a_spike_is_bridged(write):
    """With the moment that the file makes of it."""
    group = column_group(FORCE, POINT, TORQUE, STEMS["ground_force_vx"][:3])
    sound, _ = read_forces(write(group))
    spiked, _ = read_forces(write(group, ground_force_vy=(50, FORCE[1] - 1500.0)))
    ((spike,),) = spiked.spikes
    assert (spike.axis, spike.size_n) == (1, pytest.approx(-1500.0))
    np.testing.assert_allclose(spiked.force, sound.force)
    np.testing.assert_allclose(spiked.moment, sound.moment, atol=1e-9)


def test_without_torque_the_free_moment_is_zero(write, write_xml):
    group = {name: values for name, values in named("A").items() if not name.startswith("fA_m")}
    for plates, findings in (
        read_forces(write(group)),
        read_forces(write(group), write_xml("A", replace=("fA_m", ""))),
        read_forces(write(group), write_xml("A", replace=("fA_m", "Unassigned"))),
    ):
        np.testing.assert_allclose(plates.moment[50, 0], np.cross(POINT, FORCE))
        assert findings == (), "P264 is seen in the loads themselves"


@pytest.mark.parametrize("stem", ["Ground_Force_", "GROUND_FORCE_R_", "1_Ground_Force_"])
def test_torques_are_recognised_in_capitals(write, stem):
    torque = stem.replace("Force", "Torque").replace("FORCE", "TORQUE")
    plates = plates_of(write(column_group(FORCE, POINT, TORQUE, (f"{stem}vx", f"{stem}px", f"{torque}x"))))
    np.testing.assert_allclose(plates.moment[-1, 0], MOMENT, atol=1e-9)


def test_identifiers_say_which_column_is_what(write, write_xml):
    path = write(named("A"), named("B"))
    plates = plates_of(path, write_xml("B", body="/bodyset/calcn_l"))
    assert plates.names == ("B",)
    assert plates.declared_feet == ("l",)
    assert plates_of(path, write_xml("A", body="LeftFoot")).declared_feet == (None,)


def test_datafile_is_used_only_without_a_force_file(write, write_xml, tmp_path):
    path = write(named("A"))
    assert plates_of(None, write_xml("A")).names == ("A",)
    assert plates_of(path, write_xml("A", datafile="gone.mot")).names == ("A",)
    with refused("F148", None, path="gone.mot", outcome="no file"):
        plates_of(None, write_xml("A", datafile="gone.mot"))
    with refused("F148", None, path="''"):
        plates_of(None, write_xml("A", datafile="Unassigned"))
    with pytest.raises(ValueError, match="force file or"):
        plates_of(None)


def test_datafile_as_windows_writes_it(write, write_xml, tmp_path):
    (tmp_path / "forces").mkdir()
    write(named("A")).rename(tmp_path / "forces" / "grf.mot")
    plates, findings = read_forces(None, write_xml("A", datafile=r"forces\grf.mot"))
    assert plates.names == ("A",)
    assert findings == ()


@pytest.mark.parametrize(
    "datafile", [r"C:\Users\anna\grf.mot", r"\\server\lab\grf.mot", "D:/lab/grf.mot", "/lab/grf.mot"]
)
def test_datafile_of_another_computer_is_looked_for_beside_the_loads(write, write_xml, datafile):
    write(named("A"))
    plates, findings = read_forces(None, write_xml("A", datafile=datafile))
    assert plates.names == ("A",)
    assert only(findings, "F148", path=datafile, outcome="grf.mot").severity is Severity.INFO
    with refused("F148", None, path=datafile.replace("grf", "gone")):
        plates_of(None, write_xml("A", datafile=datafile.replace("grf", "gone")))


@pytest.mark.parametrize("tag", ["<isDisabled> true </isDisabled>", "<appliesForce>false</appliesForce>"])
def test_disabled_loads_are_left_out(write, write_xml, tag):
    xml = write_xml("A", "B", replace=('name="A">', f'name="A">{tag}'))
    plates, findings = read_forces(write(named("A"), named("B")), xml)
    assert plates.names == ("B",)
    assert only(findings, "F147", load="A").severity is Severity.INFO
    with refused("F147", None, load="A"):
        plates_of(write(named("A")), write_xml("A", replace=('name="A">', f'name="A">{tag}')))


XML_TROUBLE = {
    "force body": (("force_expressed_in_body>ground", "force_expressed_in_body>hand"), "F146", {"entry": "force_exp"}),
    "point body": (("point_expressed_in_body>ground", "point_expressed_in_body>hand"), "F146", {"entry": "point_exp"}),
    "no point": (("fA_p", ""), "F143", {"load": "A", "identifier": "point_identifier"}),
    "no force": (("fA_v", ""), "F143", {"load": "A", "identifier": "force_identifier"}),
    "column": (("fA_p", "gA_p"), "F143", {"load": "A (loads.xml)", "identifier": "gA_px, gA_py, gA_pz"}),
    "not XML": (("</ExternalLoads>", ""), "F103", {"kind": "XML"}),
    "no loads": (("ExternalForce", "Force"), "F103", {"found": "ExternalForce"}),
}  # fmt: skip


@pytest.mark.parametrize("case", XML_TROUBLE)
def test_loads_file_trouble(write, write_xml, case):
    replace, code, evidence = XML_TROUBLE[case]
    with refused(code, **evidence):
        plates_of(write(named("A")), write_xml("A", replace=replace))


@pytest.mark.parametrize("body", ["hand_r", "/bodyset/torso", "pelvis", "tibia_l", "calcn_r", "toes_l", "LeftFoot", ""])
def test_loads_that_do_not_act_on_a_foot_are_refused(write, write_xml, body):
    force_file, xml = write(named("A")), write_xml("A", body=body)
    name = body.rsplit("/", 1)[-1]
    if name in ("hand_r", "torso", "pelvis", "tibia_l"):
        with refused("F149", None, load="A") as caught:
            plates_of(force_file, xml)
        assert caught.value.finding.where.part == name
    else:
        assert plates_of(force_file, xml).names == ("A",)


CROSSED = {
    "same force": (("fB_v", "fA_v"), "F144", ("the force of A", "the force of B", "fA_v")),
    "same point": (("fB_p", "fA_p"), "F144", ("the point of A", "the point of B", "fA_p")),
    "force as torque": (("fB_m", "fB_v"), "F144", ("the torque of B", "the force of B", "fB_v")),
    "point as torque": (("fA_m", "fA_p"), "F144", ("the torque of A", "the point of A", "fA_p")),
    "torque of the other": (("fB_m", "fA_m"), "F145", ("B", "fA_v", "fA_m")),
}


@pytest.mark.parametrize("case", CROSSED)
def test_identifiers_of_another_load(write, write_xml, case):
    replace, code, (owner, other, identifier) = CROSSED[case]
    force_file = write(named("A"), named("B"))
    assert plates_of(force_file, write_xml("A", "B")).names == ("A", "B")
    both = {"other": owner, "load": other} if code == "F144" else {"load": owner, "owner": other, "what": "torque"}
    with refused(code, None, identifier=identifier, **both) as caught:
        plates_of(force_file, write_xml("A", "B", replace=replace))
    assert caught.value.path.name == "loads.xml"


def test_a_load_that_is_there_twice_is_refused(write):
    """By plate and by foot, as some converters write it: the person would weigh twice as much."""
    unused = column_group((0, 0, 0), POINT, TORQUE, ("f2_vx", "f2_px", "f2_mx"))
    foot = column_group(FORCE, POINT, TORQUE, ("r_vx", "r_px", "r_mx"))
    still = {name.replace("f2", "f3"): values for name, values in unused.items()}
    assert plates_of(write(named("A"), unused, still)).names == ("fA", "f2", "f3")
    with refused("F144", None, load="r", other="fA", identifier="r_v"):
        plates_of(write(named("A"), unused, foot))


def test_torques_that_nobody_measured_may_be_one_column(write, write_xml):
    still = {f"none_{axis}": np.zeros(100) for axis in "xyz"}
    xml = write_xml("A", "B", replace=("fA_m", "none_"))
    xml.write_text(xml.read_text().replace("fB_m", "none_"))
    assert plates_of(write(named("A"), named("B"), still), xml).names == ("A", "B")


def test_missing_column_lists_those_that_exist(write, write_xml):
    with refused("F143", None, found="fB_vx, fB_vy") as caught:
        plates_of(write(named("B")), write_xml("A"))
    assert caught.value.path.name == "grf.mot"


def test_no_force_columns(write):
    with refused("F141", None, columns="knee_x, knee_y, knee_z"):
        plates_of(write({f"knee_{axis}": np.zeros(100) for axis in "xyz"}))
    with refused("F142", None, force="a_vx", expected="a_px"):
        plates_of(write({f"a_v{axis}": np.zeros(100) for axis in "xyz"}))


def test_nan_in_loaded_rows(write):
    with refused("F172", None, what="fA_pz", time_s=0.02):
        plates_of(write(named("A"), fA_pz=(20, np.nan)))
    with refused("F172", None, what="fA_vx", time_s=0.002):
        plates_of(write(named("A"), fA_vx=(2, np.nan)))
    assert plates_of(write(named("A"), fA_pz=(2, np.nan))).force.any()


def test_force_that_points_down(write):
    with refused("F157", None, force_n=-700.0, column="fA_vy"):
        plates_of(write(column_group((0, -700, 0), POINT, TORQUE, ("fA_vx", "fA_px", "fA_mx"))))


def test_uneven_time(write, tmp_path):
    path = write(named("A"))
    path.write_text(path.read_text().replace("\n0.050000000000000003\t", "\n0.04\t"))
    with refused("T101", None, time_s=0.049, after="0.04 s", usual_s=0.001):
        plates_of(path)
    lines = write(named("A")).read_text().replace("nRows=100", "nRows=90").split("\n")
    path.write_text("\n".join(lines[:50] + lines[60:]))
    with refused("T101", None):
        plates_of(path)


@pytest.mark.parametrize(("unit", "step"), [("milliseconds", 5 / 3), ("numbers of samples", 1.0)])
def test_times_in_another_unit_than_seconds(tmp_path, unit, step):
    """Forces of 600 Hz: read as seconds, two of them lay among the markers, and "use a longer trial" was the advice."""
    path = forces_at(tmp_path / "grf.mot", step * np.arange(300))
    with refused("T106", None, step_s=step):
        plates_of(path)


def forces_at(path, time):
    """A force file whose vertical force is the number of the sample, with these times."""
    count = np.arange(len(time), dtype=float)
    zero = np.zeros(len(time))
    columns = {f"fA_{stem}{axis}": count if stem + axis == "vy" else zero for stem in "vpm" for axis in "xyz"}
    write_sto(path, pd.DataFrame(columns, index=pd.Index(time, name="time")), in_degrees=False, name="grf")
    return path


@pytest.mark.parametrize(("rate_hz", "decimals"), [(2000, 3), (1200, 3), (960, 3), (600, 3), (1000, 2)])
def test_rounded_times_are_put_back_on_their_grid(tmp_path, rate_hz, decimals):
    true = 1.23 + np.arange(3000) / rate_hz
    loads, findings = read_forces(forces_at(tmp_path / "grf.mot", true.round(decimals)))
    np.testing.assert_allclose(loads.time, true, atol=0.3 * 10.0**-decimals)
    np.testing.assert_allclose(np.diff(loads.time), 1 / rate_hz, rtol=1e-4)
    rounded = only(findings, "T102", rounding_s=10.0**-decimals)
    assert rounded.evidence["rate_hz"].value == pytest.approx(rate_hz, rel=1e-4)


def test_exact_times_stay(tmp_path):
    true = np.arange(3000) / 1000
    loads, findings = read_forces(forces_at(tmp_path / "grf.mot", true.round(3)))
    np.testing.assert_array_equal(loads.time, true.round(3))
    assert findings == ()


@pytest.mark.parametrize(("rate_hz", "decimals"), [(2000, 3), (1200, 3), (1000, 3), (1000, 2)])
@pytest.mark.parametrize("place", [100, 1500, 2900])
def test_samples_lost_and_repeated_though_times_are_rounded(tmp_path, rate_hz, decimals, place):
    frames = np.arange(3000)
    few = 1 if (rate_hz, decimals) == (1000, 3) else 40  # what is lost within one step of exact times is seen
    for kept in (np.delete(frames, slice(place, place + few)), np.insert(frames, place, frames[place : place + few])):
        with refused("T101", None):
            plates_of(forces_at(tmp_path / "grf.mot", (kept / rate_hz).round(decimals)))


@pytest.mark.parametrize(("rate_hz", "decimals"), [(2000, 8), (2000, 3), (1000, 3)])
@pytest.mark.parametrize("off", [1, -5, 40])
def test_a_last_sample_that_alone_is_off_is_left_out(tmp_path, rate_hz, decimals, off):
    time = np.arange(3000) / rate_hz
    time[-1] += off / rate_hz + (off == 1 and decimals == 3) * 0.002
    loads, findings = read_forces(forces_at(tmp_path / "grf.mot", time.round(decimals)))
    assert len(loads.time) == len(loads.force) == 2999
    np.testing.assert_allclose(np.diff(loads.time), 1 / rate_hz, rtol=1e-4)
    assert only(findings, "T105").severity is Severity.CORRECTED


@pytest.mark.parametrize("last", [[0.0], [0.0, 0.001], [5.0, 5.001]])
def test_of_few_samples_or_of_two_at_the_end_nobody_knows_which_are_off(tmp_path, last):
    with refused("T101", None):
        plates_of(forces_at(tmp_path / "grf.mot", np.array([0.0, 0.001, *last])))
    if len(last) > 1:
        with refused("T101", None):
            plates_of(forces_at(tmp_path / "grf.mot", np.concatenate((np.arange(3000) / 1000, last))))


def test_times_that_do_not_go_on(tmp_path):
    with refused("T101", None, time_s=0.0, after="0 s"):
        plates_of(forces_at(tmp_path / "grf.mot", np.zeros(100)))
    with refused("T101", None):  # whole seconds are too coarse to tell the rate
        plates_of(forces_at(tmp_path / "grf.mot", (np.arange(3000) / 1000).round()))


def test_torque_columns_are_described_by_their_horizontal_lever_arm():
    """The vertical torque counts in its RMS only; a plate whose point of application stands still has no lever arm."""
    force, point, torque = np.zeros((3, 200, 2, 3))
    force[..., 1] = 500.0
    point[:, 0] = np.linspace([0.0, 0.02, 0.0], [0.4, 0.02, 0.1], 200)
    torque[:] = 30.0, 100.0, 40.0
    moving, still = torque_columns(force, point, torque)
    assert moving.lever_arm_m == pytest.approx(0.1)
    assert moving.rms_nm == pytest.approx((30.0, 100.0, 40.0))
    assert (moving.belongs_to, moving.height_m) == (None, pytest.approx(0.02))
    assert np.isnan(still.lever_arm_m)
