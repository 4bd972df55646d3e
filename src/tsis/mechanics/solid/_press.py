"""A press in three dimensions, as the sum of the reference press and the change by the inclusions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import InputError, MechanicsError, import_extra
from tsis.mechanics._face import EDGE_FRACTION
from tsis.mechanics.small_strain import small_strain_press, strain_problem
from tsis.mechanics.solid._mesh import FEATURE, SolidResolution, outer_radius_mm, symmetry_of
from tsis.mechanics.solid._tie import TiedSolid
from tsis.model import MN_PER_N, Phantom, PressField, PressMap, Probe, require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.mechanics._element import Booleans, Floats
    from tsis.mechanics.small_strain import Resolution
    from tsis.mechanics.solid._tie import FaceChange


OFF_RIM = 1e-4  # of the face's radius
THINNEST_GAP = 0.02  # between an inclusion and skin or wall, of its smallest diameter; thinner gaps mesh badly
FARTHEST = 0.6  # of the slab's radius; the slab's side disturbs inclusions beyond it
PULLING = 0.05  # of the mean pressure: more tension than an error of rounding and mesh
MOST_CACHED = 8
_CACHE: dict[tuple[Probe, Phantom, tuple[bytes, bytes], SolidResolution], FaceChange] = {}


def press_solid(
    probe: Probe,
    phantom: Phantom,
    *,
    force_n: float,
    spacing_mm: float = 0.25,
    resolution: SolidResolution | None = None,
    reference_resolution: Resolution | None = None,
    threads: int = 2,
    progress: Callable[[str], None] | None = None,
) -> PressMap:
    """Press a flat probe on a phantom with inclusions at any position: small strain, three dimensions.

    The contact is frictionless and covers the face. The change by the inclusions is computed with and without contrast
    on one mesh, and added to the reference press of `tsis.mechanics.press`: the error of a coarse mesh is then a
    fraction of the signal, not of the press. Mirror symmetry reduces one inclusion to half a model, on the axis to a
    quarter.

    Parameters
    ----------
    probe, phantom
        The flat probe and the tissue under it.
    force_n
        Force in newtons, in [0, 50]; the result is linear in it.
    spacing_mm
        Spacing of the result's grid, in [0.02, 5].
    resolution
        Mesh density in three dimensions. With the default the signal of the displacement is right to 1 % of its peak
        inside 0.8 of the face's radius and to 2 % up to its rim.
    reference_resolution
        Mesh density of the reference press.
    threads
        Threads of the linear algebra, in [1, 64]; they wait busily, so use no more than there are idle cores.
    progress
        Called with a short text at the start of each stage.

    Raises
    ------
    InputError
        When a value lies outside its range, the face is domed, or an inclusion is too close to the skin, the chest
        wall or the slab's side.
    MechanicsError
        When the strain is too large for the model, or the contact would open.
    MissingExtraError
        When NGSolve is not installed.
    """
    require_type("probe", probe, Probe)
    require_type("phantom", phantom, Phantom)
    require_number("force_n", force_n, 0.0, 50.0, hint="newtons")
    require_number("spacing_mm", spacing_mm, 0.02, 5.0, hint="millimetres")
    require_number("threads", threads, 1, 64)
    if probe.face_curvature_mm is not None:
        raise InputError(
            f"face_curvature_mm must be None for a press in three dimensions; got {probe.face_curvature_mm:g}"
        )
    _check_inside(probe, phantom)
    steps = int(np.ceil(probe.radius_mm / spacing_mm))
    axis = np.asarray(spacing_mm * np.arange(-steps, steps + 1), dtype=float)
    reference = small_strain_press(probe, phantom.without_inclusion(), force_n, reference_resolution).on_grid(
        axis, axis
    )
    if not phantom.inclusions or force_n == 0:
        return reference
    points = _points(axis, probe.radius_mm)
    change = _change(probe, phantom, points.key, resolution or SolidResolution(), threads, progress)
    result = _added(reference, points, change)
    _check_model(probe, phantom, result, points.radius_mm < EDGE_FRACTION * probe.radius_mm)
    return result


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Points:
    """The grid's points on the face and the fraction of each cell on it.

    A cell across the rim with its centre outside has the values at the rim.
    """

    radius_mm: Floats
    covered: Floats
    key: tuple[bytes, bytes]


def _points(axis: Floats, edge: float) -> _Points:
    ones = np.ones(2)
    disc = PressField(
        radius_mm=np.array([0.0, edge]), face_displacement_mm=ones, pressure_kpa=ones, approach_mm=0.0, force_n=0.0
    )
    covered = disc.on_grid(axis, axis).pressure_kpa
    x, y = np.meshgrid(axis, axis)
    radius = np.hypot(x, y)
    # The mesh's curved triangles end just inside the rim.
    inwards = np.minimum(1.0, (1 - OFF_RIM) * edge / np.maximum(radius, OFF_RIM * edge))[covered > 0]
    key = ((inwards * x[covered > 0]).tobytes(), (inwards * y[covered > 0]).tobytes())
    return _Points(radius_mm=radius, covered=covered, key=key)


def _change(
    probe: Probe,
    phantom: Phantom,
    points: tuple[bytes, bytes],
    resolution: SolidResolution,
    threads: int,
    progress: Callable[[str], None] | None,
) -> FaceChange:
    """Change by the inclusions at 1 mN, cached because the result is linear in the force."""
    key = (probe, phantom, points, resolution)
    if key not in _CACHE:
        while len(_CACHE) >= MOST_CACHED:
            _CACHE.pop(next(iter(_CACHE)))
        ng = import_extra("ngsolve", feature=FEATURE, extra="fem3d")
        report = progress or (lambda _: None)
        report("meshing")
        ng.SetNumThreads(threads)
        with ng.TaskManager():
            solid = TiedSolid(probe, phantom, symmetry_of(phantom.inclusions), resolution)
            x, y = (np.frombuffer(point) for point in points)
            _CACHE[key] = solid.change(x, y, report)
    return _CACHE[key]


def _added(reference: PressMap, points: _Points, change: FaceChange) -> PressMap:
    """The sum of the reference press and the change by the inclusions."""
    force_mn = reference.force_n * MN_PER_N
    displacement, pressure = np.zeros_like(points.covered), np.zeros_like(points.covered)
    at = points.covered > 0
    displacement[at] = force_mn * change.face_displacement_mm
    pressure[at] = force_mn * change.pressure_kpa
    return replace(
        reference,
        face_displacement_mm=reference.face_displacement_mm + displacement * (reference.face_displacement_mm != 0),
        pressure_kpa=reference.pressure_kpa + pressure * points.covered,
        approach_mm=reference.approach_mm + force_mn * change.approach_mm,
    )


def _check_inside(probe: Probe, phantom: Phantom) -> None:
    extent = FARTHEST * outer_radius_mm(probe, phantom.thickness_mm)
    for inclusion in phantom.inclusions:
        gap = THINNEST_GAP * 2 * min(inclusion.half_axes_mm)
        if inclusion.depth_mm < gap:
            raise InputError(
                f"depth_mm must be at least {gap:g} under the skin for this size; got {inclusion.depth_mm:g}"
            )
        below = phantom.thickness_mm - inclusion.bottom_mm
        if below < gap:
            raise InputError(
                f"depth_mm must leave {gap:g} mm between inclusion and chest wall for this size; got {below:g}"
            )
        away = float(np.hypot(*inclusion.offset_mm)) + max(inclusion.half_axes_mm[:2])
        if away > extent:
            raise InputError(
                f"offset_mm must place the inclusion within {extent:g} mm of the axis, inside the meshed slab; "
                f"got {away:g}"
            )


def _check_model(probe: Probe, phantom: Phantom, result: PressMap, inner: Booleans) -> None:
    problem = strain_problem(result.approach_mm, probe, phantom.thickness_mm)
    if problem is not None:
        raise MechanicsError(f"{problem}: choose a smaller force_n or stiffer tissue")
    mean = result.force_n * MN_PER_N / (np.pi * probe.radius_mm**2)
    least = float(result.pressure_kpa[inner].min())
    if least < -PULLING * mean:
        raise MechanicsError(
            f"the contact would open: tissue would pull with {-least:.2g} kPa at a mean pressure of {mean:.2g} kPa; "
            "choose inclusions that are deeper or not so soft"
        )
