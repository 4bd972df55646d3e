"""A scan: presses at many places on one body.

The scan's frame has x and y along the skin and the depth downwards. A press measures one of three things: a camera
frame of the probe, means of the pressure over rings or over rings and sectors of its face, or pairs of travel and force
of an indenter without any image.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from tsis.errors import InputError
from tsis.model.content import ContentValue
from tsis.model.image import TactileImage
from tsis.model.require import require_array, require_number, require_one_of, require_pair, require_type

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


FARTHEST_MM = 2000.0  # of a place from the scan's origin
LEAST_FORCE_N, LARGEST_FORCE_N = 1e-3, 100.0  # a press below the first has no contact
MEASURES = ("frame", "pressure_kpa", "travel_force")
TOLD = 3  # presses that an error or a flag names


def first_few(sentences: Sequence[str]) -> str:
    """The first sentences, and how many more there are.

    >>> first_few(["A has no place.", "B has no place.", "C has no place.", "D has no place."])
    'A has no place. B has no place. C has no place. And 1 more.'
    """
    more = len(sentences) - TOLD
    return " ".join([*sentences[:TOLD], *([f"And {more} more."] if more > 0 else [])])


@dataclass(frozen=True, slots=True, kw_only=True)
class Indenter:
    """A rigid indenter of a robot's force sensor.

    Parameters
    ----------
    shape
        ``"ball"`` or ``"punch"``, a flat cylinder.
    radius_mm
        Radius of the ball or of the punch's face in mm, in [0.5, 50].

    Raises
    ------
    InputError
        When a value lies outside its range.
    """

    shape: Literal["ball", "punch"]
    radius_mm: float

    def __post_init__(self) -> None:
        require_one_of("shape", self.shape, ("ball", "punch"))
        require_number("radius_mm", self.radius_mm, 0.5, 50.0, hint="millimetres")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ScanPress(ContentValue):
    """One press of a scan. Exactly one of ``frame``, ``pressure_kpa`` and ``travel_force`` is given.

    Parameters
    ----------
    place_mm
        Place (x, y) of the probe's axis on the skin in the scan's frame, mm.
    place_sd_mm
        Standard uncertainty of either coordinate of the place, in [0, 10] mm.
    angle_deg
        Angle of the probe's x axis from the scan's x axis, positive towards y, in degrees.
    force_n
        Force in newtons, in [0, 100]; None where unknown. A frame's own force counts where this is None.
    force_sd
        Relative standard uncertainty of the force, in [0, 1]; None takes the calibration's.
    frame
        A raw frame of the probe.
    pressure_kpa
        Mean contact pressure of each ring, shape (rings,), or of each sector of each ring, shape (rings, sectors). The
        rings have equal width out to 0.8 of the face's radius; the first sector begins at the probe's x axis.
    noise_kpa
        Standard deviation of the noise of each of these means, in [0, 1000] kPa.
    travel_force
        Pairs of travel in mm and force in N of an indenter, shape (n, 2), travel ascending into the tissue. It may
        begin above the tissue, at any travel: contact is found.
    reference
        Whether the tissue is known to be without lump here.
    name
        Name in reports, e.g. that of the file.

    Raises
    ------
    InputError
        When a value lies outside its range, or none or several of the three measurements are given.

    Examples
    --------
    >>> press = ScanPress(place_mm=(10.0, 0.0), pressure_kpa=np.full(12, 2.2), force_n=1.0)
    >>> press.place_mm
    (10.0, 0.0)
    """

    place_mm: tuple[float, float]
    place_sd_mm: float = 0.0
    angle_deg: float = 0.0
    force_n: float | None = None
    force_sd: float | None = None
    frame: TactileImage | None = None
    pressure_kpa: NDArray[np.float64] | None = None
    noise_kpa: float = 0.005
    travel_force: NDArray[np.float64] | None = None
    reference: bool = False
    name: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "place_mm", require_pair("place_mm", self.place_mm))
        for coordinate in self.place_mm:
            require_number("place_mm", coordinate, -FARTHEST_MM, FARTHEST_MM, hint="millimetres")
        require_number("place_sd_mm", self.place_sd_mm, 0.0, 10.0, hint="millimetres")
        require_number("angle_deg", self.angle_deg, -360.0, 360.0, hint="degrees")
        require_number("noise_kpa", self.noise_kpa, 0.0, 1000.0, hint="kilopascals")
        require_type("reference", self.reference, bool)
        require_type("name", self.name, str)
        if self.force_n is not None:
            require_number("force_n", self.force_n, 0.0, LARGEST_FORCE_N, hint="newtons")
        if self.force_sd is not None:
            require_number("force_sd", self.force_sd, 0.0, 1.0, hint="a fraction")
        given = [name for name in MEASURES if getattr(self, name) is not None]
        if len(given) != 1:
            raise InputError(
                "frame, pressure_kpa or travel_force must be given, exactly one of them; got "
                f"{', '.join(given) or 'none'} for the press {self.name or self.place_mm!r}"
            )
        if self.frame is not None:
            require_type("frame", self.frame, TactileImage)
        if self.pressure_kpa is not None:
            self._check_pressure()
        if self.travel_force is not None:
            self._check_curve()

    def _check_pressure(self) -> None:
        axes = 1 if np.asarray(self.pressure_kpa).ndim == 1 else 2
        values = require_array("pressure_kpa", self.pressure_kpa, ndim=axes)
        rings, sectors = len(values), 1 if axes == 1 else values.shape[1]
        if rings < 3 or (axes == 2 and sectors < 4):
            raise InputError(
                f"pressure_kpa must have at least 3 rings and, if any, 4 sectors; got shape {values.shape}"
            )
        require_number("pressure_kpa", float(np.abs(values).max()), 0.0, 1e5, hint="kilopascals")
        object.__setattr__(self, "pressure_kpa", values)

    def _check_curve(self) -> None:
        pairs = require_array("travel_force", self.travel_force, ndim=2)
        if pairs.shape[1] != 2:
            raise InputError(f"travel_force must have two columns, travel and force; got shape {pairs.shape}")
        if (np.diff(pairs[:, 0]) <= 0).any():
            raise InputError("travel_force must ascend in travel; sort its rows by travel")
        require_number("travel_force", float(np.abs(pairs[:, 0]).max()), 0.0, 2000.0, hint="millimetres")
        require_number("travel_force", float(np.abs(pairs[:, 1]).max()), 0.0, LARGEST_FORCE_N, hint="newtons")
        object.__setattr__(self, "travel_force", pairs)

    @property
    def measured_force_n(self) -> float | None:
        """Force of the press in newtons, or of its frame; None where unknown."""
        return self.frame.force_n if self.force_n is None and self.frame is not None else self.force_n


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scan(ContentValue):
    """Presses on one body, in any order.

    Parameters
    ----------
    presses
        At least two presses, all with frames, all with pressures, or all with pairs of travel and force.
    indenter
        What pressed, for pairs of travel and force; None for frames and pressures of a probe.
    name
        Name in reports.
    left_out
        A sentence for each press that could not become one of the presses, such as one without a place.

    Raises
    ------
    InputError
        When there are too few presses, kinds are mixed, or an indenter is missing.
    """

    presses: tuple[ScanPress, ...]
    indenter: Indenter | None = None
    name: str = ""
    left_out: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("presses", "left_out"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        require_type("name", self.name, str)
        for press in self.presses:
            require_type("presses", press, ScanPress)
        if len(self.presses) < 2:
            raise InputError(
                f"presses must hold at least two presses at different places; got {len(self.presses)}"
                + (f": {first_few(self.left_out)}" if self.left_out else "")
            )
        if len({press.place_mm for press in self.presses}) < 2:
            raise InputError("presses must lie at different places; got all at one")
        kinds = {self._kind(press) for press in self.presses}
        if len(kinds) > 1:
            raise InputError(f"presses must all measure the same; got {' and '.join(sorted(kinds))}")
        if ("travel_force" in kinds) != (self.indenter is not None):
            raise InputError(
                "indenter must be given with pairs of travel and force, and only with them: --ball-mm or --punch-mm, "
                'in Python Indenter(shape="ball", radius_mm=...)'
            )

    @staticmethod
    def _kind(press: ScanPress) -> str:
        return next(name for name in MEASURES if getattr(press, name) is not None)

    @property
    def kind(self) -> str:
        """What the presses measured: ``"frame"``, ``"pressure_kpa"`` or ``"travel_force"``."""
        return self._kind(self.presses[0])

    @property
    def places_mm(self) -> NDArray[np.float64]:
        """Places (x, y) of the presses, shape (n, 2), mm."""
        return np.array([press.place_mm for press in self.presses])
