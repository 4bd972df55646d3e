"""Field of one guided mode, without loss of precision through layers where it decays.

Solutions that decay below and above the stack are propagated to a layer where the mode is large, and joined there.
Modes of wells so weakly coupled that rounding mixes them are joined in different wells and orthogonalised.

The dissertation gives this field region by region as (3.15), (3.16), (3.17), (3.18), (3.19) and (3.20), with the
amplitudes (3.55), (3.56), (3.57), (3.58) and (3.59). The printed (3.55) must read ``e_1 = e_0 / cos(phi_1)``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import chain
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from tsis.errors import InputError
from tsis.optics import _inputs as inputs
from tsis.optics.slab import _phase as slab_phase
from tsis.optics.slab._phase import EPSILON, propagate_layer

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.optics._inputs import Complexes, Floats, Integers


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SlabLayers:
    """Regions from below up: the half-space below, the layers, the half-space above.

    Attributes
    ----------
    index
        Refractive index of each region, (layers + 2,).
    thickness_um
        Thickness of each in µm, 0 for the half-spaces.
    wavelength_um
        Wavelength in vacuum, µm.
    polarization
        ``"TE"`` or ``"TM"``.
    """

    index: Floats
    thickness_um: Floats
    wavelength_um: float
    polarization: str

    @classmethod
    def checked(
        cls, index: Any, thickness_um: Any, wavelength_um: Any, index_below: Any, index_above: Any, polarization: Any
    ) -> Self:
        """Check the arguments; see `tsis.optics.guided_modes` for the ranges."""
        indices, thicknesses = inputs.require_stack(index, thickness_um)
        outside = [
            inputs.require_refractive_index(name, value)
            for name, value in (("index_below", index_below), ("index_above", index_above))
        ]
        if polarization not in ("TE", "TM"):
            raise InputError(f"polarization must be 'TE' or 'TM'; got {polarization!r}")
        return cls(
            index=np.concatenate([outside[:1], indices, outside[1:]]),
            thickness_um=np.concatenate([[0.0], thicknesses, [0.0]]),
            wavelength_um=inputs.require_wavelength(wavelength_um),
            polarization=str(polarization),
        )

    @property
    def per_um(self) -> float:
        """Wavenumber of vacuum, 1/µm."""
        return 2 * np.pi / self.wavelength_um

    @property
    def surroundings(self) -> float:
        """The larger index of the two half-spaces; guided modes lie above it."""
        return float(max(self.index[0], self.index[-1]))

    @property
    def core(self) -> int:
        """Region of highest index, where all guided modes oscillate."""
        return int(np.argmax(self.index))

    @property
    def weight(self) -> Floats:
        """Divisor that makes the field's slope continuous: 1 of TE, the squared index of TM."""
        return np.ones_like(self.index) if self.polarization == "TE" else self.index**2

    def weight_at(self, x_um: Floats) -> Floats:
        """The weight at heights above the lower face of the first layer; an interface has that of the layer above."""
        return np.asarray(self.weight[np.searchsorted(self.faces_um, x_um, side="right")])

    @property
    def faces_um(self) -> Floats:
        """Heights of the interfaces, (layers + 1,), the first at 0."""
        return np.cumsum(self.thickness_um[:-1])

    def at(self, anchor: float) -> tuple[Floats, Floats, Floats]:
        """Input of the phase: squares of the indices less ``anchor**2``, weights, thicknesses times k0."""
        return (self.index - anchor) * (self.index + anchor), self.weight, self.thickness_um * self.per_um

    def modes_above(self, anchor: float, offset: float) -> int:
        """Number of modes with a squared effective index above ``anchor**2 + offset``."""
        return slab_phase.modes_above(*self.at(anchor), offset, self.core)


def thickness_factor(layers: SlabLayers) -> float:
    """Least factor on all thicknesses at which the stack guides a mode, to six digits; at most 1 for a guiding stack.

    Between unequal surroundings a thin stack is below cut-off. A layer's index must exceed the surroundings.
    """
    high = 1.0
    while not _guides(layers, high):
        high *= 2
    low = 0.0
    while high - low > 1e-6 * high:
        middle = (low + high) / 2
        low, high = (low, middle) if _guides(layers, middle) else (middle, high)
    return high


