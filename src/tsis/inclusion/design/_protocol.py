"""A planned probe and its presses."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from tsis.catalog import load_probe
from tsis.errors import InputError
from tsis.mechanics.small_strain import PressKernel
from tsis.mechanics.surrogate import correction_box, wide_box
from tsis.model import MN_PER_N, Probe, require_integer, require_number, require_type

LEAST_FORCE_N, LARGEST_FORCE_N = 1e-3, 50.0
MOST_FRAMES_PER_PRESS = 1000
DOMED_LOADS = (1.28, 2.55)  # over the covering force; 0.5 and 1 N on 5 kPa
FLAT_LOAD = 1.39  # over the tissue's modulus times radius squared; 1 N on 5 kPa
SPREAD = 1.3  # of the tissue's modulus about its mean, which a table of finite strain holds
MARGIN = 0.97  # of the largest load that the estimate's tables hold
POISSON = 0.49
USUAL_KPA = 5.0  # tissue of the catalog's phantoms


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedPress:
    """One press.

    Parameters
    ----------
    force_n
        Force in newtons, in [0.001, 50].
    with_reference
        Whether there is a reference press with the same force.

    Raises
    ------
    InputError
        When the force lies outside its range.
    """

    force_n: float
    with_reference: bool = True

    def __post_init__(self) -> None:
        require_number("force_n", self.force_n, LEAST_FORCE_N, LARGEST_FORCE_N, hint="newtons")
        require_type("with_reference", self.with_reference, bool)


@dataclass(frozen=True, slots=True, kw_only=True)
class Protocol:
    """A probe and its presses.

    Parameters
    ----------
    probe
        The probe.
    presses
        At least one press on the target.
    frames_each
        Repeats of each press, on target and reference, in [1, 1000].
    name
        Name in tables.

    Raises
    ------
    InputError
        When there is no press, or a value is out of range.

    Examples
    --------
    >>> default_protocols()[-1].described
    'tsis-domed, 0.5 and 1 N, each with a reference'
    """

    probe: Probe
    presses: tuple[PlannedPress, ...]
    frames_each: int = 1
    name: str = ""

    def __post_init__(self) -> None:
        require_type("probe", self.probe, Probe)
        require_type("name", self.name, str)
        presses = tuple(self.presses) if isinstance(self.presses, (tuple, list)) else ()
        if not presses or not all(isinstance(press, PlannedPress) for press in presses):
            raise InputError(f"presses must be a tuple of at least one PlannedPress; got {self.presses!r:.80}")
        object.__setattr__(self, "presses", presses)
        object.__setattr__(
            self, "frames_each", require_integer("frames_each", self.frames_each, 1, MOST_FRAMES_PER_PRESS)
        )

    @property
    def forces_n(self) -> tuple[float, ...]:
        """Forces of the presses on the target."""
        return tuple(press.force_n for press in self.presses)

    @property
    def has_reference(self) -> bool:
        """Whether any press has a reference press."""
        return any(press.with_reference for press in self.presses)

    @property
    def described(self) -> str:
        """Text of the protocol."""
        forces = " and ".join(f"{force:g}" for force in self.forces_n)
        count = sum(press.with_reference for press in self.presses)
        reference = {0: "no reference", len(self.presses): "each with a reference"}.get(
            count, f"{count} with a reference"
        )
        if len(self.presses) == 1 and count:
            reference = "with a reference"
        often = "" if self.frames_each == 1 else f", {self.frames_each} times each"
        return f"{self.probe.name or 'probe'}, {forces} N, {reference}{often}"


def protocol_of(probe: Probe, forces_n: tuple[float, ...], *, with_reference: bool = True, name: str = "") -> Protocol:
    """Protocol with one press at each of the forces, all with a reference or none."""
    presses = tuple(PlannedPress(force_n=force, with_reference=with_reference) for force in forces_n)
    return Protocol(probe=probe, presses=presses, name=name)


def protocol_forces(probe: Probe, *, tissue_young_kpa: float, thickness_mm: float = 30.0) -> tuple[float, ...]:
    """Forces in newtons that use a probe well on its tissue: two under a dome, one under a flat face.

    A dome loads the tissue differently at two forces: at the lower one it just touches with its whole face, at the
    higher one it presses twice as hard. Forces grow with the modulus of the tissue; they have two digits.

    Parameters
    ----------
    probe
        The probe.
    tissue_young_kpa
        Modulus of the tissue, in [0.75, 65]; `tsis.inclusion.tissue_modulus` measures it.
    thickness_mm
        Thickness of the tissue, in [12, 72].

    Raises
    ------
    InputError
        When a value lies outside its range.

    Examples
    --------
    >>> protocol_forces(load_probe("tsis-domed"), tissue_young_kpa=5.0)
    (0.5, 1.0)
    >>> protocol_forces(load_probe("tsis-domed"), tissue_young_kpa=10.0)
    (0.96, 1.9)
    """
    require_type("probe", probe, Probe)
    box, usual = wide_box(probe), correction_box(probe)
    young = require_number("tissue_young_kpa", tissue_young_kpa, *box.tissue_young_kpa, hint="kilopascals")
    thickness = require_number("thickness_mm", thickness_mm, *box.thickness_mm, hint="millimetres")
    soft, stiff = usual.tissue_young_kpa
    if SPREAD * soft <= young <= stiff / SPREAD and usual.thickness_mm[0] <= thickness <= usual.thickness_mm[1]:
        box = usual
    most = MARGIN * float(box.largest_load(np.array(young)))
    is_flat = probe.face_curvature_mm is None
    unit_n = young * probe.radius_mm**2 / MN_PER_N if is_flat else _kernel(probe, thickness).covering(young).force_n
    loads = (FLAT_LOAD,) if is_flat else DOMED_LOADS
    return tuple(float(f"{min(load, most) * unit_n:.2g}") for load in loads)


@lru_cache(maxsize=8)
def _kernel(probe: Probe, thickness_mm: float) -> PressKernel:
    return PressKernel(probe, thickness_mm=thickness_mm, poisson=POISSON)


def default_protocols() -> tuple[Protocol, ...]:
    """The flat probe alone, the flat one with a reference, and the domed one at two forces, which is the default."""
    flat, domed = load_probe("tsis-2011"), load_probe("tsis-domed")
    on_flat = protocol_forces(flat, tissue_young_kpa=USUAL_KPA)
    return (
        protocol_of(flat, on_flat, with_reference=False, name="flat, no reference"),
        protocol_of(flat, on_flat, name="flat, with a reference"),
        protocol_of(domed, protocol_forces(domed, tissue_young_kpa=USUAL_KPA), name="domed, two forces"),
    )
