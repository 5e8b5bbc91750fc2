"""Names and commands in a result's provenance, on Windows too."""

import shlex
from pathlib import PurePosixPath, PureWindowsPath

import pytest

from kinertia.io.file_names import command_line
from kinertia.io.subject.provenance import names_from_common_folder


@pytest.mark.parametrize(
    ("kind", "paths", "names"),
    [
        (PurePosixPath, ["/lab/static.c3d", "/lab/day 2/walk.c3d"], ["static.c3d", "day 2/walk.c3d"]),
        (PurePosixPath, ["/a/walk.c3d", "/b/walk.c3d"], ["a/walk.c3d", "b/walk.c3d"]),
        (PureWindowsPath, [r"C:\lab\static.c3d", r"C:\lab\day 2\walk.c3d"], ["static.c3d", "day 2/walk.c3d"]),
        (PureWindowsPath, [r"C:\static.c3d", r"D:\walk.c3d"], ["C:/static.c3d", "D:/walk.c3d"]),
        (PureWindowsPath, [r"\\server\lab\static.c3d", r"D:\walk.c3d"], ["//server/lab/static.c3d", "D:/walk.c3d"]),
    ],
)
def test_files_are_named_from_the_folder_that_holds_them_all(kind, paths, names):
    assert names_from_common_folder([kind(path) for path in paths]) == names


def test_a_command_can_be_typed_again():
    words = ["kinertia", "fit", "my walk.c3d", "-o", "it's"]
    assert shlex.split(command_line(words, windows=False)) == words
    assert command_line([r"C:\my data\walk.c3d", "out"], windows=True) == r'"C:\my data\walk.c3d" out'