def _guides(layers: SlabLayers, factor: float) -> bool:
    thicker = replace(layers, thickness_um=factor * layers.thickness_um)
    return thicker.modes_above(layers.surroundings, 0.0) > 0


FLATTEST = 1e-5  # least rate times length, where the two waves merge; it balances errors of 1e-10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Waves:
    """``u = a exp(-g s) + b exp(-g (l - s))`` at s from the lower end of a region of length l, in units of 1 / k0.

    Where the mode decays, g is real and each wave decays from its own end, so there is no cancellation of large terms.
    Where it oscillates, g is imaginary and the waves travel up and down.
    """

    layers: SlabLayers  # the stack
    rate: Complexes  # g of each region, (layers + 2,)
    from_lower: Complexes  # a of each region; 0 in the half-space below
    from_upper: Complexes  # b of each region; 0 in the half-space above

    @classmethod
    def between(cls, layers: SlabLayers, q: Floats, lower: Floats, upper: Floats) -> Self:
        """The waves with the given u and v at the ends of regions, (layers + 2, 2) each, where u'' = -q u."""
        length = layers.thickness_um * layers.per_um
        floor = np.divide(FLATTEST**2, length**2, out=np.zeros_like(length), where=length > 0)
        rate = np.sqrt(-np.where(q < 0, np.minimum(q, -floor), np.maximum(q, floor)) + 0j)
        through = _through(layers, rate)
        # Oscillating: from u and u' at the lower end. Decaying: from u at both ends, because u' would cancel.
        slope = layers.weight * lower[:, 1] / rate
        travels = q > 0
        from_lower = np.where(
            travels, (lower[:, 0] - slope) / 2, (lower[:, 0] - upper[:, 0] * through) / (1 - through**2)
        )
        back = np.where(travels, np.conj(through), 0)
        from_upper = np.where(
            travels, (lower[:, 0] + slope) / 2 * back, (upper[:, 0] - lower[:, 0] * through) / (1 - through**2)
        )
        return cls(layers=layers, rate=rate, from_lower=from_lower, from_upper=from_upper)

    def wave(self, x_um: Floats) -> Floats:
        """U at heights above the lowest face, µm."""
        _, up, down = self._parts(x_um)
        return (up + down).real

    def slope(self, x_um: Floats) -> Floats:
        """V = du/dx over k0 p."""
        region, up, down = self._parts(x_um)
        return (self.rate[region] / self.layers.weight[region] * (down - up)).real

    def _parts(self, x_um: Floats) -> tuple[Integers, Complexes, Complexes]:
        faces = self.layers.faces_um
        region = np.searchsorted(faces, x_um, side="right")
        above = np.maximum(x_um - np.concatenate([faces[:1], faces])[region], 0.0)
        below = np.maximum(np.concatenate([faces, faces[-1:]])[region] - x_um, 0.0)
        g = self.rate[region] * self.layers.per_um
        return region, self.from_lower[region] * np.exp(-g * above), self.from_upper[region] * np.exp(-g * below)


def overlap_um(waves: Waves, other: Waves) -> float:
    """Integral of the product of two solutions over p, in µm, in closed form."""
    layers, sum_of_rates = waves.layers, waves.rate + other.rate
    length = layers.thickness_um * layers.per_um
    parallel = waves.from_lower * other.from_lower + waves.from_upper * other.from_upper
    opposed = waves.from_lower * other.from_upper + waves.from_upper * other.from_lower
    fading = (1 - _through(layers, waves.rate) * _through(layers, other.rate)) / sum_of_rates
    beating = length * np.exp(-sum_of_rates * length / 2) * _sinhc((waves.rate - other.rate) * length / 2)
    return float(np.sum((parallel * fading + opposed * beating) / layers.weight).real) / layers.per_um


