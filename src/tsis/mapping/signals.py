"""What lumps do to the presses of a scan: harmonics of the pressure, reduced to few numbers a press, in microseconds.

The pressure of a press is read as harmonics around the probe's axis in rings. Of each harmonic only the few shapes
along the radius that lumps can cause are kept. A press is then a row of some forty numbers in kPa: those of harmonic 0,
and those of the cosine and of the sine of each further harmonic. Indenters without image have one number a radius of
contact instead: the relative change of the stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.compiled import compiled
from tsis.mechanics.lump_kernel import (
    EXACT_CONTRASTS,
    EXACT_DIAMETERS,
    EXACT_TOPS,
    LumpKernel,
    eshelby_factor,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

DIAMETERS_MM = np.geomspace(3.0, 20.0, 9)
SHAPES = (5, 4, 3, 3, 2, 1, 1)  # most shapes along the radius of each harmonic
LEAST_KPA = 1.5e-3  # shapes that lumps never excite by more are left out
LUMP_COLUMNS = 5  # x, y, depth of the centre, logarithms of diameter and contrast
X, Y, DEPTH, LOG_DIAMETER, LOG_CONTRAST = range(LUMP_COLUMNS)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shapes:
    """Shapes along the radius that are kept of each harmonic.

    Attributes
    ----------
    basis
        Orthonormal shapes of each harmonic over the rings, each of shape (rings, shapes).
    """

    basis: tuple[Floats, ...]

    @property
    def order(self) -> Integers:
        """Harmonic of each shape, shape (shapes,)."""
        return np.repeat(np.arange(len(self.basis)), [part.shape[1] for part in self.basis])

    @property
    def outputs(self) -> list[tuple[int, int, int]]:
        """Harmonic, 0 for cosine or 1 for sine, and shape of each number of a press."""
        return [
            (order, side, shape)
            for order, part in enumerate(self.basis)
            for side in range(1 if order == 0 else 2)
            for shape in range(part.shape[1])
        ]

    @property
    def count(self) -> int:
        """Numbers of a press."""
        return len(self.outputs)

    def reduced(self, harmonics: NDArray[np.complex128]) -> Floats:
        """Numbers of a press from its harmonics ``c + i s`` in rings, shape (harmonics, rings)."""
        parts = []
        for order, basis in enumerate(self.basis):
            value = basis.T @ harmonics[order]
            parts += [value.real] if order == 0 else [value.real, value.imag]
        return np.concatenate(parts)

    def noise(self, variance: Floats) -> Floats:
        """Covariance of the numbers from the variance of each harmonic's parts in rings, (harmonics, rings)."""
        result = np.zeros((self.count, self.count))
        start = 0
        for order, basis in enumerate(self.basis):
            block = (basis.T * variance[order]) @ basis
            for _ in range(1 if order == 0 else 2):
                result[start : start + len(block), start : start + len(block)] = block
                start += len(block)
        return result


@dataclass(frozen=True, kw_only=True, eq=False)
class SignalTable:
    """Changes by spheres, tabulated.

    Attributes
    ----------
    values
        Mean of the kernel over spheres, per mm**3 of volume and relative modulus, by part of a press, diameter,
        distance from the axis, depth and shape; shape (parts, diameters, n, k, shapes).
    order
        Harmonic of each shape.
    kernel
        The kernel, whose corrections apply.
    shapes
        The shapes along the radius.
    """

    values: NDArray[np.float32]
    order: Integers
    kernel: LumpKernel
    shapes: Shapes

    @classmethod
    def of(
        cls, kernel: LumpKernel, rows: Floats, harmonics: int, *, displacement_rows: Floats | None = None
    ) -> SignalTable:
        """Tabulate a kernel; ``rows`` (rings, radii) are means over rings, of pressure and of displacement in kPa."""
        table = kernel.sphere_table(rows, DIAMETERS_MM)
        if displacement_rows is not None and displacement_rows.any():
            table = table + kernel.sphere_table(displacement_rows, DIAMETERS_MM, quantity="face_displacement_mm")
        table = table[: 2 if table[1].any() else 1, ..., :harmonics, :]  # a flat face has no shape
        volume = (2.0 * np.pi / 6 * DIAMETERS_MM**3)[:, None, None, None]
        deep = kernel.depth_mm > 3.0
        basis = []
        for order in range(harmonics):
            size = (volume * table.sum(axis=0)[:, :, deep, order]).reshape(-1, len(rows))
            _, vectors = np.linalg.eigh(size.T @ size)
            vectors = vectors[:, ::-1][:, : SHAPES[order]]
            reach = np.abs(size @ vectors).max(axis=0)
            basis.append(np.array(vectors[:, : max(1, int((reach > LEAST_KPA).sum()))]))
        shapes = Shapes(basis=tuple(basis))
        parts = [table[..., order, :] @ part for order, part in enumerate(basis)]
        return cls(
            values=np.ascontiguousarray(np.concatenate(parts, axis=-1), dtype=np.float32),
            order=shapes.order,
            kernel=kernel,
            shapes=shapes,
        )

    def arrays(self) -> dict[str, NDArray[np.float64]]:
        """The table as arrays to store."""
        return {"values": self.values, **{f"basis{order}": part for order, part in enumerate(self.shapes.basis)}}  # type: ignore[dict-item]

    @classmethod
    def stored(cls, kernel: LumpKernel, arrays: Mapping[str, NDArray[Any]]) -> SignalTable:
        """The table of stored arrays."""
        basis = tuple(np.asarray(arrays[f"basis{order}"], dtype=float) for order in range(len(arrays) - 1))
        shapes = Shapes(basis=basis)
        values = np.ascontiguousarray(arrays["values"], dtype=np.float32)
        return cls(values=values, order=shapes.order, kernel=kernel, shapes=shapes)

    @cached_property
    def numbers(self) -> tuple[Any, ...]:
        """What `add_signals` needs of the table."""
        kernel = self.kernel
        return (
            self.values,
            self.order,
            float(kernel.distance_mm[1]),
            float(kernel.depth_mm[0]),
            np.log(np.array(EXACT_DIAMETERS)),
            np.log(np.array(EXACT_TOPS)),
            eshelby_factor(np.array(EXACT_CONTRASTS), kernel.poisson),
            kernel.force_n,
            np.ascontiguousarray(kernel.correction),
            2 * (4 - 5 * kernel.poisson) / (15 * (1 - kernel.poisson)),
        )

    def signals(self, lumps: Floats, places_mm: Floats, angle: Floats, force_n: Floats) -> Floats:
        """Changes of the presses by the sum of lumps (n, `LUMP_COLUMNS`), shape (presses, numbers)."""
        out = np.zeros((len(places_mm), self.shapes.count))
        for lump in lumps:
            add_signals(out, np.asarray(lump, dtype=float), places_mm, angle, force_n, *self.numbers)
        return out


