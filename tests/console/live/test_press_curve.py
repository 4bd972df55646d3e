"""Force and radius over time, and what is measured, without a browser."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tsis.console.live.measuring import TOOLS, measurement
from tsis.console.live.press_curve import curves
from tsis.console.services.frames import ContactView, PressMoment
from tsis.errors import InputError
from tsis.model.image import TactileImage


def circle(radius_px: float, points: int = 96) -> ContactView:
    angles = np.arange(points) * 2 * math.pi / points
    outline = tuple((float(50 + radius_px * np.cos(a)), float(40 + radius_px * np.sin(a))) for a in angles)
    return ContactView(centroid_px=(50.0, 40.0), outline_px=outline)


@pytest.mark.parametrize("radius_px", [3.0, 20.0, 400.0])
def test_the_radius_is_that_of_a_circle_of_the_same_area(radius_px: float) -> None:
    assert circle(radius_px).radius() == pytest.approx(radius_px, rel=1e-3)
    assert circle(radius_px).radius((0.1, 0.4)) == pytest.approx(0.2 * radius_px, rel=1e-3)  # an ellipse of that area
    assert ContactView(centroid_px=(0.0, 0.0), outline_px=()).radius() == 0.0


def test_the_last_seconds_are_shown_and_what_is_unknown_breaks_the_line() -> None:
    moments = [
        PressMoment(time_s=100.0 + at, force_n=None if at == 41 else at / 10, contact=circle(at) if at > 38 else None)
        for at in range(43)
    ]
    forces, radii, unit = curves(moments, (0.1, 0.1))
    assert unit == "mm"
    assert [time for time, _ in forces] == [float(at) for at in range(-30, 1)]
    assert forces[-1] == [0.0, 4.2]
    assert forces[-2] == [-1.0, None]
    assert radii[0] == [-30.0, None]
    assert radii[-1][1] == pytest.approx(4.2, rel=2e-3)
    assert curves((), None) == ([], [], "px")


def test_each_tool_gives_its_numbers_with_units() -> None:
    grey = np.add.outer(np.zeros(60), np.arange(80.0))
    image = TactileImage(grey=grey, mm_per_pixel=(0.1, 0.1))
    found = {tool: dict(measurement(image, tool, (10.0, 20.0), (40.0, 20.0)).facts) for tool in TOOLS}
    assert found["profile"] == {"distance": "3.00 mm", "grey level": "10.0 to 40.0"}
    assert found["distance"] == {"distance": "3.00 mm"}
    assert found["rectangle"]["mean ± sd"] == "25.0 ± 9.1 grey levels"  # 10 to 40: sd of 31 whole numbers
    assert found["rectangle"]["area"] == "0.31 mm²"
    assert found["ellipse"]["range"] == "10 to 40"
    assert dict(measurement(TactileImage(grey=grey), "distance", (0, 0), (3, 4)).facts) == {"distance": "5.00 px"}
    with pytest.raises(InputError):
        measurement(image, "rectangle", (-20.0, -20.0), (-10.0, -10.0))
