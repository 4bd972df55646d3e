"""Guided modes of a stack of layers: their number, effective indices and fields, and a slow reference of the indices.

The field u of a guided mode (E_y of TE, H_y of TM) obeys, with X = k0 x and N the mode's effective index,

    u' = p v,   v' = -(q / p) u,   q = n**2 - N**2,   p = 1 (TE) or n**2 (TM),

with u and v continuous: a Sturm-Liouville problem. For TE the two equations are the dissertation's wave equations
(3.9), (3.10), (3.11), (3.12), (3.13) and (3.14), printed there without the second derivative.

Indices: solutions that decay below and above the stack are propagated from both sides into the layer of highest index,
the core, as half-turns (zeros of u) and a direction (u, v) with u >= 0. Mode j is where the total phase of the core and
both sides is (j + 1) pi. The phase decreases monotonically with N, so each multiple of pi occurs once: the search finds
each mode exactly once. N**2 is ``anchor**2 + offset`` with the anchor an index of the stack. So q of that layer or of
the surroundings has full precision at any distance from cut-off.

Fields: the same two solutions are joined in a layer where the mode is large, without loss of precision through layers
where it decays. Modes of wells so weakly coupled that rounding mixes them are joined in different wells and
orthogonalised.

The reference, `effective_indices`, is close to the dissertation's notation: one angle theta, ``tan(theta) = u / v``, is
propagated from below to above, and each mode is found by bisection.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import chain, pairwise
from typing import TYPE_CHECKING, Any, Literal, Self, SupportsIndex

import numpy as np

from tsis.compiled import compiled
from tsis.errors import InputError
from tsis.model.require import require_array, require_integer
from tsis.optics import angles as inputs

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import ArrayLike

    from tsis.optics.angles import Complexes, Floats, Integers


EPSILON = 2.0**-52


@compiled
def propagate_layer(u: float, v: float, p: float, q: float, length: float) -> tuple[float, float, int, float]:
    """Propagate (u, v) through a layer: the new pair, its omitted half-turns, and the log of its omitted factor.

    This stands for the dissertation's phases (3.45), (3.46), (3.47) and (3.48), which hold where all layers oscillate.
    """
    # The wave equation of one layer, where n is constant: u'' = -q u, with k0 x as length.
    # At its faces u and v = u' / p go on unchanged, (3.35), (3.36), (3.37), (3.38), (3.39): so (u, v) is all
    # that the next layer needs, and no amplitude or phase has to be matched.
    if q > 0.0:
        # q k0**2 is kappa**2 of the layer, (3.22), (3.23), (3.24), (3.25), so kappa is (3.50), (3.51), (3.52), (3.53).
        # u = a cos(kappa x + phi): the wave turns by kappa L, and u(L) = u cos(kappa L) + u' sin(kappa L) / kappa.
        # The dissertation keeps phi of each layer and matches tan(phi) at the faces: (3.45), (3.46), (3.47), (3.48).
        # There (3.46) must read ``-kappa_2 a_1``, not ``-kappa_2 a_2``. Here a layer turns by its own length, so that
        # no place of a face enters. Whole half-turns change only the sign and are counted apart.
        kappa = math.sqrt(q)
        half_turns = int(kappa * length / math.pi)
        rest = kappa * length - math.pi * half_turns  # in place of (3.45), (3.46), (3.47) and (3.48)
        cosine, sine = math.cos(rest), math.sin(rest)
        return u * cosine + p * v * sine / kappa, v * cosine - u * kappa * sine / p, half_turns, 0.0
    # Kappa is imaginary, and the wave decays as outside, (3.49), (3.54): cos and sin become cosh and sinh.
    gamma = math.sqrt(-q)
    depth = gamma * length
    if depth < 1.0:
        cosine = math.cosh(depth)
        sine = math.sinh(depth)
        over_gamma = length if depth == 0.0 else sine / gamma
        return u * cosine + p * v * over_gamma, v * cosine + u * gamma * sine / p, 0, 0.0
    # In a deep layer cosh and sinh overflow: u = growing exp(g x) + decaying exp(-g x), and exp(depth) is left out.
    growing, decaying = (u + p * v / gamma) / 2, (u - p * v / gamma) / 2
    if growing == 0.0:  # a purely decaying wave through a deep layer
        return decaying, -decaying * gamma / p, 0, -depth
    decaying *= math.exp(-2 * depth)
    return growing + decaying, (growing - decaying) * gamma / p, 0, depth


@compiled
def layer_phase(
    step: Floats, weight: Floats, length: Floats, offset: float, core: int, side: int
) -> tuple[int, float, float]:
    """Half-turns and direction (u, v) at the core of the solution that decays outside.

    ``side`` is 1 from below, -1 from above; v belongs to an x axis that points inwards.
    """
    outside = 0 if side > 0 else len(step) - 1
    # Outside q < 0, (3.21), (3.26): u = exp(-gamma |x|) with gamma of (3.49), (3.54); towards the stack u' = gamma u.
    # The printed (3.54) has ``k5**2 n5**2`` for ``k0**2 n5**2``.
    u, v = 1.0, math.sqrt(max(offset - step[outside], 0.0)) / weight[outside]
    half_turns = 0
    layer = outside + side
    while layer != core:
        u, v, passed, _ = propagate_layer(u, v, weight[layer], step[layer] - offset, length[layer])
        half_turns += passed
        if u < 0.0 or (u == 0.0 and v < 0.0):
            u, v = -u, -v
            half_turns += 1
        size = u + abs(v)
        u, v = u / size, v / size
        layer += side
    return half_turns, u, v


@compiled
def phase(step: Floats, weight: Floats, length: Floats, offset: float, core: int) -> tuple[int, float]:
    """Phase beyond that of the lowest mode: pi times the first number, plus the second."""
    below, u_below, v_below = layer_phase(step, weight, length, offset, core, 1)
    above, u_above, v_above = layer_phase(step, weight, length, offset, core, -1)
    # In the core u = cos(kappa x - phi). From below, p v / (kappa u) = tan(phi) at its lower face; from above, the same
    # at its upper face. Both solutions are one mode where kappa L - phi_below - phi_above is a multiple of pi: then
    # (3.40), (3.41), (3.42), (3.43), (3.44) are all satisfied.
    kappa, p = math.sqrt(max(step[core] - offset, 0.0)), weight[core]
    # Complements of the angles: near cut-off of a thin guide the phase is tiny, and adding pi / 2 would round it off.
    rest = kappa * length[core] - math.atan2(p * v_below, kappa * u_below) - math.atan2(p * v_above, kappa * u_above)
    return below + above, rest


@compiled
def modes_above(step: Floats, weight: Floats, length: Floats, offset: float, core: int) -> int:
    """Number of modes with N**2 above ``anchor**2 + offset``."""
    half_turns, rest = phase(step, weight, length, offset, core)
    return max(0, half_turns + math.ceil(rest / math.pi))


@compiled
def mode_roots(
    step: Floats, weight: Floats, length: Floats, low: float, high: float, core: int, first: int, roots: Floats
) -> None:
    """Fill ``roots`` with the descending offsets, between ``high`` and ``low``, from mode ``first`` on."""
    half_turns_low, rest_low = phase(step, weight, length, low, core)
    half_turns_high, rest_high = phase(step, weight, length, high, core)
    right, right_phase = high, rest_high + math.pi * (half_turns_high - first)
    for k in range(len(roots)):
        left_phase = rest_low + math.pi * (half_turns_low - first - k)
        roots[k] = _root(step, weight, length, core, first + k, low, left_phase, right, right_phase)
        right, right_phase = roots[k], -math.pi


@compiled
def _root(
    step: Floats,
    weight: Floats,
    length: Floats,
    core: int,
    mode: int,
    a: float,
    phase_a: float,
    b: float,
    phase_b: float,
) -> float:
    """Chandrupatla's bracketed search to full precision: the phase of coupled wells is a step."""
    if phase_a <= 0.0:
        return a
    if phase_b >= 0.0:
        return b
    fraction = 0.5
    while True:
        x = a + fraction * (b - a)
        half_turns, rest = phase(step, weight, length, x, core)
        phase_x = rest + math.pi * (half_turns - mode)
        if (phase_x > 0.0) == (phase_a > 0.0):
            c, phase_c = a, phase_a
        else:
            c, phase_c, b, phase_b = b, phase_b, a, phase_a
        a, phase_a = x, phase_x
        nearest = EPSILON * max(abs(a), abs(b)) + 1e-300
        least = nearest / abs(b - a)
        if least > 0.5 or phase_a == 0.0:
            return a if phase_a == 0.0 else (a + b) / 2
        fraction = 0.5
        xi, phi = (a - b) / (c - b), (phase_a - phase_b) / (phase_c - phase_b)
        if phi * phi < xi and (1 - phi) * (1 - phi) < 1 - xi:
            fraction = phase_a / (phase_b - phase_a) * phase_c / (phase_b - phase_c)
            fraction += (c - a) / (b - a) * phase_a / (phase_c - phase_a) * phase_b / (phase_c - phase_b)
        fraction = min(max(fraction, least), 1 - least)


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
        return modes_above(*self.at(anchor), offset, self.core)


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

    The dissertation gives this field region by region as (3.15), (3.16), (3.17), (3.18), (3.19) and (3.20), with the
    amplitudes (3.55), (3.56), (3.57), (3.58) and (3.59). The printed (3.55) must read ``e_1 = e_0 / cos(phi_1)``.
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
        # The amplitudes, for (3.55), (3.56), (3.57), (3.58), (3.59).
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
        # (3.29), (3.30), (3.31), (3.32), (3.33), (3.34): each wave's derivative, with the sign of its direction.
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
    for own in q[: number + 1]:
        nudged = (own + nudge * EPSILON * own.max() for nudge in NUDGES)
        # A nudge past cut-off gives no mode; the first q, without a nudge, decays on both sides.
        tries = chain.from_iterable(_joined(layers, near) for near in nudged if max(near[0], near[-1]) < 0)
        best = _best(_orthogonalised(waves, parts, wave, jump, EPSILON * own.max()) for wave, jump in tries)
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
        best = min(best, candidate, key=lambda one: one.error)
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
    for region in sorted(size, key=lambda region: -size[region]):
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