@compiled
def _cell(axis: Floats, value: float) -> tuple[int, float]:
    """Cell of a grid and position in it; values beyond are moved to the end."""
    cell = 0
    while cell < len(axis) - 2 and value > axis[cell + 1]:
        cell += 1
    part = (value - axis[cell]) / (axis[cell + 1] - axis[cell])
    return cell, min(max(part, 0.0), 1.0)


@compiled
def add_signals(
    out: Floats,
    lump: Floats,
    places: Floats,
    angle: Floats,
    force: Floats,
    table: NDArray[np.float32],
    order: Integers,
    step: float,
    first_depth: float,
    log_diameters: Floats,
    log_tops: Floats,
    factors: Floats,
    forces: Floats,
    correction: Floats,
    eshelby: float,
) -> None:
    """Add the change by one lump to ``out`` (presses, numbers)."""
    diameter, contrast = np.exp(lump[3]), np.exp(lump[4])
    factor = (contrast - 1.0) / (1.0 + eshelby * (contrast - 1.0))
    top = max(lump[2] - diameter / 2, 0.3)
    a, pa = _cell(log_diameters, lump[3])
    b, pb = _cell(log_tops, np.log(top))
    c, pc = _cell(factors, factor)
    shifts, log_scales = np.zeros(len(forces)), np.zeros(len(forces))
    for i in range(2):
        for j in range(2):
            for k in range(2):
                weight = (pa if i else 1 - pa) * (pb if j else 1 - pb) * (pc if k else 1 - pc)
                for number in range(len(forces)):
                    shifts[number] += weight * correction[0, number, a + i, b + j, c + k]
                    log_scales[number] += weight * correction[1, number, a + i, b + j, c + k]
    parts, sizes, distances, depths, shapes = table.shape
    # the diameters of the table are evenly spaced in the logarithm from 3 to 20 mm
    at = (lump[3] - np.log(3.0)) / (np.log(20.0) - np.log(3.0)) * (sizes - 1)
    d = min(max(int(at), 0), sizes - 2)
    pd = min(max(at - d, 0.0), 1.0)
    for press in range(len(places)):
        dx, dy = lump[0] - places[press, 0], lump[1] - places[press, 1]
        distance = np.sqrt(dx * dx + dy * dy)
        at = distance / step
        if at >= distances - 1:
            continue
        r = int(at)
        pr = at - r
        f, pf = _cell(forces, force[press])
        shift = (1 - pf) * shifts[f] + pf * shifts[f + 1]
        log_scale = (1 - pf) * log_scales[f] + pf * log_scales[f + 1]
        strength = np.pi / 6 * diameter**3 * factor * np.exp(log_scale)
        at = min(max((lump[2] + shift - first_depth) / step, 0.0), depths - 1.001)
        z = int(at)
        pz = at - z
        turn = np.arctan2(dy, dx) - angle[press]
        number = 0
        shape = 0
        while shape < shapes:
            m = order[shape]
            end = shape
            while end < shapes and order[end] == m:
                end += 1
            cosine, sine = np.cos(m * turn), np.sin(m * turn)
            for s in range(shape, end):
                value = 0.0
                for part in range(parts):
                    total = 0.0
                    for i in range(2):
                        wi = pd if i else 1 - pd
                        for j in range(2):
                            wj = wi * (pr if j else 1 - pr)
                            total += wj * (
                                (1 - pz) * table[part, d + i, r + j, z, s] + pz * table[part, d + i, r + j, z + 1, s]
                            )
                    value += total * (force[press] if part == 0 else 1.0)
                value *= strength
                out[press, number + s - shape] += value * cosine
                if m > 0:
                    out[press, number + (end - shape) + s - shape] += value * sine
            number += (end - shape) * (1 if m == 0 else 2)
            shape = end
