"""Contact radius of a soft sphere on a probe: Hertz's law, corrected for finite strain."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.files.cache import cached_arrays, content_key
from tsis.hardness.sphere import hertzian_radius_mm, press_fields
from tsis.mechanics.finite_strain.soft_sphere import SphereResolution
from tsis.mechanics.mesh import mechanical_content
from tsis.model.phantom import SoftSphere
from tsis.model.press import MN_PER_N
from tsis.model.probe import Probe
from tsis.model.require import require_array, require_type

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray


MIDDLE_RADIUS_MM, RADIUS_STEP_MM = 3.3, 3.0
MIDDLE_POISSON, POISSON_STEP = 0.475, 0.025
BASE_DEGREES, BASE_TOTAL = (4, 3), 5  # in depth and softness, for a sphere of the middle radius and ratio
CHANGE_DEGREES, CHANGE_TOTAL, CHANGE_ORDER = (3, 1), 4, 2  # of the change with radius or ratio
FIRM_DEPTH = 0.6  # a contact this deep is many elements wide


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContactTable:
    """Contact radius of a sphere on one probe, by load and the sphere's fraction of the compliance.

    Small contacts follow Hertz's law ``a³ = 3 F R c / 4`` with the compliance ``c = (1 - nu²)/E + (1 - nu_s²)/E_s`` of
    sphere and skin. Large strains and the layers below the skin add a polynomial in ``depth = (F c / R²)^(1/3)`` and
    ``softness``, the sphere's fraction of ``c``, to the logarithm of the radius. The radius of the sphere matters in
    proportion to the probe's softness, its Poisson's ratio in proportion to its own.

    Parameters
    ----------
    coefficients
        Of the terms of `terms`, shape (n,).
    softness, deepest, error
        Fractions of the compliance, ascending; the greatest converged depth at each; and the relative error of the
        contact radius there: root mean square over presses left out of the fit. Shape (m,).
    skin_compliance
        ``(1 - nu_s²)/E_s`` of the skin, 1/kPa.
    key
        Hash of the table's inputs.
    """

    coefficients: NDArray[np.float64]
    softness: NDArray[np.float64]
    deepest: NDArray[np.float64]
    error: NDArray[np.float64]
    skin_compliance: float
    key: str

    def __post_init__(self) -> None:
        for name in ("coefficients", "softness", "deepest", "error"):
            object.__setattr__(self, name, require_array(name, getattr(self, name), ndim=1))

    def log_radius(
        self, young_kpa: Any, poisson: Any, radius_mm: Any, force_n: Any, *, probe_factor: Any = 1.0
    ) -> NDArray[np.float64]:
        """Natural logarithm of the contact radius in mm; all arguments broadcast.

        Parameters
        ----------
        young_kpa, poisson, radius_mm
            The sphere.
        force_n
            Force in newtons; beyond the deepest contact of the table the radius grows as Hertz's.
        probe_factor
            The moduli of the probe's layers over their nominal values.
        """
        softness, depth = self.coordinates(young_kpa, poisson, radius_mm, force_n, probe_factor=probe_factor)
        inside = np.minimum(depth, self.deepest_at(softness))
        added = terms(inside, softness, radius_mm, poisson) @ self.coefficients
        return np.asarray(np.log(radius_mm) + np.log(0.75) / 3 + np.log(depth) + added)

    def coordinates(
        self, young_kpa: Any, poisson: Any, radius_mm: Any, force_n: Any, *, probe_factor: Any = 1.0
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Softness and depth of presses."""
        sphere = (1 - np.square(poisson)) / np.asarray(young_kpa, dtype=float)
        compliance = sphere + self.skin_compliance / probe_factor
        depth = np.cbrt(MN_PER_N * np.asarray(force_n) * compliance / np.square(radius_mm))
        softness, depth = np.broadcast_arrays(sphere / compliance, depth)
        return softness, depth

    def deepest_at(self, softness: NDArray[np.float64]) -> NDArray[np.float64]:
        """Depth up to which the mechanics were solved."""
        return np.asarray(np.interp(softness, self.softness, self.deepest))

    def error_at(self, softness: NDArray[np.float64], depth: NDArray[np.float64]) -> NDArray[np.float64]:
        """Relative error of the contact radius; larger where the contact is shallow and few elements wide."""
        return np.asarray(np.interp(softness, self.softness, self.error) / firmness(depth))