def _through(layers: SlabLayers, rate: Complexes) -> Complexes:
    """Factor of a wave across its region; 0 in a half-space."""
    length = layers.thickness_um * layers.per_um
    return np.where(length > 0, np.exp(-rate * length), 0)


def _sinhc(z: Complexes) -> Complexes:
    small = np.abs(z) < 1e-4
    safe = np.where(small, 1, z)
    return np.where(small, 1 + z**2 / 6, np.sinh(safe) / safe)


INSEPARABLE = 1e-6  # of the largest q: closer modes mix by more than about 1e-9 by the rounding of N**2
CROWDED = 0.01  # of the mean distance: modes of a thick guide are close and do not mix
# In roundings of q: where N**2 equals one well's mode exactly, that mode dominates its twin's.
NUDGES = (0, 8, -8, 64, -64)
GOOD = 10.0  # largest error of a wave, in roundings of q, without a search for a better one


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SlabField:
    """A sum of solutions; a single one for a separate mode."""

    waves: tuple[Waves, ...]
    amplitudes: Floats

    def wave(self, x_um: Floats) -> Floats:
        """The continuous transverse field u at heights above the lowest face."""
        return np.asarray(sum(part * wave.wave(x_um) for part, wave in zip(self.amplitudes, self.waves, strict=True)))

    def slope(self, x_um: Floats) -> Floats:
        """The continuous slope v = u' / p by k0 x."""
        return np.asarray(sum(part * wave.slope(x_um) for part, wave in zip(self.amplitudes, self.waves, strict=True)))


def mode_field(layers: SlabLayers, n_eff: Floats, q: Floats, number: int) -> SlabField:
    """Field of one of a few modes that rounding may mix, with unit power.

    Parameters
    ----------
    layers
        The stack.
    n_eff
        Effective indices of these modes, (modes,).
    q
        ``n**2 - N**2`` of each mode in each region, (modes, layers + 2).
    number
        Index of the mode among them.
    """
    waves: list[Waves] = []
    parts = np.zeros((0, len(q)))  # amplitudes of the waves in each earlier mode, of unit norm
    for item in q[: number + 1]:
        nudged = (item + nudge * EPSILON * item.max() for nudge in NUDGES)
        # A nudge past cut-off gives no mode; the first q, without a nudge, decays on both sides.
        tries = chain.from_iterable(_joined(layers, near) for near in nudged if max(near[0], near[-1]) < 0)
        best = _best(_orthogonalised(waves, parts, wave, jump, EPSILON * item.max()) for wave, jump in tries)
        waves.append(best.wave)
        parts = np.vstack([parts, best.row])
    row = parts[-1, : len(waves)] / np.sqrt(n_eff[number])
    foot = sum(part * float(wave.from_upper[0].real) for part, wave in zip(row, waves, strict=True))
    return SlabField(waves=tuple(waves), amplitudes=row if foot >= 0 else -row)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Try:
    """A wave, its amplitudes with earlier waves in a mode orthogonal to earlier modes, and that mode's error."""

    wave: Waves
    row: Floats
    error: float


def _orthogonalised(waves: list[Waves], parts: Floats, wave: Waves, jump: float, rounding: float) -> _Try:
    """Make a wave orthogonal to the earlier modes; its error is in roundings of q."""
    power = overlap_um(wave, wave)
    overlaps = np.zeros(parts.shape[1])
    overlaps[: len(waves)] = [overlap_um(wave, other) / np.sqrt(power) for other in waves]
    common = parts @ overlaps  # with each earlier mode
    rest = float(np.sqrt(max(1.0 - float(common @ common), EPSILON)))
    row = -common @ parts
    row[len(waves)] = 1 / np.sqrt(power)
    # Normalising the rest amplifies the wave's admixture of other modes.
    error = (1 + jump / (power * wave.layers.per_um * rounding)) / rest
    return _Try(wave=wave, row=row / rest, error=error)


def _best(tries: Iterator[_Try]) -> _Try:
    """The first good result, else the result of least error."""
    best = next(tries)
    for candidate in tries:
        if best.error < GOOD:
            break
        best = min(best, candidate, key=lambda item: item.error)
    return best


