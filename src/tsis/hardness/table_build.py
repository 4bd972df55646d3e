"""The contact table of a probe: solved once, fitted, checked and kept."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.hardness.contact_table import (
    MIDDLE_POISSON,
    MIDDLE_RADIUS_MM,
    POISSON_STEP,
    ContactTable,
    firmness,
    skin_compliance,
    terms,
)
from tsis.hardness.seen_sphere import hertzian_radius_mm, press_fields
from tsis.mechanics import SphereResolution
from tsis.mechanics.surrogate_solves import cached_arrays, mechanical_content
from tsis.model import Probe, SoftSphere
from tsis.model.check import require_type
from tsis.model.disk_cache import content_key
from tsis.model.press import MN_PER_N

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

FORMAT_VERSION = 2
KIND = "contact-tables"
SKIN_KPA = 100.0  # of the probe that is solved: all moduli share a unit with the force, so any skin is this one
RESOLUTION = SphereResolution(order=3, cells=6, rings=2, face_cells=6)
LOADS = np.array([0.04, 0.07, 0.11, 0.19, 0.31, 0.5, 0.8, 1.2, 1.6, 2.0, 2.4, 2.6, 2.8, 3.2])  # depth cubed
SMALLEST_RADIUS_MM, WIDEST_SHARE = 1.65, 0.55  # of the spheres; the widest as a share of the face's radius


@dataclass(frozen=True, slots=True, kw_only=True)
class SphereCase:
    """One sphere of the design: its share of the compliance, radius and Poisson's ratio."""

    softness: float
    radius_mm: float
    poisson: float = MIDDLE_POISSON


def design_of(probe: Probe) -> tuple[SphereCase, ...]:
    """The spheres that are solved for a probe: 6 of the middle radius and ratio, 6 of other radii, 6 of other ratios.

    Where the sphere is stiff its ratio does not matter, where it is soft its radius does not: no case is spent there.
    """
    widest = WIDEST_SHARE * probe.radius_mm
    middle = min(MIDDLE_RADIUS_MM, widest)
    spread = np.cos(np.pi * (np.arange(6) + 0.5) / 6) / np.cos(np.pi / 12)
    cases = [SphereCase(softness=float(0.5 - 0.48 * x), radius_mm=middle) for x in spread]
    cases += [
        SphereCase(softness=softness, radius_mm=radius)
        for radius in (min(SMALLEST_RADIUS_MM, middle / 2), widest)
        for softness in (0.02, 0.3, 0.7)
    ]
    cases += [
        SphereCase(softness=softness, radius_mm=middle, poisson=MIDDLE_POISSON + step)
        for step in (-POISSON_STEP, 0.8 * POISSON_STEP)  # 0.495 is the most that the elements take
        for softness in (0.3, 0.7, 0.98)
    ]
    return tuple(cases)


def build_contact_table(
    probe: Probe,
    *,
    resolution: SphereResolution = RESOLUTION,
    progress: Callable[[int, int], None] | None = None,
    cached: bool = True,
) -> ContactTable:
    """The contact table of a probe: from the package or the disk cache, else solved, which takes some minutes.

    Probes whose moduli are in proportion share a table.

    Parameters
    ----------
    probe
        The probe; its face may be domed.
    resolution
        Mesh density.
    progress
        Called with (spheres solved, spheres in all) as the work goes on.
    cached
        Whether to use the tables of the package and the disk cache.

    Raises
    ------
    MechanicsError
        When no force on one of the spheres converges.

    Examples
    --------
    >>> import tsis
    >>> table = build_contact_table(tsis.load_probe("tsis-2011"))
    >>> f"{float(np.exp(table.log_radius(103.0, 0.49, 3.0, 0.7))):.2f} mm"
    '2.77 mm'
    """
    require_type("probe", probe, Probe)
    require_type("resolution", resolution, SphereResolution)
    unit = _with_skin(probe, SKIN_KPA)
    key = content_key(
        {
            "format": FORMAT_VERSION,
            "probe": _rounded(mechanical_content(unit)),
            "resolution": asdict(resolution),
            "loads": LOADS.tolist(),
        }
    )

    def solved() -> dict[str, NDArray[np.float64]]:
        return _solve(unit, resolution, progress)

    arrays = (_shipped(key) or cached_arrays(KIND, key, solved)) if cached else solved()
    return ContactTable(
        coefficients=arrays["coefficients"],
        softness=arrays["softness"],
        deepest=arrays["deepest"],
        error=arrays["error"],
        skin_compliance=skin_compliance(probe),
        key=key,
    )