def firmness(depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weight of a press in the fit: 1, or less where the contact is shallow and few elements wide."""
    return np.asarray(np.minimum(1.0, depth / FIRM_DEPTH) ** 2)


def skin_compliance(probe: Probe) -> float:
    """``(1 - nu²)/E`` of the first layer, 1/kPa."""
    skin = probe.layers[0]
    return (1 - skin.poisson**2) / skin.young_kpa


def terms(depth: Any, softness: Any, radius_mm: Any, poisson: Any) -> NDArray[np.float64]:
    """Terms of the polynomial as a last axis; the arguments broadcast."""
    depth, softness, radius, ratio = np.broadcast_arrays(
        depth,
        softness,
        (np.asarray(radius_mm) - MIDDLE_RADIUS_MM) / RADIUS_STEP_MM,
        (np.asarray(poisson) - MIDDLE_POISSON) / POISSON_STEP,
    )
    centred = 2 * softness - 1
    columns = [
        depth**i * centred**j
        for i in range(BASE_DEGREES[0] + 1)
        for j in range(BASE_DEGREES[1] + 1)
        if i + j <= BASE_TOTAL
    ]
    for fraction, change in ((1 - softness, radius), (softness, ratio)):
        columns += [
            fraction * change**order * depth**i * centred**j
            for order in range(1, CHANGE_ORDER + 1)
            for i in range(CHANGE_DEGREES[0] + 1)
            for j in range(CHANGE_DEGREES[1] + 1)
            if order + i + j <= CHANGE_TOTAL
        ]
    return np.stack(columns, axis=-1)


FORMAT_VERSION = 2
KIND = "contact-tables"
SKIN_KPA = 100.0  # of the solved probe: moduli scale with the force, so that this skin represents any
RESOLUTION = SphereResolution(order=3, cells=6, rings=2, face_cells=6)
LOADS = np.array([0.04, 0.07, 0.11, 0.19, 0.31, 0.5, 0.8, 1.2, 1.6, 2.0, 2.4, 2.6, 2.8, 3.2])  # depth cubed
SMALLEST_RADIUS_MM, WIDEST_FRACTION = 1.65, 0.55  # of the spheres; the widest as a fraction of the face's radius


@dataclass(frozen=True, slots=True, kw_only=True)
class SphereCase:
    """One sphere of the design: its fraction of the compliance, radius and Poisson's ratio."""

    softness: float
    radius_mm: float
    poisson: float = MIDDLE_POISSON


def design_of(probe: Probe) -> tuple[SphereCase, ...]:
    """The solved spheres of a probe: 6 of the middle radius and ratio, 6 of other radii, 6 of other ratios.

    The ratio of a stiff sphere and the radius of a soft one do not matter: those cases are omitted.
    """
    widest = WIDEST_FRACTION * probe.radius_mm
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
        for step in (-POISSON_STEP, 0.8 * POISSON_STEP)  # the elements converge up to 0.495
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
    """The contact table of a probe: from the package or the disk cache, else solved in some minutes.

    Probes with proportional moduli have one table. Raises `MechanicsError` when no force on a sphere converges.

    Parameters
    ----------
    probe
        The probe; its face may be domed.
    resolution
        Mesh density.
    progress
        Called with (spheres solved, all spheres).
    cached
        Whether to use the tables of the package and the disk cache.

    Examples
    --------
    >>> import tsis
    >>> table = build_contact_table(tsis.load_probe("tsis-2011"))
    >>> f"{float(np.exp(table.log_radius(103.0, 0.49, 3.0, 0.7))):.2f} mm"
    '2.77 mm'
    """
    require_type("probe", probe, Probe)
    require_type("resolution", resolution, SphereResolution)
    factor = SKIN_KPA / probe.layers[0].young_kpa
    layers = tuple(replace(layer, young_kpa=factor * layer.young_kpa) for layer in probe.layers)
    unit = replace(probe, layers=layers)
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

    arrays = cached_arrays(KIND, key, solved) if cached else solved()
    curves = {name: arrays[name] for name in ("coefficients", "softness", "deepest", "error")}
    return ContactTable(**curves, skin_compliance=skin_compliance(probe), key=key)


def _rounded(content: Any) -> Any:
    """Content with numbers rounded to ten digits, so that scaling does not change it."""
    if isinstance(content, dict):
        return {name: _rounded(value) for name, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [_rounded(value) for value in content]
    return float(f"{content:.10g}") if isinstance(content, float) else content


def _solve(
    probe: Probe, resolution: SphereResolution, progress: Callable[[int, int], None] | None
) -> dict[str, NDArray[np.float64]]:
    cases = design_of(probe)
    added: list[NDArray[np.float64]] = []
    for done, case in enumerate(cases):
        if progress is not None:
            progress(done, len(cases))
        added.append(added_log_radius(probe, case, resolution))
    depths = [np.cbrt(LOADS[: len(part)]) for part in added]
    pairs = zip(cases, depths, strict=True)
    rows = [terms(depth, case.softness, case.radius_mm, case.poisson) for case, depth in pairs]
    weights = [firmness(depth) for depth in depths]
    coefficients = _fit(rows, added, weights)
    middle = [index for index, case in enumerate(cases) if case.poisson == MIDDLE_POISSON][:6]
    return {
        "coefficients": coefficients,
        "softness": np.array([cases[index].softness for index in middle]),
        "deepest": np.array([depths[index][-1] for index in middle]),
        "error": np.array([_left_out_error(index, rows, added, weights) for index in middle]),
    }


def added_log_radius(probe: Probe, case: SphereCase, resolution: SphereResolution) -> NDArray[np.float64]:
    """Logarithm of the contact radius over Hertz's at `LOADS`, as far as the mechanics converge."""
    skin = skin_compliance(probe)
    soft = skin * case.softness / (1 - case.softness)
    sphere = SoftSphere(radius_mm=case.radius_mm, young_kpa=(1 - case.poisson**2) / soft, poisson=case.poisson)
    forces = LOADS * case.radius_mm**2 / (soft + skin) / MN_PER_N
    fields = press_fields(probe, sphere, forces_n=forces.tolist(), resolution=resolution, stop_at_limit=True)
    radii = np.array([hertzian_radius_mm(field) for field in fields])
    return np.asarray(np.log(radii / case.radius_mm) - np.log(0.75 * LOADS[: len(radii)]) / 3)


def _fit(
    rows: Sequence[NDArray[np.float64]], added: Sequence[NDArray[np.float64]], weights: Sequence[NDArray[np.float64]]
) -> NDArray[np.float64]:
    weight = np.concatenate(weights)
    solution = np.linalg.lstsq(weight[:, None] * np.concatenate(rows), weight * np.concatenate(added), rcond=1e-8)
    return np.asarray(solution[0])


def _left_out_error(
    left_out: int,
    rows: Sequence[NDArray[np.float64]],
    added: Sequence[NDArray[np.float64]],
    weights: Sequence[NDArray[np.float64]],
) -> float:
    """Weighted root mean square over one sphere's presses of a fit without them."""
    others = [index for index in range(len(rows)) if index != left_out]
    coefficients = _fit(*([part[other] for other in others] for part in (rows, added, weights)))
    error = weights[left_out] * (added[left_out] - rows[left_out] @ coefficients)
    return float(np.sqrt((error**2).sum() / (weights[left_out] ** 2).sum()))
