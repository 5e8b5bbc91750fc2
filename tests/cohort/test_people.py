"""Who is in a study: folders, and rows of a CSV file."""

import pytest

from kinertia.cohort.people import Participant, people_of
from kinertia.errors import FileError
from kinertia.io.file_names import command_line


def person(folder, *files):
    folder.mkdir(parents=True)
    for name in files:
        (folder / name).touch()
    return folder


def test_every_folder_with_a_subject_file_is_a_person(tmp_path):
    anna = person(tmp_path / "Anna", "subject.toml", "walk.c3d")
    ben = person(tmp_path / "Ben", "ben.toml")
    person(tmp_path / "notes", "read me.txt")
    person(tmp_path / ".git", "subject.toml")
    person(tmp_path / "out", "subject.toml")
    people = people_of(tmp_path, tmp_path / "out")
    assert people == [Participant("Anna", anna / "subject.toml"), Participant("Ben", ben / "ben.toml")]


def test_who_lacks_a_subject_file_is_named_with_what_to_do(tmp_path):
    clara = person(tmp_path / "Clara Z", "static.c3d", "walk.C3D")
    person(tmp_path / "Dora", "one.toml", "two.toml")
    emil = person(tmp_path / "Emil")
    (emil / "walk.csv").write_text("Trajectories\n100\nFrame,Sub Frame,X,Y,Z\n", encoding="utf-8")
    person(tmp_path / "lists", "people.csv")
    first, two, three = people_of(tmp_path, tmp_path / "out")
    assert three == Participant("Emil", None, f"no subject file; kinertia init {emil} drafts one")
    assert first == Participant(
        "Clara Z", None, f"no subject file; {command_line(['kinertia', 'init', str(clara)])} drafts one"
    )
    assert two.subject is None
    assert "one.toml" in two.problem


def test_nobody_is_dropped_whose_files_are_one_folder_deeper_or_not_fetched(tmp_path):
    anna = person(tmp_path / "Anna" / "2026-05-03", "subject.toml").parent
    person(anna / "2026-06-10", "walk.c3d")
    person(tmp_path / "__MACOSX" / "Anna", "._walk.c3d")
    person(tmp_path / "Ben", "._subject.toml", "subject.toml", "._walk.c3d")
    person(tmp_path / "Clara", "clara.toml", "._clara.toml")
    person(tmp_path / "lists" / "old", "people.csv")
    try:
        person(tmp_path / "Dora").joinpath("walk.c3d").symlink_to("not fetched")
    except OSError:
        pytest.skip("this system allows no links")
    people = {participant.name: participant for participant in people_of(tmp_path, tmp_path / "out")}
    assert [*people] == ["Anna", "Ben", "Clara", "Dora"]
    assert people["Anna"].problem.startswith(
        "no subject file, but there are files in its folders 2026-05-03, 2026-06-10;"
    )
    assert people["Ben"].subject == tmp_path / "Ben" / "subject.toml"
    assert people["Clara"].subject == tmp_path / "Clara" / "clara.toml"
    assert people["Dora"].problem.startswith("no subject file; kinertia init")


def test_a_row_may_name_the_folder_of_a_subject_file(tmp_path):
    person(tmp_path / "Anna", "subject.toml")
    person(tmp_path / "Ben", "mine.toml")
    person(tmp_path / "Clara", "one.toml", "two.toml")
    table = tmp_path / "people.csv"
    table.write_text("name;subject\n;Anna\n;Ben/\n;Clara\nDora;Dora\n", encoding="utf-8")
    anna, ben, clara, dora = people_of(table, tmp_path / "out")
    assert (anna.name, anna.subject) == ("Anna", tmp_path / "Anna" / "subject.toml")
    assert (ben.name, ben.subject) == ("Ben", tmp_path / "Ben" / "mine.toml")
    assert (clara.name, clara.subject) == ("Clara", None)
    assert "one.toml" in clara.problem
    assert dora.subject == tmp_path / "Dora"


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_rows_name_subject_files_from_where_the_table_is(separator, tmp_path):
    rows = [
        ("name", "subject", "age"),
        ("", "a/subject.toml", "7"),
        ("", "b/S02.toml", ""),
        ("Zoë", "c\\subject.toml", ""),
    ]
    person(tmp_path / "c", "subject.toml")
    table = tmp_path / "people.csv"
    table.write_text("\n".join(separator.join(row) for row in rows), encoding="utf-8-sig")
    expected = [Participant("a", tmp_path / "a" / "subject.toml"), Participant("S02", tmp_path / "b" / "S02.toml")]
    assert people_of(table, tmp_path / "out") == [*expected, Participant("Zoë", tmp_path / "c" / "subject.toml")]


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("file,name\na.toml,A\n", 1, "F103"),
        ("", None, "F104"),
        ("subject\n", 1, "no rows"),
        ("subject,name\na.toml,A\n,B\n", 3, "'subject' is empty"),
        ("subject,name\na.toml,A\nb.toml,B\nc.toml,a\n", 4, "'a' is there and so is 'A'"),
        ("subject\nx/s.toml\ny/s.toml\n", 3, "'s' is there twice"),
        ("subject,name\na.toml,a:b\n", 2, "'a:b' cannot be the name of a folder"),
        ("subject,name\na.toml,.a\n", 2, "'.a' cannot be the name of a folder"),
        (f"subject,name\na.toml,{'ü' * 101}\n", 2, "üüü' cannot be the name of a folder"),
        ("name,subject,Subject\nA,a.toml,b.toml\n", 1, "F113"),
    ],
)
def test_a_table_that_cannot_be_says_where(text, line, words, tmp_path):
    table = tmp_path / "people.csv"
    table.write_text(text, encoding="utf-8")
    with pytest.raises(FileError, match=words) as caught:
        people_of(table, tmp_path / "out")
    assert caught.value.line == line


def test_no_study_and_nobody_in_it_are_errors(tmp_path):
    with pytest.raises(FileError, match="no such folder or file"):
        people_of(tmp_path / "nowhere", tmp_path / "out")
    with pytest.raises(FileError, match="none of its folders"):
        people_of(tmp_path, tmp_path / "out")
    (tmp_path / "latin.csv").write_bytes("subject\nZo\xeb.toml\n".encode("latin-1"))
    with pytest.raises(FileError, match="not in UTF-8"):
        people_of(tmp_path / "latin.csv", tmp_path / "out")
