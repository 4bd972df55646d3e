"""Starts of rays: positions on a lamp's face from an even sequence, and the lamp's cosine law."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tsis.compiled import inlined

if TYPE_CHECKING:
    from tsis.model.probe import Probe
    from tsis.optics._inputs import Floats


# Fractional parts of the powers of 1/g, where g^5 = g + 1: the most even additive sequence in four dimensions.
_GOLDEN = 1.1673039782614187
STRIDES = tuple(int((_GOLDEN**-power % 1.0) * 2**53) << 11 for power in (1, 2, 3, 4))


class Lamps(NamedTuple):
    """Lit lamps, one a row: position (x, y, z), axis (x, y, z), radius, exponent and fraction of the power."""

    position: Floats
    axis: Floats
    radius: Floats
    exponent: Floats
    power_fraction: Floats


def lamps(probe: Probe) -> Lamps:
    """The lit lamps of a probe."""
    lit = [led for led in probe.leds if led.power > 0]
    azimuth, aim = (np.radians([getattr(led, name) for led in lit]) for name in ("azimuth_deg", "aim_deg"))
    height = np.array([probe.led_height_mm(led) for led in lit])
    power = np.array([led.power for led in lit])
    out_x, out_y = np.cos(azimuth), np.sin(azimuth)
    return Lamps(
        position=np.column_stack([probe.radius_mm * out_x, probe.radius_mm * out_y, height]),
        axis=np.column_stack([-out_x * np.cos(aim), -out_y * np.cos(aim), np.sin(aim)]),
        radius=np.array([led.diameter_mm / 2 for led in lit]),
        exponent=np.array([led.exponent for led in lit]),
        power_fraction=power / power.sum(),
    )


@inlined
def scrambled(number: np.uint64) -> np.uint64:
    """Pseudo-random number by splitmix64 (Steele, Lea and Flood 2014)."""
    number = np.uint64(number + np.uint64(0x9E3779B97F4A7C15))
    number = np.uint64((number ^ (number >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9))
    number = np.uint64((number ^ (number >> np.uint64(27))) * np.uint64(0x94D049BB133111EB))
    return np.uint64(number ^ (number >> np.uint64(31)))


@inlined
def unit(number: np.uint64) -> float:
    """A number in [0, 1) from the upper 53 bits."""
    return float(np.float64(number >> np.uint64(11)) * 2.0**-53)


@inlined
def emitted(
    lamps: Lamps, lamp: int, u: float, v: float, s: float, t: float
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Position and direction of a ray of a lamp from four numbers in [0, 1)."""
    out, polar = lamps.radius[lamp] * np.sqrt(u), 2 * np.pi * v
    px, py, pz = lamps.position[lamp, 0], lamps.position[lamp, 1], lamps.position[lamp, 2]
    from_axis = np.hypot(px, py)
    # The emitting face lies in the wall's tangent plane, which spans z and the horizontal tangent.
    along, up = out * np.cos(polar), out * np.sin(polar)
    x, y, z = px - along * py / from_axis, py + along * px / from_axis, pz + up
    cosine = (1.0 - s) ** (1.0 / (lamps.exponent[lamp] + 1.0))
    sine, around = np.sqrt(max(0.0, 1.0 - cosine * cosine)), 2 * np.pi * t
    ax, ay, az = lamps.axis[lamp, 0], lamps.axis[lamp, 1], lamps.axis[lamp, 2]
    # Two directions across the axis: a horizontal one, which exists because no lamp aims upwards, and the product.
    flat = np.hypot(ax, ay)
    hx, hy = -ay / flat, ax / flat
    vx, vy, vz = -az * hy, az * hx, ax * hy - ay * hx
    c, q = sine * np.cos(around), sine * np.sin(around)
    return (x, y, z), (cosine * ax + c * hx + q * vx, cosine * ay + c * hy + q * vy, cosine * az + q * vz)
