import copy
import pickle

import numpy as np
import pytest
from pydantic import ValidationError

from kinertia.estimation.simultaneous.instruments.priors import InstrumentPrior
from kinertia.settings import Attached, Instruments, Settings, Subject


def test_numbers_of_numpy_are_numbers():
    assert Settings(cutoff_hz=np.float32(6.0), force_cutoff_hz=np.int64(15)) == Settings(
        cutoff_hz=6.0, force_cutoff_hz=15
    )
    assert Subject(mass_kg=np.int64(60), height_m=np.float64(1.7)).mass_kg == 60.0
    place = np.array([-200, 300, 0])
    pack = Attached(name="pack", segment="torso", mass_kg=np.float64(10.0), on_scale=np.bool_(False), com_mm=place)
    assert (pack.mass_kg, pack.com_mm) == ((10.0, 0.1), (-200.0, 300.0, 0.0))


@pytest.mark.parametrize("wrong", [np.nan, np.array([6.0, 8.0]), True, "6"])
def test_a_cutoff_that_is_none(wrong):
    with pytest.raises(ValidationError, match="positive frequency in Hz"):
        Settings(cutoff_hz=wrong)


@pytest.mark.parametrize("known", [InstrumentPrior(), InstrumentPrior.stated(Instruments(plate_sd_mm=2.0))])
def test_what_is_known_of_instruments_goes_to_other_processes(known):
    """With it all that is prepared of a person."""
    for again in (pickle.loads(pickle.dumps(known)), copy.deepcopy(known)):
        assert (again.plate, again.floor, again.delay_s) == (known.plate, known.floor, known.delay_s)


@pytest.mark.parametrize(("written", "meant"), [("f", "female"), ("F", "female"), ("Female", "female"), ("m", "male")])
def test_sex_may_be_abbreviated(written, meant):
    assert Subject(name="A", sex=written).sex == meant
