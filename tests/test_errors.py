"""Errors keep what they carry on their way from another process."""

import pickle

import pytest

from kinertia import errors

ERRORS = [
    errors.FileError("subject.toml", "unknown key", line=3),
    errors.MarkerSetError("no marker LASI", ["LASI"], {"LASI": ["RASI"]}),
    errors.TrialError("walk", "no plates"),
    errors.SubjectError("mass_kg", 72600, "give kilograms"),
    errors.PriorError("impossible", "thigh_r.mass"),
    errors.SettingsError("cutoff_hz must be positive"),
    errors.SessionError("plates are told by their names"),
    errors.OsimError("scaled.osim", "a loop", 120, element="knee_r"),
]


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_errors_are_pickled_whole(error):
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert vars(again) == vars(error)
