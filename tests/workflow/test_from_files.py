import pytest

from kinertia.errors import SettingsError
from kinertia.io.subject.person_recordings import read_inputs
from kinertia.io.subject.reader import read_subject, with_settings
from kinertia.io.subject.tables import InstrumentsFiles
from kinertia.settings import KnownSegment
from kinertia.workflow.from_files import prepare_subject
from kinertia.workflow.person import read_person

SUBJECT = """
[subject]
mass_kg = 72.6
[model]
osim = "{lab}/scaled.osim"
[[trial]]
markers = "{lab}/walk.trc"
forces = "{lab}/walk_grf.mot"
[[trial]]
markers = "{lab}/other.trc"
forces = "{lab}/other_grf.mot"
"""


@pytest.fixture
def subject(synthetic_lab, tmp_path):
    path = tmp_path / "subject.toml"
    path.write_text(SUBJECT.format(lab=synthetic_lab.as_posix()))
    return read_subject(path)


def test_columns_of_two_force_files_are_plates_of_their_own(subject):
    """One column may hold two steps in two places (subject4's walks): it is a foot's, not a plate's."""
    walk, other = (item.recording.plates.names for item in read_person(subject).trials)
    assert walk == ("1_ground_force (walk)", "2_ground_force (walk)")
    assert not set(walk) & set(other)


def test_one_trial_keeps_its_names(subject):
    (item,) = read_person(subject.model_copy(update={"trials": subject.trials[:1]})).trials
    assert item.recording.plates.names == ("1_ground_force", "2_ground_force")


def test_a_static_trial_is_missing_where_one_is_needed(subject):
    with pytest.raises(SettingsError) as caught:
        read_inputs(subject)
    assert (caught.value.finding.code, caught.value.finding.evidence["entry"].value) == ("F191", "[model]")


def test_a_prosthesis_is_no_mirror_image(c3d_lab):
    wanted = read_subject(c3d_lab / "subject.toml")
    wanted = wanted.model_copy(update={"segments": {"shank_l": KnownSegment(prosthesis=True)}})
    with pytest.raises(SettingsError, match=r"shank_l: a prosthesis does not mirror .* symmetry = false"):
        prepare_subject(with_settings(wanted, method="two-level"))
    two_level = prepare_subject(with_settings(wanted, method="two-level", symmetry=False))
    assert unused_entries(two_level) == ["[prior] and [segment]"]
    stated = wanted.model_copy(update={"instruments": InstrumentsFiles(plate_sd_mm=2.0, zeroed=True)})
    two_level = prepare_subject(with_settings(stated, method="two-level", symmetry=False))
    assert unused_entries(two_level) == ["[prior] and [segment]", "[instruments]"]
    assert not unused_entries(prepare_subject(stated))


def unused_entries(ready):
    return [finding.evidence["entry"].value for finding in ready.findings if finding.code == "F194"]
