"""A handful of messages as people read them; everything else about them is tested by codes and evidence."""

import pytest

import fuzz
from kinertia.errors import FileError
from kinertia.findings.finding import finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.io.subject.reader import read_subject
from kinertia.io.text.trc import read_trc


@pytest.fixture
def small(tmp_path):
    """A folder with a sound file of every format."""
    fuzz.write_files(tmp_path)
    return tmp_path


def spoilt(path, old, new):
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return path


CASES = [
    (
        "walk.trc",
        "DataRate",
        "Rate",
        "{file}, line 2: F114 In the header, DataRate is missing; expected one value of each. "
        "Correct the header, or export the file again.",
    ),
    (
        "walk.trc",
        "\n2\t0.010000000",
        "\n2\t0,010000000",
        "{file}, line 8: F105 Found '0,010000000' in column 2; expected a number with a decimal point. "
        "Repair the row, or export the file again with decimal points.",
    ),
    (
        "walk.trc",
        "\n2\t0.010000000",
        "\n2\t0.030000000",
        "{file}, line 9: T101 Time goes from 0.03 s to 0.02 s, where its usual step is 0.01 s. "
        "Export every frame or sample.",
    ),
    (
        "subject.toml",
        "mass_kg = 70.0",
        "mas_kg = 70.0",
        "{file}, line 4: F191 unknown key 'mas_kg' in [subject]: the nearest is 'mass_kg'. Correct the entry.",
    ),
    (
        "subject.toml",
        "cutoff_hz = 6.0",
        "cutoff_hz = 0.0",
        '{file}, line 18: F191 cutoff_hz = 0.0: must be "gcv" or a positive frequency in Hz. Correct the entry.',
    ),
    (
        "subject.toml",
        'forces = "walk.mot"',
        'forces = "wakl.mot"',
        "{file}, line 13: F101 There is no wakl.mot in {folder}. Correct the path: the nearest names there: "
        "walk.mot, walk.tsv, walk.trc.",
    ),
]


@pytest.mark.parametrize(("name", "old", "new", "message"), CASES)
def test_an_error_is_one_line_of_sentences(small, name, old, new, message):
    path = spoilt(small / name, old, new)
    with pytest.raises(FileError) as caught:
        (read_trc if name == "walk.trc" else read_subject)(path)
    assert str(caught.value) == message.format(file=path, folder=small)


def test_what_a_reader_assumed_is_a_sentence():
    place = Where("walk.c3d", plate="plate 1")
    assert [
        finding("F157", place, force_n=Quantity(-712.0, "N")).message,
        finding("F122", place, extent_m=Quantity(1.71, "m"), unit=Quantity("mm")).message,
        finding("F151", place, reason=Quantity("it has no samples")).message,
    ] == [
        "The force of plate 1 points down (-712 N): it is the force on the plate.",
        "No unit of length is given; mm was used, by which the markers reach 1.71 m.",
        "plate 1 cannot be used: it has no samples.",
    ]