def nearly_degenerate(anchor: Floats, offset: Floats, largest_q: float, mode: int) -> slice:
    """The modes around ``mode`` that rounding may mix with each other."""
    near = min(INSEPARABLE, CROWDED / len(anchor)) * largest_q
    first, last = mode, mode + 1
    while first > 0 and _distance(anchor, offset, first - 1) < near:
        first -= 1
    while last < len(anchor) and _distance(anchor, offset, last - 1) < near:
        last += 1
    return slice(first, last)


def _distance(anchor: Floats, offset: Floats, mode: int) -> float:
    """Difference of the squared effective indices of a mode and the next."""
    a, b = anchor[mode], anchor[mode + 1]
    return float((a - b) * (a + b) + (offset[mode] - offset[mode + 1]))


def _joined(layers: SlabLayers, q: Floats) -> Iterator[tuple[Waves, float]]:
    """Solutions joined in one layer each, first where the mode is largest, with the error of the joint."""
    (lower_below, upper_below), (upper_above, lower_above) = (_propagated(layers, q, side) for side in (1, -1))
    # The size of a solution driven from x is the product of the two that decay on its sides.
    size = {
        region: _log_size(layers, q, region, upper_below[region]) + _log_size(layers, q, region, upper_above[region])
        for region in np.flatnonzero(q > 0).tolist()
    }
    for region in sorted(size, key=lambda item: -size[item]):
        below, above = upper_below[region], upper_above[region]
        metric = np.array([1.0, _decay_length_um(layers, q, region) ** 2])
        ratio = (below[:2] * metric) @ above[:2] / ((above[:2] * metric) @ above[:2])
        lower = np.concatenate([lower_below[: region + 1], lower_above[region + 1 :]])
        upper = np.concatenate([upper_below[: region + 1], upper_above[region + 1 :]])
        log = np.where(np.arange(len(q)) <= region, -below[2], np.log(abs(ratio)) - above[2])
        scale = np.where(np.arange(len(q)) <= region, 1.0, np.sign(ratio))
        top = max((lower[:, 2] + log).max(), (upper[:, 2] + log).max())
        lower, upper = (
            ends[:, :2] * (scale * np.exp(ends[:, 2] + log - top))[:, np.newaxis] for ends in (lower, upper)
        )
        jump = abs(ratio * (below[0] * above[1] - below[1] * above[0])) * np.exp(-top)
        yield Waves.between(layers, q, lower, upper), float(jump)


def _propagated(layers: SlabLayers, q: Floats, side: int) -> tuple[Floats, Floats]:
    """(u, v, log of a factor) of the solution that decays outside, at the entry and exit of each region."""
    outside, end = (0, len(q) - 1) if side > 0 else (len(q) - 1, 0)
    length, weight = layers.thickness_um * layers.per_um, layers.weight
    enters, leaves = np.zeros((2, len(q), 3))
    u, v, log = 1.0, float(np.sqrt(-q[outside]) / weight[outside]), 0.0
    leaves[outside] = u, v, log
    for region in range(outside + side, end, side):
        enters[region] = u, v, log
        u, v, half_turns, depth = propagate_layer(u, v, weight[region], q[region], length[region])
        size = float(np.hypot(u, v)) * (-1) ** half_turns
        u, v, log = u / size, v / size, log + depth + float(np.log(abs(size)))
        leaves[region] = u, v, log
    enters[end] = u, v, log
    for ends in (enters, leaves):
        ends[:, 1] *= side  # an axis pointing inwards points down on the upper side
    return enters, leaves


def _decay_length_um(layers: SlabLayers, q: Floats, region: int) -> float:
    """Largest change of u by a slope u' within an oscillating region, in terms of v = u' / p."""
    length = layers.thickness_um[region] * layers.per_um
    return float(layers.weight[region] * min(1 / np.sqrt(q[region]), length))


def _log_size(layers: SlabLayers, q: Floats, region: int, end: Floats) -> float:
    u, v, log = end
    return float(log + np.log(np.hypot(u, v * _decay_length_um(layers, q, region))))
