"""Lagrangian strain of a map between two states, and the printed formula.

A map ``f`` takes a position ``x`` of the first state to its position in the second. Strain is a function of the
displacement ``u = f - x``: its tensor ``1/2 (H + H' + H' H)`` with ``H = du/dx`` is zero for every rigid motion. The
source's (5.17) uses the map instead of the displacement, and cubes instead of squares, so that a body at rest has a
strain of 1.5.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from tsis.errors import InputError
from tsis.imaging import features
from tsis.imaging.surface import height_surface
from tsis.matching.registration import register
from tsis.matching.spline import fit_spline, spread_out
from tsis.model.content import ContentValue
from tsis.model.image import TactileImage
from tsis.model.press import MN_PER_N
from tsis.model.require import require_array, require_integer, require_number, require_one_of, require_type

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from tsis.matching import Registration


def lagrangian_strain(gradient: ArrayLike) -> NDArray[np.float64]:
    """Strain tensor of a map at each point.

    Raises `InputError` when the gradient is not a stack of square matrices of finite numbers.

    Parameters
    ----------
    gradient
        Derivatives ``[n, i, j] = d f_i / d x_j`` of the map, as `ThinPlateSpline.gradient` gives them, shape (n, d, d).

    Returns
    -------
    Symmetric tensors, shape (n, d, d), without unit: half of the change of squared lengths. A rotation gives 0; a
    stretch by ``s`` gives ``(s**2 - 1) / 2``.

    Examples
    --------
    >>> lagrangian_strain([[[1.1, 0.0], [0.0, 1.0]]]).round(3).tolist()
    [[[0.105, 0.0], [0.0, 0.0]]]
    """
    displacement = _displacement_gradient(gradient)
    transposed = np.swapaxes(displacement, 1, 2)
    return np.asarray((displacement + transposed + transposed @ displacement) / 2)


def axial_strain(gradient: ArrayLike) -> NDArray[np.float64]:
    """Component ``e_zz`` of the strain along the last axis, shape (n,): (5.17) corrected.

    ``e_zz = du_z/dz + 1/2 [(du_x/dz)**2 + (du_y/dz)**2 + (du_z/dz)**2]`` of the displacement u. Argument and errors are
    those of `lagrangian_strain`.

    Examples
    --------
    >>> axial_strain([[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.8]]]).round(3).tolist()
    [-0.18]
    """
    along = _displacement_gradient(gradient)[:, :, -1]
    return np.asarray(along[:, -1] + (along**2).sum(axis=1) / 2)


def printed_axial_strain(gradient: ArrayLike) -> NDArray[np.float64]:
    """(5.17) as printed, shape (n,): of the map instead of the displacement, with cubes instead of squares.

    ``df_z/dz + 1/2 [(df_x/dz)**3 + (df_y/dz)**3 + (df_z/dz)**3]``; for comparison only: it is no strain. Argument and
    errors are those of `lagrangian_strain`.

    Examples
    --------
    >>> printed_axial_strain([[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]]).tolist()  # the identity
    [1.5]
    """
    along = _gradient(gradient)[:, :, -1]
    return np.asarray(along[:, -1] + (along**3).sum(axis=1) / 2)


def _displacement_gradient(gradient: ArrayLike) -> NDArray[np.float64]:
    checked = _gradient(gradient)
    return np.asarray(checked - np.eye(checked.shape[1]))


def _gradient(gradient: ArrayLike) -> NDArray[np.float64]:
    checked = require_array("gradient", gradient, ndim=3)
    if checked.shape[1] != checked.shape[2]:
        raise InputError(f"gradient must be a square matrix at each point; got shape {checked.shape}")
    return checked


CONTROL_POINTS = 200
SURFACE_POINTS = 256  # along the longer side: blocks of some pixels average the noise
FORMULAS = {"lagrangian": axial_strain, "printed": printed_axial_strain}
STRESSES = ("first", "second", "difference")
SPLINES = ("transform", "matches")
LEAST_STRAIN = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PrintedHardness(ContentValue):
    """Result of the printed pipeline for two frames.

    Attributes
    ----------
    young_kpa
        Stress over mean strain, (5.18).
    stress_kpa
        The numerator of (5.18).
    mean_strain
        Mean of ``strain``: positive where the second surface is the brighter one.
    strain
        Axial strain at each control point of the first surface, shape (n,).
    force_n, area_mm2
        Force and lit area of either frame.
    before, after
        Control points (x, y, depth) of either surface in mm, shapes (n, 3) and (m, 3).
    registration
        Match of the first surface to the second.
    """

    young_kpa: float
    stress_kpa: float
    mean_strain: float
    strain: NDArray[np.float64]
    force_n: tuple[float, float]
    area_mm2: tuple[float, float]
    before: NDArray[np.float64]
    after: NDArray[np.float64]
    registration: Registration

    def __post_init__(self) -> None:
        for name, ndim in (("strain", 1), ("before", 2), ("after", 2)):
            object.__setattr__(self, name, require_array(name, getattr(self, name), ndim=ndim))


def printed_estimate(
    images: Sequence[TactileImage],
    *,
    depth_mm_per_grey: float | None = None,
    stress: Literal["first", "second", "difference"] = "second",
    formula: Literal["lagrangian", "printed"] = "lagrangian",
    spline: Literal["transform", "matches"] = "transform",
    signed: bool = False,
    points: int = CONTROL_POINTS,
    method: str = "tprl",
    rng: np.random.Generator | None = None,
) -> PrintedHardness:
    """Stress over the mean strain between two presses, (5.1); not a measurement of a modulus.

    The stress is (5.5), the strain (5.17), and their quotient (5.18). The force is the gauge's; the source computes it
    from the sum of grey levels by (5.4). The area is that of the bright patch. A uniform background has no effect;
    subtract a non-uniform one first (`tsis.imaging.corrections.signal`).

    Parameters
    ----------
    images
        Two frames of one object at ascending forces, each with ``force_n`` and ``mm_per_pixel``.
    depth_mm_per_grey
        Depth of a grey level, in [1e-6, 1e3] mm. The source takes "the pixel value as the depth information" without
        a scale; by default a level is as deep as a pixel is wide, as in a plot of pixel values over pixels.
    stress
        Force over area of the ``"first"`` or the ``"second"`` press, or the ``"difference"`` of both. The source
        writes "the applied normal stress" and two forces; the difference agrees with a strain between the two, the
        second is the literal meaning.
    formula
        ``"lagrangian"`` strain of the displacement, or (5.17) as ``"printed"``, which is no strain.
    spline
        Fitted to the points after the method's ``"transform"``, or to their ``"matches"`` as in (5.16), whose error is
        the point spacing of the other surface.
    signed
        Whether the modulus has the strain's sign; brighter light counts as extension although the object is compressed,
        so the default is the magnitude.
    points
        Control points on each surface at most, in [10, 2000].
    method, rng
        Of `tsis.matching.register`.

    Raises
    ------
    InputError
        When the images are not two frames of ascending force with a scale and a contact, or the strain is zero.
    UnknownNameError
        When a choice or method is unknown.

    Examples
    --------
    >>> import numpy as np
    >>> y, x = np.mgrid[-60:61, -80:81] / 20
    >>> def frame(radius_mm, peak, force_n):
    ...     grey = peak * np.sqrt(np.maximum(0, 1 - (x**2 + y**2) / radius_mm**2))
    ...     return TactileImage(grey=grey, mm_per_pixel=(0.05, 0.05), force_n=force_n)
    >>> result = printed_estimate([frame(2.0, 100.0, 0.7), frame(2.4, 120.0, 1.2)])
    >>> bool(0.1 < result.mean_strain < 0.4)  # (1.2**2 - 1) / 2 = 0.22, whatever the modulus
    True
    """
    first, second = _pair(images)
    require_one_of("stress", stress, STRESSES)
    strain_of = FORMULAS[require_one_of("formula", formula, FORMULAS)]
    require_one_of("spline", spline, SPLINES)
    count = require_integer("points", points, 10, 2000)
    depth = first.scale()[0] if depth_mm_per_grey is None else depth_mm_per_grey
    require_number("depth_mm_per_grey", depth, 1e-6, 1e3, hint="millimetres a grey level")
    before, area_before = _lit_surface(first, depth, count)
    after, area_after = _lit_surface(second, depth, count)
    # Two smooth round caps match under any rotation, so no match is reliable; the source requires none.
    registration = register(before, after, method=method, rng=rng)
    found = registration.untrusted
    pairs = ~found.outliers if spline == "matches" else np.ones(len(before), dtype=bool)
    targets = after[found.matches[pairs]] if spline == "matches" else found.moved
    strain = strain_of(fit_spline(before[pairs], targets).gradient(before))
    forces = (first.force_n or 0.0, second.force_n or 0.0)
    light, heavy = MN_PER_N * forces[0] / area_before, MN_PER_N * forces[1] / area_after  # force over area (5.5)
    stress_kpa = {"first": light, "second": heavy, "difference": heavy - light}[stress]
    mean = float(strain.mean())
    if abs(mean) < LEAST_STRAIN:
        raise InputError(f"images must differ by some strain; got {mean:g}: press the second time with more force")
    return PrintedHardness(
        young_kpa=stress_kpa / (mean if signed else abs(mean)),
        stress_kpa=stress_kpa,
        mean_strain=mean,
        strain=strain,
        force_n=forces,
        area_mm2=(area_before, area_after),
        before=before,
        after=after,
        registration=registration,
    )


def _pair(images: Sequence[TactileImage]) -> tuple[TactileImage, TactileImage]:
    frames = list(images)
    if len(frames) != 2:
        raise InputError(f"images must hold two frames, the lighter press first; got {len(frames)}")
    for image in frames:
        require_type("each of images", image, TactileImage)
    first, second = frames
    if not (first.force_n and second.force_n and first.force_n < second.force_n):
        raise InputError(
            f"images must carry ascending forces, force_n in newtons; got {first.force_n!r} and {second.force_n!r}"
        )
    if first.scale() != second.scale():
        raise InputError(f"images must share mm_per_pixel; got {first.scale()} and {second.scale()}")
    return first, second


def _lit_surface(image: TactileImage, depth_mm_per_grey: float, count: int) -> tuple[NDArray[np.float64], float]:
    """Spread control points of the bright patch as a surface, in mm, and the patch's area in mm²."""
    bright = features(image)
    if not bright.contact:
        raise InputError(f"images must show a contact; in {image.name or 'an image'!r} nothing stands out of the noise")
    lifted = height_surface(image, max_points=SURFACE_POINTS, height_per_grey=depth_mm_per_grey)
    (width, height), (column, row) = image.scale(), image.axis()
    columns = np.round(lifted.x_mm / width + column).astype(int)
    rows = np.round(lifted.y_mm / height + row).astype(int)
    lit = bright.patch.mask[np.ix_(rows, columns)]
    x, y = np.meshgrid(lifted.x_mm, lifted.y_mm)
    return spread_out(np.column_stack([x[lit], y[lit], lifted.height[lit]]), count), bright.area_mm2 or 0.0
