"""A planned probe and its presses."""

from __future__ import annotations

from dataclasses import dataclass

from tsis.catalog.probes import load_probe
from tsis.errors import InputError
from tsis.inclusion.tissue import protocol_forces
from tsis.model.probe import Probe
from tsis.model.require import require_integer, require_number, require_type

LEAST_FORCE_N, LARGEST_FORCE_N = 1e-3, 50.0
MOST_FRAMES_PER_PRESS = 1000
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


def default_protocols() -> tuple[Protocol, ...]:
    """The flat probe alone, the flat one with a reference, and the domed one at two forces, which is the default."""
    flat, domed = load_probe("tsis-2011"), load_probe("tsis-domed")
    on_flat = protocol_forces(flat, tissue_young_kpa=USUAL_KPA)
    return (
        protocol_of(flat, on_flat, with_reference=False, name="flat, no reference"),
        protocol_of(flat, on_flat, name="flat, with a reference"),
        protocol_of(domed, protocol_forces(domed, tissue_young_kpa=USUAL_KPA), name="domed, two forces"),
    )
