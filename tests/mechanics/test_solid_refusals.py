"""What a press in three dimensions refuses before anything is meshed, with and without NGSolve."""

from __future__ import annotations

import importlib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import tsis
from tsis.errors import InputError, MechanicsError, MissingExtraError
from tsis.mechanics.solid import _check_model, press_solid
from tsis.model.calibration import LightMap
from tsis.model.phantom import Inclusion, Phantom
from tsis.model.press import PressMap

PROBE = tsis.load_probe("tsis-2011")
PLAIN = Phantom(young_kpa=5.0, thickness_mm=30.0)


def lump(**other: Any) -> Phantom:
    values = {"diameter_mm": 5.0, "depth_mm": 4.0, "young_kpa": 80.0, **other}
    return replace(PLAIN, inclusion=Inclusion(**values))


@pytest.mark.parametrize(
    ("phantom", "given", "phrase"),
    [
        (PLAIN, {"force_n": -1.0}, r"force_n must lie in \[0, 50\]; got -1"),
        (PLAIN, {"force_n": 1.0, "spacing_mm": 0.0}, r"spacing_mm must lie in \[0.02, 5\]; got 0"),
        (PLAIN, {"force_n": 1.0, "threads": 0}, r"threads must lie in \[1, 64\]; got 0"),
        (lump(diameter_mm=14.0, depth_mm=0.2), {"force_n": 1.0}, "at least 0.28 under the skin .*; got 0.2"),
        (lump(depth_mm=24.95), {"force_n": 1.0}, "leave 0.1 mm between inclusion and chest wall .*; got 0.05"),
        (lump(offset_mm=(0.0, 71.0)), {"force_n": 1.0}, "within 72 mm of the axis, .*; got 73.5"),
    ],
)
def test_what_is_refused_in_one_sentence(phantom: Phantom, given: dict[str, Any], phrase: str) -> None:
    with pytest.raises(InputError, match=phrase):
        press_solid(PROBE, phantom, **given)


def test_a_dome_is_refused() -> None:
    with pytest.raises(InputError, match="face_curvature_mm must be None for a press in three dimensions; got 40"):
        press_solid(tsis.load_probe("tsis-domed"), lump(), force_n=1.0)


def test_a_contact_that_would_open_is_refused() -> None:
    pressure = np.array([[1.0, 1.0], [1.0, -0.5]])
    found = PressMap(
        x_mm=np.arange(2.0),
        y_mm=np.arange(2.0),
        face_displacement_mm=0 * pressure,
        pressure_kpa=pressure,
        approach_mm=1.0,
        force_n=0.5,
    )
    with pytest.raises(MechanicsError, match=r"contact would open: tissue would pull with 0\.5 kPa"):
        _check_model(PROBE, PLAIN, found, pressure != 0)
    with pytest.raises(
        MechanicsError, match=r"a strain of 0\.\d+; small strain is valid to 0.3: choose a smaller force_n"
    ):
        _check_model(PROBE, PLAIN, replace(found, approach_mm=15.0), pressure != 0)


def test_plain_tissue_needs_no_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    _hide_ngsolve(monkeypatch)
    found = press_solid(PROBE, PLAIN, force_n=1.0, spacing_mm=0.5)
    assert found.pressure_kpa.sum() * 0.25 == pytest.approx(1000.0, rel=5e-3)


def test_the_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    _hide_ngsolve(monkeypatch)
    virtual = tsis.virtual.VirtualProbe(PROBE, rng=np.random.default_rng(1), light=LightMap.uniform(), strain="small")
    with pytest.raises(MissingExtraError, match=r'needs NGSolve, which is not installed; .* "tsis\[fem3d\]"'):
        virtual.press(lump(offset_mm=(2.0, 1.0)), force_n=1.0)


def _hide_ngsolve(monkeypatch: pytest.MonkeyPatch) -> None:
    found = importlib.import_module

    def hide(name: str, package: str | None = None) -> Any:
        if name.partition(".")[0] in ("ngsolve", "netgen"):
            raise ModuleNotFoundError(name)
        return found(name, package)

    monkeypatch.setattr(importlib, "import_module", hide)
