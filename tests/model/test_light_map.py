from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from tsis.cli.calibration_file import calibration_document, read_calibration
from tsis.model import Calibration, LightMap
from tsis.model.errors import FileInputError, InputError
from tsis.report.document import json_bytes

if TYPE_CHECKING:
    from pathlib import Path


def some(seed: int = 1) -> LightMap:
    rng = np.random.default_rng(seed)
    x, y = np.array([-3.0, 0.5, 2.0]), np.array([-1.0, 4.0])
    return LightMap(x_mm=x, y_mm=y, relative=rng.uniform(0.5, 1.5, (2, 3)))


def test_between_the_points_it_is_scipys_linear_interpolation() -> None:
    light, rng = some(), np.random.default_rng(2)
    x, y = np.sort(rng.uniform(-3.0, 2.0, 7)), np.sort(rng.uniform(-1.0, 4.0, 5))
    peer = RegularGridInterpolator((light.y_mm, light.x_mm), light.relative)
    expected = peer(np.stack(np.meshgrid(y, x, indexing="ij"), axis=-1))
    np.testing.assert_allclose(light.at(x, y), expected, rtol=1e-13)


def test_outside_its_grid_it_is_the_nearest_value() -> None:
    light = some()
    assert light.at([-9.0, 9.0], [9.0]).tolist() == [[light.relative[1, 0], light.relative[1, 2]]]


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"relative": [[1.0, 1.0, 1.0]]}, r"shape \(2, 3\)"),
        ({"relative": [[1.0, 0.0, 1.0], [1.0, 1.0, 1.0]]}, "above 0.001 of its largest"),
        ({"relative": -np.ones((2, 3))}, "above 0.001 of its largest"),
        ({"x_mm": [0.0, 0.0, 1.0]}, "x_mm must hold at least two ascending"),
    ],
)
def test_a_map_that_is_none_is_refused(values: dict[str, object], sentence: str) -> None:
    good: dict[str, object] = {"x_mm": [0.0, 1.0, 2.0], "y_mm": [0.0, 1.0], "relative": np.ones((2, 3))}
    with pytest.raises(InputError, match=sentence):
        LightMap(**{**good, **values})  # type: ignore[arg-type]


def test_a_calibration_file_keeps_it(tmp_path: Path) -> None:
    light, path = some(), tmp_path / "calibration.json"
    path.write_bytes(
        json_bytes(calibration_document(Calibration(gain_grey_per_kpa=60, saturation_kpa=20, light=light)))
    )
    assert read_calibration(path).light == light != some(seed=2)
    document = json.loads(path.read_text())
    del document["light"]["y_mm"]
    path.write_text(json.dumps(document))
    with pytest.raises(FileInputError, match="x_mm, y_mm and relative of light"):
        read_calibration(path)
