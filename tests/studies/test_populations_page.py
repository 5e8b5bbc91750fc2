"""The part of the page of populations that is made by the study."""

from validation.population_study import MeanAccuracy, PopulationAccuracy, PopulationsStudy, RucksackAccuracy
from validation.populations import populations_markdown


def test_part_of_the_page():
    rms, before = {"mass": 0.3, "CoM": 0.01, "inertia": 0.01}, {"mass": 0.6, "CoM": 0.02, "inertia": 0.02}
    study = PopulationsStudy(
        (PopulationAccuracy("children", "adults'", 4, rms, before, 0.93, 1.2, 2.4, unlike=0.25),),
        (MeanAccuracy("children", 4, 60, 0.3, 1.1, 0.95, 0.96),),
        (RucksackAccuracy(4, None, 0.9, 1.0, 1.0), RucksackAccuracy(4, 0.3, 0.4, 0.5, 1.0)),
    )
    text = populations_markdown(study)
    row = "| children | adults' | 0.30 / 0.60 | 10.0 / 20.0 | 0.010 / 0.020 | 1.20 / 2.40 | 93.0 % | 25 % |"
    assert row in text
    assert "4 people each." in text
    assert "Mean of 4 children: 60 parameters" in text
    assert "A rucksack of 10 kg, declared with unknown mass, 4 people." in text
