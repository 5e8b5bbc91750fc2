"""Columns of force files are told from the trials whose names they carry, whatever brackets either has."""

import pytest

from kinertia.trial.trial_input import columns_of_several_trials, plate_of_trial


@pytest.mark.parametrize("trials", [("walk 1", "walk 2"), ("walk", "walk (1)"), ("walk (1)", "walk (2)")])
@pytest.mark.parametrize("columns", [("right", "left"), ("plate (right)", "plate (left)")])
def test_the_same_column_of_two_trials(columns, trials):
    plates = [plate_of_trial(column, trial) for trial in trials for column in columns]
    assert columns_of_several_trials(plates) == ((0, 2), (1, 3))


def test_plates_of_a_laboratory_are_no_columns():
    assert columns_of_several_trials(["plate 1", "plate 2", "FP"]) == ()