def effective_indices(
    index: Sequence[float],
    thickness_um: Sequence[float],
    *,
    wavelength_um: float,
    index_below: float = 1.0,
    index_above: float = 1.0,
    polarization: str = "TE",
) -> list[float]:
    """Effective indices of all guided modes, descending; parameters as of `tsis.optics.guided_modes`, unchecked.

    Examples
    --------
    >>> [round(n, 6) for n in effective_indices([1.5], [0.5], wavelength_um=0.55)]
    [1.441051, 1.259717, 1.001429]
    """
    regions = [index_below, *index, index_above]
    lengths = [2 * math.pi / wavelength_um * part for part in thickness_um]
    weights = [1.0 if polarization == "TE" else n**2 for n in regions]

    def modes_above(n_eff: float) -> int:
        """Whole multiples of pi of the angle beyond the angle of the solution that decays above."""
        q = [n**2 - n_eff**2 for n in regions]
        theta = math.atan2(weights[0], _rate(q[0]))
        for region, length in enumerate(lengths, start=1):
            theta = _reference_through(theta, q[region], weights[region], length)
        decaying = math.pi - math.atan2(weights[-1], _rate(q[-1]))
        return max(0, math.ceil((theta - decaying) / math.pi))

    low, high = max(index_below, index_above), max(regions)
    return [_bisect(modes_above, mode, low, high) for mode in range(modes_above(low))]


