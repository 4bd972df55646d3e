from __future__ import annotations

import pytest

from tsis.errors import InputError
from tsis.optics import angles as inputs


@pytest.mark.parametrize(
    ("value", "cure"),
    [
        (550.0, "looks like nanometres; give 0.55"),
        (5.5e-7, "looks like metres; give 0.55"),
        (5.5e-4, "looks like millimetres; give 0.55"),
        (-0.55, "green light is 0.55"),
        (0.0, "green light is 0.55"),
    ],
)
def test_a_wavelength_in_another_unit_is_named(value: float, cure: str) -> None:
    with pytest.raises(InputError, match=cure):
        inputs.require_wavelength(value)


def test_a_wavelength_in_micrometres_passes() -> None:
    assert inputs.require_wavelength(0.55) == 0.55


@pytest.mark.parametrize(
    ("index", "thickness", "sentence"),
    [
        ([1.41 + 0.1j], [1.0], "index must be real"),
        ([-1.41], [1.0], r"index\[0\] must lie in \[1, 5\]; got -1.41"),
        ([1.41, 1.515], [1.0], "of one length; got 2 and 1"),
        ([1.41], [0.0], r"thickness_um\[0\] must lie in"),
        ([], [], "must not be empty"),
        ([float("nan")], [1.0], "must be finite"),
    ],
)
def test_a_stack_that_is_none_is_refused(index: list[complex], thickness: list[float], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        inputs.require_stack(index, thickness)
