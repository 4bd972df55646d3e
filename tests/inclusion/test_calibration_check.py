"""A calibration of another probe is refused; one that may be this probe's is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import tsis
from tsis.errors import NotCalibratedError
from tsis.inclusion.estimation import check_calibration
from tsis.model.calibration import Calibration, LightMap

PROBE = tsis.load_probe("tsis-2011")
ANSWER = Calibration(gain_grey_per_kpa=10.0, saturation_kpa=20.0)


def light_to(reach_mm: float) -> LightMap:
    side = np.linspace(-reach_mm, reach_mm, 9)
    none = np.zeros((9, 9))
    level = np.broadcast_to(1 + 0.01 * side, (9, 9))
    return LightMap(x_mm=side, y_mm=side, relative=level, flux_x=none, flux_y=none, growth_per_mm=none, error=0.0)


def test_another_probes_calibration_is_refused_by_name() -> None:
    with pytest.raises(NotCalibratedError, match=r"'tsis-2011'; got one of 'tsis-domed': calibrate"):
        check_calibration(replace(ANSWER, probe="tsis-domed"), PROBE)


@pytest.mark.parametrize(("of", "probe"), [("", "tsis-2011"), ("tsis-2011", "tsis-2011"), ("other", "")])
def test_the_same_or_an_unknown_name_passes(of: str, probe: str) -> None:
    check_calibration(replace(ANSWER, probe=of), replace(PROBE, name=probe))


def test_a_map_of_light_must_reach_the_rim() -> None:
    check_calibration(replace(ANSWER, light=light_to(12.0)), PROBE)
    with pytest.raises(NotCalibratedError, match=r"12 mm; got a map that ends at 10 mm"):
        check_calibration(replace(ANSWER, light=light_to(10.0)), PROBE)


def test_even_light_is_even_beyond_its_map() -> None:
    check_calibration(replace(ANSWER, light=LightMap.uniform()), PROBE)
