"""Units of scans, guessed by how large furniture is."""

import numpy as np
import pytest

from kpred.shapes.unit import METRES, LengthUnit, guess_unit


@pytest.mark.parametrize("name", ["m", "cm", "mm"])
@pytest.mark.parametrize(
    ("category", "metres"), [("chair", (0.5, 0.9, 0.5)), ("table", (1.6, 0.74, 0.8)), ("cabinet", (0.8, 1.9, 0.4))]
)
def test_furniture_of_usual_size_shows_its_unit(name: str, category: str, metres: tuple[float, ...]) -> None:
    assert guess_unit(np.array(metres) / METRES[name], category) == LengthUnit(name, "guessed")


def test_what_has_no_plausible_unit_is_taken_as_metres_and_says_so() -> None:
    assert guess_unit(np.array([10.0, 7.0, 8.0]), "chair") == LengthUnit("m", "assumed")
    assert guess_unit(np.full(3, 1e-9), "chair") == LengthUnit("m", "assumed")
