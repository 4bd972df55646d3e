"""The forward model and its likelihood written a second time, one point at a time, as loops over the equations.

`tsis.inclusion.posterior` computes arrays of many inclusions. This code computes one inclusion and one set of
nuisances, fast enough for millions of them. Both share only the press tables.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.simulation_based_calibration import noise

from tsis.compiled import compiled

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tsis.inclusion.posterior.forward import ForwardModel
    from tsis.inclusion.posterior.likelihood import Profiles
    from tsis.mechanics.surrogate.polynomial import Surrogate

    Numbers = NDArray[np.float64]
    # Plain tissue: values and two axes; change by an inclusion: values and five axes.
    Table = tuple[Numbers, tuple[Numbers, Numbers], Numbers, tuple[Numbers, Numbers, Numbers, Numbers, Numbers]]
    Tables = tuple[Table, Table, Table]

DARKEST = 1e-3  # light on a flank that the lamps do not reach, over that on the level face


def looped(model: ForwardModel) -> Callable[[Numbers | None, Numbers], Numbers]:
    """Grey profiles (frames, rings) of one inclusion (3,), or of plain tissue, and nuisances."""
    rings, prior, known = model.rings, model.prior, model.calibration
    believed = (math.log(prior.tissue_young_kpa), math.log(prior.thickness_mm))
    # What is linear in its nuisance is taken at the believed tissue.
    by_poisson, by_spread = (_in_tissue(_table(one), *believed) for one in (rings.by_poisson, rings.by_spread))
    tables = (_table(rings.response), by_poisson, by_spread)
    answer = (known.gain_grey_per_kpa, known.saturation_kpa, model.depletion_per_n)
    light = (model.level, model.shading.growth_per_mm, model.shading.bend_per_mm2, model.shading.flux)
    nothing = np.zeros(3)

    def grey(inclusion: Numbers | None, nuisance: Numbers) -> Numbers:
        shown = nothing if inclusion is None else inclusion
        plain = model.is_reference | (inclusion is None)
        site = model.is_reference
        return _grey(
            tables, shown, nuisance, model.force_n, plain, site, believed, answer, light, rings.count, rings.is_domed
        )

    return grey


def log_likelihood(model: ForwardModel, data: Profiles) -> Callable[[Numbers | None, Numbers], float]:
    """Log density of the usable profiles, without the constant of the noise, for one inclusion and nuisances."""
    grey, use = looped(model), data.usable.ravel()
    precision = np.linalg.inv(noise(data.grey, data.variance, model)[np.ix_(use, use)])
    seen = data.grey.ravel()[use]

    def density(inclusion: Numbers | None, nuisance: Numbers) -> float:
        left = seen - grey(inclusion, nuisance).ravel()[use]
        return float(-0.5 * left @ precision @ left)

    return density


def _table(surrogate: Surrogate) -> Table:
    """Values and the places along each axis for which they hold."""
    box = surrogate.box
    tissue, slab = ((math.log(low), math.log(high)) for low, high in (box.tissue_young_kpa, box.thickness_mm))
    plain, change = surrogate.baseline, surrogate.change
    ranges = (box.diameter_mm, box.depth_mm, box.contrast_factor, tissue, slab)
    axes = [_places(ends, count) for ends, count in zip(ranges, change.shape, strict=False)]
    return (
        np.ascontiguousarray(plain),
        (_places(tissue, plain.shape[0]), _places(slab, plain.shape[1])),
        np.ascontiguousarray(change),
        (axes[0], axes[1], axes[2], axes[3], axes[4]),
    )


def _in_tissue(table: Table, log_tissue: float, log_slab: float) -> Table:
    """The same at one tissue: an axis of one place says that nothing depends on it."""
    plain, plain_axes, change, axes = table
    here = [np.outer(_lagrange(t, log_tissue), _lagrange(s, log_slab)) for t, s in (plain_axes, axes[3:])]
    nowhere = np.zeros(1)
    return (
        np.einsum("ts,tsk->k", here[0], plain)[None, None],
        (nowhere, nowhere),
        np.einsum("ts,dhgtsk->dhgk", here[1], change)[:, :, :, None, None],
        (axes[0], axes[1], axes[2], nowhere, nowhere),
    )


def _places(ends: tuple[float, float], count: int) -> Numbers:
    """Roots of the Chebyshev polynomial of degree ``count`` between the ends, ascending."""
    low, high = ends
    return np.array([(low + high - (high - low) * math.cos(math.pi * (i + 0.5) / count)) / 2 for i in range(count)])


@compiled
def _lagrange(nodes: Numbers, x: float) -> Numbers:
    """Value at ``x`` of each polynomial that is one at one node and zero at the others."""
    weight = np.ones(len(nodes))
    for i in range(len(nodes)):
        for j in range(len(nodes)):
            if j != i:
                weight[i] *= (x - nodes[j]) / (nodes[i] - nodes[j])
    return weight


@compiled
def _plain(table: Table, log_tissue: float, log_slab: float) -> Numbers:
    """Answers of plain tissue."""
    values, nodes, _, _ = table
    in_tissue, in_slab = _lagrange(nodes[0], log_tissue), _lagrange(nodes[1], log_slab)
    found = np.zeros(values.shape[2])
    for t in range(len(in_tissue)):
        for s in range(len(in_slab)):
            found += in_tissue[t] * in_slab[s] * values[t, s]
    return found


@compiled
def _change(table: Table, inclusion: Numbers, log_tissue: float, log_slab: float) -> Numbers:
    """What an inclusion (diameter, depth, modulus) changes."""
    _, _, values, nodes = table
    diameter, depth, contrast = inclusion[0], inclusion[1], inclusion[2] / np.exp(log_tissue)
    factor = (contrast - 1) / (contrast + 1.5)
    in_d, in_h = _lagrange(nodes[0], diameter), _lagrange(nodes[1], depth)
    in_g, in_t, in_s = _lagrange(nodes[2], factor), _lagrange(nodes[3], log_tissue), _lagrange(nodes[4], log_slab)
    found = np.zeros(values.shape[5])
    for d in range(len(in_d)):
        for h in range(len(in_h)):
            for g in range(len(in_g)):
                for t in range(len(in_t)):
                    for s in range(len(in_s)):
                        weight = in_d[d] * in_h[h] * in_g[g] * in_t[t] * in_s[s]
                        for k in range(len(found)):
                            found[k] += weight * values[d, h, g, t, s, k]
    found *= factor * (diameter / (depth + diameter / 2)) ** 3
    return found


@compiled
def _answers(
    tables: Tables,
    inclusion: Numbers,
    nuisance: Numbers,
    believed: tuple[float, float],
    rings: int,
    plain: bool,
    site: bool,
) -> Numbers:
    """Signal of each ring per newton and, under a dome, by its shape.

    `tsis.inclusion.posterior.forward` lists the nuisances.

    A probe stiffer by a factor on some tissue does what the believed one does on tissue softer by that factor, with
    pressures and forces in units larger by it.
    """
    stiffer = math.exp(nuisance[4])
    log_tissue = believed[0] + nuisance[1] - nuisance[4]
    if site:
        log_tissue += nuisance[3]
    log_slab = believed[1] + nuisance[2]
    found = _plain(tables[0], log_tissue, log_slab)
    linear = nuisance[5] * _plain(tables[1], believed[0], believed[1])
    if not plain:
        softer = np.array([inclusion[0], inclusion[1], inclusion[2] / stiffer])
        found += _change(tables[0], softer, log_tissue, log_slab)
        linear += nuisance[5] * _change(tables[1], inclusion, believed[0], believed[1])
        linear += nuisance[6] * _change(tables[2], inclusion, believed[0], believed[1])
    for k in range(len(found)):
        if rings <= k < 3 * rings:
            found[k] /= stiffer
        elif 3 * rings <= k < 4 * rings:
            found[k] *= stiffer
    found += linear
    return found


@compiled
def _grey(
    tables: Tables,
    inclusion: Numbers,
    nuisance: Numbers,
    force_n: Numbers,
    plain: NDArray[np.bool],
    site: NDArray[np.bool],
    believed: tuple[float, float],
    answer: tuple[float, float, float],
    light: tuple[Numbers, Numbers, Numbers, Numbers],
    rings: int,
    is_domed: bool,
) -> Numbers:
    gain, saturation, depletion = answer
    level, growth, bend, flux = light
    frames = len(force_n)
    grey = np.empty((frames, rings))
    shown = -1  # which press ``found`` holds: frames of one site share it
    found = np.empty(0)
    for frame in range(frames):
        if shown != int(site[frame]):
            shown = int(site[frame])
            found = _answers(tables, inclusion, nuisance, believed, rings, plain[frame], site[frame])
        force = force_n[frame] * math.exp(nuisance[10 + frame])
        bright = math.exp(nuisance[0]) / (1.0 + depletion * force)
        for ring in range(rings):
            pressure, displacement, slope = (
                force * found[ring],
                force * found[rings + ring],
                force * found[2 * rings + ring],
            )
            if is_domed:
                pressure += found[3 * rings + ring]
                displacement += found[4 * rings + ring]
                slope += found[5 * rings + ring]
            x = 2.0 * ring / (rings - 1) - 1.0
            emphasis = nuisance[7] + nuisance[8] * x + nuisance[9] * (1.5 * x * x - 0.5)
            tilt = max(1.0 + flux[ring] * slope, DARKEST)
            grown = math.exp(growth[ring] * displacement + bend[ring] * displacement**2)
            shade = (grown * tilt) ** (1.0 + emphasis)
            contact = gain * saturation * math.erf(math.sqrt(math.pi) / 2 * max(pressure, 0.0) / saturation)
            grey[frame, ring] = bright * contact * shade + nuisance[10 + frames + frame] / level[ring]
    return grey