def _reference_through(theta: float, q: float, weight: float, length: float) -> float:
    """The angle behind a layer, where u = sin and v = cos of it up to a factor."""
    rate = _rate(q)
    if rate * length < 1e-12:  # a straight line
        return _stretched(theta, 1.0, weight * length)
    own = _stretched(theta, rate / weight, 0.0)  # the angle of (u, v p / rate)
    if q > 0:
        return _stretched(own + rate * length, weight / rate, 0.0)
    half_turns = math.floor(own / math.pi)
    rising = math.sin(own - half_turns * math.pi) + math.cos(own - half_turns * math.pi)
    falling = math.sin(own - half_turns * math.pi) - math.cos(own - half_turns * math.pi)
    falling *= math.exp(-2 * rate * length)
    out = math.atan2(rising + falling, rising - falling) % (2 * math.pi)  # it passes at most one zero
    return _stretched(out + half_turns * math.pi, weight / rate, 0.0)


def _stretched(theta: float, factor: float, shift: float) -> float:
    """The angle when u becomes ``factor u + shift v``, in the same half-turn or, by the shift, a later one."""
    half_turns = math.floor(theta / math.pi)
    u, v = math.sin(theta - half_turns * math.pi), math.cos(theta - half_turns * math.pi)
    return math.atan2(factor * u + shift * v, v) % (2 * math.pi) + half_turns * math.pi


