"""Forces at which the model of an estimate holds: enough to press the whole face, not more than small strain takes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.mechanics.strain_limit import STRAIN_LIMIT, nominal_strain
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.inclusion.prior import InclusionPrior
    from tsis.mechanics import FullContactSurrogate, Surrogate
    from tsis.model import Probe, TactileImage


def require_valid_forces(
    frames: Sequence[TactileImage], surrogate: FullContactSurrogate, *, probe: Probe, prior: InclusionPrior
) -> None:
    """Refuse forces that do not press the whole face onto the prior's plain tissue, or that strain it too much.

    Raises
    ------
    InputError
        Naming the frame and the range of forces.
    """
    least, most = covering_force_n(surrogate, prior, None), largest_force_n(surrogate, probe=probe, prior=prior)
    if least > most:
        raise InputError(
            f"no force serves this probe on tissue of {prior.tissue_young_kpa:g} kPa: its whole dome touches from "
            f"{_up(least):g} N on, and small strain holds up to {_down(most):g} N: use a flatter dome or stiffer tissue"
        )
    for frame in frames:
        force = frame.force_n or 0.0
        if not least <= force <= most:
            whole = f"from {_up(least):g} N, at which the whole dome touches, " if least > 0 else ""
            raise InputError(
                f"force_n must be {whole}up to {_down(most):g} N, a nominal strain of {STRAIN_LIMIT:g}, on tissue of "
                f"{prior.tissue_young_kpa:g} kPa; got {force:g} N for {frame.name or 'an image'!r}: press at a force "
                "in between"
            )


def _up(force_n: float) -> float:
    """Two digits, rounded so that the limit itself is accepted."""
    digit = 10 ** (np.floor(np.log10(force_n)) - 1)
    return float(np.format_float_positional(np.ceil(force_n / digit) * digit, precision=6))


def _down(force_n: float) -> float:
    digit = 10 ** (np.floor(np.log10(force_n)) - 1)
    return float(np.format_float_positional(np.floor(force_n / digit) * digit, precision=6))


def covering_force_n(
    surrogate: FullContactSurrogate,
    prior: InclusionPrior,
    inclusion: NDArray[np.float64] | None,
    *,
    stiffening: float = 1.0,
) -> float:
    """Force in newtons from which the contact covers the face, 0 of a flat one.

    ``inclusion`` holds diameter, depth and modulus; ``stiffening`` is the tissue's modulus over the prior's.
    """
    if surrogate.covering_force_n is None:
        return 0.0
    at = surrogate.covering_force_n.at_tissue(prior.tissue_young_kpa * stiffening, prior.thickness_mm)
    found = at.plain if inclusion is None else at(*inclusion[:, None])[0]
    return float(found[0])


def largest_force_n(surrogate: FullContactSurrogate, *, probe: Probe, prior: InclusionPrior) -> float:
    """Force at which the nominal strain on plain tissue reaches the limit; none or less where the shape alone does."""
    at_none, per_newton = nominal_strains(surrogate, probe=probe, prior=prior)
    return (STRAIN_LIMIT - at_none) / per_newton


def nominal_strains(surrogate: FullContactSurrogate, *, probe: Probe, prior: InclusionPrior) -> tuple[float, float]:
    """Nominal strain of plain tissue at no force, and what each newton adds."""
    at = (prior.tissue_young_kpa, prior.thickness_mm)

    def strain(approach_mm: Surrogate) -> float:
        return nominal_strain(float(approach_mm.plain_at(*at)[0]), probe, prior.thickness_mm)

    at_none = 0.0 if surrogate.shape is None else strain(surrogate.shape.approach_mm)
    return at_none, strain(surrogate.unit.approach_mm)
