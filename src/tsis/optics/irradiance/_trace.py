"""The traced light on a probe's face: untouched, evenly raised, and under a few dents; cached on disk."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import TYPE_CHECKING

import numpy as np

from tsis.__about__ import LARGEST_SEED
from tsis.compiled import one_blas_thread
from tsis.errors import InputError
from tsis.files.cache import content_key, read_cached_arrays, write_cached_arrays
from tsis.model.probe import Probe
from tsis.model.require import require_integer, require_number, require_type
from tsis.optics import _inputs as inputs
from tsis.optics._angles import real_contact
from tsis.optics.irradiance._field import Irradiance, leaving_light
from tsis.optics.irradiance._fit import slope_terms, smooth, symmetries, symmetrised, watched_slopes
from tsis.optics.rays import (
    ARRIVING,
    COUPLED,
    FLUX_X,
    FLUX_Y,
    evenly_pressed_face,
    evenly_raised_face,
    hertz_dent,
    scene,
    trace_batches,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from tsis.model.press import PressField, PressMap
    from tsis.optics._inputs import Floats
    from tsis.optics.rays import Batches


FORMAT_VERSION = 2
RAISED = (0.0, 0.08, 0.16)  # of the layers' thickness
# Depth over the thickness; tip's radius and the position of its middle over the face's radius.
DENTS = ((0.04, 0.4, 0.0, 0.0), (0.08, 0.6, 0.2, 0.1), (0.13, 0.8, 0.0, 0.0), (0.06, 0.5, -0.15, 0.25))
SATURATION_KPA = 1.0  # the dents' peak pressure: the lift is fitted at nearly full contact
BINS, NODES = 48, 49
GROUPS = 8  # of batches; their spread gives the error
FEWEST_RAYS, MOST_RAYS = 10**5, 10**10


def irradiance(
    probe: Probe,
    *,
    rays: float = 4_000_000,
    seed: int = 1,
    index_outside: float = 1.0,
    absorption_per_mm: float = 0.0,
    progress: Callable[[int, int], None] | None = None,
    cached: bool = True,
) -> Irradiance:
    """Trace the light on a probe's face, or load it from the disk cache.

    Three quarters of the rays go through the untouched probe and two probes with an evenly raised face. Their light on
    tilted faces is recorded, averaged over the symmetries of the lamps and smoothed by splines. The last quarter goes
    through a level contact and four dents; it gives one number each for the loss of light by contact and for the
    reflection from a dent's flanks.

    Parameters
    ----------
    probe
        The probe with its lamps.
    rays
        Total number of rays, in [1e5, 1e10].
    seed
        Seed of their starts, a whole number from 0.
    index_outside
        Refractive index around the probe, in [1, 5].
    absorption_per_mm
        Absorption of layers and glass, in [0, 10].
    progress
        Called with (parts done, parts in all).
    cached
        Whether to read and write the disk cache; its key is the content of all arguments above.

    Raises
    ------
    InputError
        When a value lies outside its range or the face is dark.
    """
    require_type("probe", probe, Probe)
    rays = require_integer("rays", rays, FEWEST_RAYS, MOST_RAYS)
    seed = require_integer("seed", seed, 0, LARGEST_SEED)
    medium = {
        "index_outside": inputs.require_refractive_index("index_outside", index_outside),
        "absorption_per_mm": require_number("absorption_per_mm", absorption_per_mm, 0.0, 10.0),
    }
    key = content_key({"format": FORMAT_VERSION, "probe": _optical(probe), "rays": float(rays), "seed": seed, **medium})
    arrays = read_cached_arrays("irradiance", key) if cached else None
    if arrays is not None:
        fields: dict[str, Any] = {name: value if value.ndim else float(value) for name, value in arrays.items()}
        return Irradiance(**fields)
    with one_blas_thread():
        result = _traced(probe, rays / (len(RAISED) + 1), seed, medium, progress or (lambda _done, _total: None))
    if cached:
        write_cached_arrays("irradiance", key, {name: getattr(result, name) for name in Irradiance.__slots__})
    return result


def _optical(probe: Probe) -> dict[str, Any]:
    """The fields of a probe that its light depends on."""
    return {
        "radius_mm": probe.radius_mm,
        "layers": [(layer.thickness_mm, layer.refractive_index) for layer in probe.layers],
        "face_curvature_mm": probe.face_curvature_mm,
        "glass": asdict(probe.glass),
        "leds": [asdict(led) for led in probe.leds],
    }


def _traced(
    probe: Probe, rays: float, seed: int, medium: dict[str, float], progress: Callable[[int, int], None]
) -> Irradiance:
    """The light from ``rays`` rays for each of the raised faces, and as many for all dents."""
    parts = len(RAISED) + 1 + len(DENTS)
    steps = iter(range(1, parts + 1))

    def traced(pressed: PressField | PressMap, rays: float, slopes: Floats) -> Batches:
        view = scene(probe, pressed, saturation_kpa=SATURATION_KPA, aperture=0.0, **medium)
        result = trace_batches(view, probe, rays=rays, seed=seed, bins=BINS, slopes=slopes)
        progress(next(steps), parts)
        return result

    raised = np.array(RAISED) * probe.thickness_mm
    levels = [traced(evenly_raised_face(probe.radius_mm, height), rays, watched_slopes()) for height in raised]
    touched = traced(evenly_pressed_face(probe.radius_mm, SATURATION_KPA), rays / len(DENTS), np.empty((0, 2)))
    fraction = real_contact(np.array(SATURATION_KPA), SATURATION_KPA).item()
    arriving = [result.maps[:, ARRIVING].sum() / len(result.maps) for result in (levels[0], touched)]
    _check_lit(min(arriving))
    light = replace(_smoothed(probe, raised, levels), depletion=(arriving[0] / arriving[1] - 1) / fraction)
    logs, depths = [], []
    for depth, tip, x, y in DENTS:
        dent = hertz_dent(
            probe.radius_mm,
            tip_radius_mm=tip * probe.radius_mm,
            depth_mm=depth * probe.thickness_mm,
            peak_pressure_kpa=SATURATION_KPA,
            offset_mm=(x * probe.radius_mm, y * probe.radius_mm),
        )
        coupled = traced(dent, rays / len(DENTS), np.empty((0, 2))).maps[:, COUPLED].mean(axis=0).sum()
        model, displacement = leaving_light(light, dent, saturation_kpa=SATURATION_KPA, bins=1)
        _check_lit(min(coupled, model.item()))
        logs.append(np.log(coupled / model.item()))
        depths.append(displacement.item())
    return replace(light, lift_per_mm=float(np.dot(depths, logs) / np.dot(depths, depths)))


def _smoothed(probe: Probe, raised: Floats, levels: list[Batches]) -> Irradiance:
    """The light on evenly raised faces, from their rays."""
    matrices, nodes = symmetries(probe), np.linspace(-probe.radius_mm, probe.radius_mm, NODES)
    terms = []
    for result in levels:
        maps, tilted = (_grouped(part) for part in (result.maps, result.tilted))
        flux = maps[:, FLUX_X : FLUX_Y + 1]
        even = symmetrised(maps[:, ARRIVING], flux, tilted, matrices)
        terms.append(smooth(slope_terms(*even), probe.radius_mm, nodes))
    inside = np.hypot(nodes, nodes[:, None]) <= probe.radius_mm
    mean = float(terms[0][:, 0].mean(axis=0)[inside].mean())
    _check_lit(mean)
    spread = terms[0][:, 0].std(axis=0, ddof=1)[inside] / np.sqrt(GROUPS)
    return Irradiance(
        radius_mm=probe.radius_mm,
        nodes_mm=nodes,
        displacement_mm=raised,
        terms=np.array([grouped.mean(axis=0) for grouped in terms]) / mean,
        lift_per_mm=0.0,
        depletion=0.0,
        mean_per_mm2=mean / (2 * probe.radius_mm / BINS) ** 2,
        error=float(np.sqrt((spread**2).mean()) / mean),
    )


def _check_lit(light: float) -> None:
    if light <= 0:
        raise InputError("leds must light the face of the probe; hardly any ray reaches it from inside")


def _grouped(batches: Floats) -> Floats:
    """Means of groups of batches, shape (groups, ...)."""
    return np.asarray(batches.reshape(GROUPS, -1, *batches.shape[1:]).mean(axis=1))