def _rate(q: float) -> float:
    return math.sqrt(abs(q))


def _bisect(modes_above: Callable[[float], int], mode: int, low: float, high: float) -> float:
    while low < (middle := (low + high) / 2) < high:
        if modes_above(middle) > mode:
            low = middle
        else:
            high = middle
    return low


MOST_MODES = 5_000_000  # three numbers a mode: 120 MB


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GuidedModes:
    """All guided modes of a stack at one wavelength and polarization.

    Fields are functions of x, the height in µm above the lower face of the first layer, and are real. They are
    normalised in power: with e the electric and h the magnetic field across the direction of travel, the integral of
    ``e_a h_b`` over all x is 1 for a mode with itself and 0 for two modes. So e times ``sqrt(2 Z0 P)`` is in V/m for a
    mode that carries P watts a metre of width and metre of unit, and h times ``sqrt(2 P / Z0)`` is in A/m, x then being
    in metres; Z0 is the impedance of vacuum.

    Attributes
    ----------
    layers
        The stack in units of the wavelength, with its surroundings.
    n_eff
        Effective indices, descending: phase index of each mode, (modes,). Mode j has j zeros in its field. A mode at
        cut-off within rounding has the index of the surroundings.
    anchor, offset
        The same in full precision, ``n_eff**2 = anchor**2 + offset``, with the anchor an index of the stack.
    """

    layers: SlabLayers
    n_eff: Floats
    anchor: Floats
    offset: Floats

    def __post_init__(self) -> None:
        for name in ("n_eff", "anchor", "offset"):
            getattr(self, name).flags.writeable = False

    def __len__(self) -> int:
        return len(self.n_eff)

    def profile(self, mode: SupportsIndex, x_um: ArrayLike) -> Floats:
        """Electric field e across the direction of travel: E_y of TE; E_x of TM, which jumps between layers.

        Parameters
        ----------
        mode
            Index of the mode, from 0 for the largest ``n_eff``.
        x_um
            Heights in µm above the lower face of the first layer, any shape; also outside the stack.

        Raises
        ------
        InputError
            When there is no such mode, or ``x_um`` is not finite.
        """
        field, n_eff = self._field(mode), self.n_eff[mode]
        x = self._heights(x_um)
        wave = field.wave(x)
        return wave if self.layers.polarization == "TE" else wave * n_eff / self.layers.weight_at(x)

    def magnetic(self, mode: SupportsIndex, x_um: ArrayLike) -> Floats:
        """Magnetic field h across the direction of travel: -H_x of TE, H_y of TM; parameters as of `profile`."""
        field, n_eff = self._field(mode), self.n_eff[mode]
        wave = field.wave(self._heights(x_um))
        return wave * n_eff if self.layers.polarization == "TE" else wave

    def longitudinal(self, mode: SupportsIndex, x_um: ArrayLike) -> Floats:
        """Field along the direction of travel, H_z of TE and E_z of TM, a quarter of a period behind the others.

        This is the dissertation's h(x), (3.29), (3.30), (3.31), (3.32), (3.33) and (3.34), printed there with wrong
        signs. It is continuous between layers. The printed (3.27) lacks the other part of H, `magnetic`. Parameters as
        of `profile`.
        """
        return self._field(mode).slope(self._heights(x_um))

    def above(self, index: float) -> int:
        """Number of modes with an effective index above ``index``; they decay in layers of that index."""
        return int(np.count_nonzero(self.n_eff > index))

    def _field(self, mode: SupportsIndex) -> SlabField:
        if not len(self):
            raise InputError(f"mode must be a guided mode, and the stack guides none; got {mode!r}")
        number = require_integer("mode", mode, 0, len(self) - 1)
        group = nearly_degenerate(self.anchor, self.offset, self._q(number).max(), number)
        q = np.array([self._q(index) for index in range(group.start, group.stop)])
        return mode_field(self.layers, self.n_eff[group], q, number - group.start)

    def _q(self, mode: int) -> Floats:
        return np.asarray(self.layers.at(self.anchor[mode])[0] - self.offset[mode])

    def _heights(self, x_um: Any) -> Floats:
        heights = np.asarray(x_um, dtype=float)
        require_array("x_um", heights.ravel(), ndim=1)
        return heights


