"""Phase of a wave across a stack, which counts and finds the modes; compiled.

The field u of a guided mode (E_y of TE, H_y of TM) obeys, with X = k0 x and N the mode's effective index,

    u' = p v,   v' = -(q / p) u,   q = n**2 - N**2,   p = 1 (TE) or n**2 (TM),

with u and v continuous: a Sturm-Liouville problem. Its solutions that decay below and above the stack are propagated
from both sides into the layer of highest index, the core, as half-turns (zeros of u) and a direction (u, v) with
u >= 0. Mode j is where the total phase of the core and both sides is (j + 1) pi. The phase decreases monotonically with
N, so each multiple of pi occurs once: the search finds each mode exactly once.

N**2 is ``anchor**2 + offset`` with the anchor an index of the stack. So q of that layer or of the surroundings has full
precision at any distance from cut-off.

For TE the two equations are the dissertation's wave equations (3.9), (3.10), (3.11), (3.12), (3.13) and (3.14), printed
there without the second derivative. ``k0**2 q`` is its ``kappa**2`` of a layer, (3.22), (3.23), (3.24) and (3.25), and
``-k0**2 q`` that of the half-spaces, (3.21) and (3.26). So kappa is (3.50), (3.51), (3.52) and (3.53) where q > 0.
Where q < 0 in a layer, kappa is imaginary, and the wave decays as outside, (3.49) and (3.54). The printed (3.54) has
``k5**2 n5**2`` for ``k0**2 n5**2``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tsis.compiled import compiled

if TYPE_CHECKING:
    from tsis.optics._inputs import Floats

EPSILON = 2.0**-52


@compiled
def propagate_layer(u: float, v: float, p: float, q: float, length: float) -> tuple[float, float, int, float]:
    """Propagate (u, v) through a layer: the new pair, its omitted half-turns, and the log of its omitted factor.

    u and v are continuous at the faces of a layer, the dissertation's (3.35), (3.36), (3.37), (3.38) and (3.39). The
    dissertation uses the phases (3.45), (3.46), (3.47) and (3.48) instead; (3.46) must read ``-kappa_2 a_1``, not
    ``-kappa_2 a_2``.
    """
    if q > 0.0:
        kappa = math.sqrt(q)
        half_turns = int(kappa * length / math.pi)
        rest = kappa * length - math.pi * half_turns
        cosine, sine = math.cos(rest), math.sin(rest)
        return u * cosine + p * v * sine / kappa, v * cosine - u * kappa * sine / p, half_turns, 0.0
    gamma = math.sqrt(-q)
    depth = gamma * length
    if depth < 1.0:
        cosine = math.cosh(depth)
        sine = math.sinh(depth)
        over_gamma = length if depth == 0.0 else sine / gamma
        return u * cosine + p * v * over_gamma, v * cosine + u * gamma * sine / p, 0, 0.0
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
    """Phase beyond that of the lowest mode: pi times the first number, plus the second.

    It is a multiple of pi where the dissertation's (3.40), (3.41), (3.42), (3.43) and (3.44) are all satisfied.
    """
    below, u_below, v_below = layer_phase(step, weight, length, offset, core, 1)
    above, u_above, v_above = layer_phase(step, weight, length, offset, core, -1)
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
    step: Floats, weight: Floats, length: Floats, low: float, high: float, core: int, first: int, result: Floats
) -> None:
    """Fill ``result`` with the descending offsets, between ``high`` and ``low``, from mode ``first`` on."""
    half_turns_low, rest_low = phase(step, weight, length, low, core)
    half_turns_high, rest_high = phase(step, weight, length, high, core)
    right, right_phase = high, rest_high + math.pi * (half_turns_high - first)
    for k in range(len(result)):
        left_phase = rest_low + math.pi * (half_turns_low - first - k)
        result[k] = _root(step, weight, length, core, first + k, low, left_phase, right, right_phase)
        right, right_phase = result[k], -math.pi


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
