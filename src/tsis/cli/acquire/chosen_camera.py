"""The camera that the command line names: one that is connected, stored frames, or the virtual probe."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from tsis.instrument.discovery import SOURCES, STORED_SOURCES, connect
from tsis.instrument.presets import preset
from tsis.model import load_phantom, load_probe
from tsis.model.check import require_one_of
from tsis.model.errors import InputError
from tsis.virtual import VirtualCamera, VirtualProbe

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from tsis.instrument import Camera

VIRTUAL = "virtual"


@dataclass(frozen=True, slots=True, kw_only=True)
class VirtualPress:
    """What the virtual camera looks at."""

    probe: str
    phantom: str
    force_n: float
    seed: int


def connector(spec: str, press: VirtualPress) -> Callable[[], Camera]:
    """A call that makes a new handle of the camera, not yet opened."""
    if spec != VIRTUAL:
        return live_connector(spec)
    rng = np.random.default_rng(press.seed)
    probe = VirtualProbe(load_probe(press.probe), rng=rng)
    phantom = load_phantom(press.phantom)
    return lambda: VirtualCamera(probe, phantom, rng=rng, force_n=press.force_n, paced=True)


def live_connector(spec: str) -> Callable[[], Camera]:
    """The same of a camera that is not virtual; `UnknownNameError` when no source is called so."""
    require_one_of("camera source", spec.partition(":")[0], (VIRTUAL, *SOURCES))
    return partial(connect, spec)


def is_stored(spec: str) -> bool:
    """Whether the frames are on a disk already, so that they can wait and tell nothing of a camera."""
    return spec.partition(":")[0] in STORED_SOURCES


def wanted_settings(connect_camera: Callable[[], Camera], name: str | None, pairs: Sequence[str]) -> dict[str, float]:
    """Settings of a preset, and over them those given as ``name=value``."""
    chosen: dict[str, float] = {}
    if name is not None:
        camera = connect_camera()
        camera.open()
        try:
            chosen = preset(name, camera.settings())
        finally:
            camera.stop()
    return chosen | dict(_pair(text) for text in pairs)


def _pair(text: str) -> tuple[str, float]:
    name, equals, value = text.partition("=")
    try:
        number = float(value)
    except ValueError:
        equals = ""
        number = 0.0
    if not equals or not name:
        raise InputError(f"--set must be a name and a number, as exposure_ms=10; got {text!r:.60}")
    return name, number