def _with_skin(probe: Probe, young_kpa: float) -> Probe:
    """The probe with all moduli in proportion and a skin of ``young_kpa``."""
    factor = young_kpa / probe.layers[0].young_kpa
    return replace(probe, layers=tuple(replace(one, young_kpa=factor * one.young_kpa) for one in probe.layers))


def _rounded(content: Any) -> Any:
    """Content whose numbers do not differ by the rounding of a proportion."""
    if isinstance(content, dict):
        return {name: _rounded(value) for name, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [_rounded(value) for value in content]
    return float(f"{content:.10g}") if isinstance(content, float) else content


def _shipped(key: str) -> dict[str, NDArray[np.float64]] | None:
    """A table that comes with the package; those of the catalog's flat probes do."""
    file = files(__package__) / "tables" / f"{key}.json"
    if not file.is_file():
        return None
    return {name: np.asarray(values) for name, values in json.loads(file.read_text(encoding="utf-8")).items()}


def _solve(
    probe: Probe, resolution: SphereResolution, progress: Callable[[int, int], None] | None
) -> dict[str, NDArray[np.float64]]:
    cases = design_of(probe)
    added: list[NDArray[np.float64]] = []
    for done, case in enumerate(cases):
        if progress is not None:
            progress(done, len(cases))
        added.append(added_log_radius(probe, case, resolution))
    rows, weights = zip(*(_rows(case, len(part)) for case, part in zip(cases, added, strict=True)), strict=True)
    coefficients = _fit(rows, added, weights)
    middle = [place for place, case in enumerate(cases) if case.poisson == MIDDLE_POISSON][:6]
    return {
        "coefficients": coefficients,
        "softness": np.array([cases[place].softness for place in middle]),
        "deepest": np.array([np.cbrt(LOADS[len(added[place]) - 1]) for place in middle]),
        "error": np.array([_unseen_error(place, rows, added, weights) for place in middle]),
    }


def added_log_radius(probe: Probe, case: SphereCase, resolution: SphereResolution) -> NDArray[np.float64]:
    """Logarithm of the contact radius over Hertz's at `LOADS`, as far as the mechanics reach."""
    skin = skin_compliance(probe)
    soft = skin * case.softness / (1 - case.softness)
    sphere = SoftSphere(radius_mm=case.radius_mm, young_kpa=(1 - case.poisson**2) / soft, poisson=case.poisson)
    forces = LOADS * case.radius_mm**2 / (soft + skin) / MN_PER_N
    fields = press_fields(probe, sphere, forces_n=forces.tolist(), resolution=resolution, stop_at_limit=True)
    radii = np.array([hertzian_radius_mm(field) for field in fields])
    return np.asarray(np.log(radii / case.radius_mm) - np.log(0.75 * LOADS[: len(radii)]) / 3)


def _rows(case: SphereCase, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Terms and weights of the presses of one sphere."""
    depth = np.cbrt(LOADS[:count])
    return terms(depth, case.softness, case.radius_mm, case.poisson), firmness(depth)


def _fit(
    rows: Sequence[NDArray[np.float64]], added: Sequence[NDArray[np.float64]], weights: Sequence[NDArray[np.float64]]
) -> NDArray[np.float64]:
    weight = np.concatenate(weights)
    answer = np.linalg.lstsq(weight[:, None] * np.concatenate(rows), weight * np.concatenate(added), rcond=1e-8)
    return np.asarray(answer[0])


def _unseen_error(
    left_out: int,
    rows: Sequence[NDArray[np.float64]],
    added: Sequence[NDArray[np.float64]],
    weights: Sequence[NDArray[np.float64]],
) -> float:
    """Weighted root mean square over one sphere's presses of a fit without them."""
    others = [place for place in range(len(rows)) if place != left_out]
    found = _fit(*([part[place] for place in others] for part in (rows, added, weights)))
    error = weights[left_out] * (added[left_out] - rows[left_out] @ found)
    return float(np.sqrt((error**2).sum() / (weights[left_out] ** 2).sum()))