def guided_modes(
    index: ArrayLike,
    thickness_um: ArrayLike,
    *,
    wavelength_um: float,
    index_below: float = 1.0,
    index_above: float = 1.0,
    polarization: Literal["TE", "TM"] = "TE",
) -> GuidedModes:
    """Find all guided modes of a stack: max(n_below, n_above) < n_eff < max(n).

    The phase of a Sturm-Liouville problem counts the modes, then a bracketed search finds each to the last digits; see
    `tsis.optics.slab`. This replaces the dissertation's conditions (3.40), (3.41), (3.42), (3.43) and (3.44)
    with the phases (3.45), (3.46), (3.47) and (3.48), which are valid only where all layers oscillate.

    Parameters
    ----------
    index
        Real refractive indices of the layers from below up, in [1, 5], (layers,).
    thickness_um
        Their thicknesses in µm, in [1e-4, 1e6], (layers,).
    wavelength_um
        Wavelength in vacuum, µm, in [0.1, 20].
    index_below, index_above
        Real refractive indices of the half-spaces below and above, in [1, 5].
    polarization
        ``"TE"``, the electric field along the layers, or ``"TM"``, the magnetic one.

    Returns
    -------
    GuidedModes
        Empty below cut-off: when the surroundings differ and the stack is too thin to guide.

    Raises
    ------
    InputError
        When a value lies outside its range, no layer's index exceeds that of the surroundings, or there are more than
        five million modes.

    Examples
    --------
    >>> modes = guided_modes([1.16, 1.15, 1.14, 1.13], [2.0, 3.0, 4.0, 1.0], wavelength_um=0.55)
    >>> len(modes), float(modes.n_eff[0].round(12))
    (21, 1.155764784371)
    """
    layers = SlabLayers.checked(index, thickness_um, wavelength_um, index_below, index_above, polarization)
    if layers.index.max() <= layers.surroundings:
        raise InputError(
            f"index must exceed the surroundings' {layers.surroundings:g} in at least one layer to guide; "
            f"got at most {layers.index[1:-1].max():g}"
        )
    anchors, offsets = zip(*_intervals_of_modes(layers), strict=True)
    anchor, offset = np.concatenate(anchors), np.concatenate(offsets)
    # The small difference to the anchor avoids rounding in the square root of the sum.
    n_eff = anchor + offset / (anchor + np.sqrt(anchor**2 + offset))
    return GuidedModes(layers=layers, n_eff=n_eff, anchor=anchor, offset=offset)


def _intervals_of_modes(layers: SlabLayers) -> Iterator[tuple[Floats, Floats]]:
    """Anchors and offsets of the modes, descending; each half between two indices has the nearer index as anchor."""
    levels = np.unique(layers.index[layers.index >= layers.surroundings])[::-1].tolist()
    if (count := layers.modes_above(levels[-1], 0.0)) > MOST_MODES:
        raise InputError(
            f"the stack must guide at most {MOST_MODES:,} modes, which fill {24 * MOST_MODES / 1e6:.0f} MB; "
            f"got {count:,} (choose thinner layers or a longer wavelength)"
        )
    first = 0
    for upper, lower in pairwise(levels):
        half = (upper - lower) * (upper + lower) / 2
        for anchor, low, high in ((upper, -half, 0.0), (lower, 0.0, half)):
            last = max(first, layers.modes_above(anchor, low))
            offsets = np.empty(last - first)
            mode_roots(*layers.at(anchor), low, high, layers.core, first, offsets)
            yield np.full_like(offsets, anchor), offsets
            first = last
