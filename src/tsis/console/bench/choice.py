"""Which camera a bench looks through, as a person chose it."""

from __future__ import annotations

import re
from dataclasses import dataclass

from tsis.imaging.sensor import Sensor
from tsis.instrument.discovery import LIVE_SOURCES, STORED_SOURCES
from tsis.model import list_phantoms, list_probes, list_spheres
from tsis.model.check import LARGEST_SEED, require_integer, require_one_of, require_type
from tsis.model.errors import InputError
from tsis.model.variants import phantom_variant
from tsis.records.values import ROLES
from tsis.virtual.camera import virtual_mode

VIRTUAL, OPENCV = "virtual", "opencv"
OPENCV_SPEC = re.compile("opencv(:[0-9]{0,4})?")  # without a number it is the first
TARGET, PLAIN, BALL, UNTOUCHED = "target", "plain", "ball", "untouched"  # roles of presses
TISSUE_N, SPHERE_N = 1.0, 0.7  # forces with which the virtual probe begins
LONGEST_SPEC = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraChoice:
    """A camera and its mode; of the virtual probe also what it presses.

    Parameters
    ----------
    spec
        ``"virtual"``, or ``SOURCE:ID`` of a live camera as `tsis.instrument.discovery.find_cameras` names it.
    mode
        Label of the mode to start in; the camera's first when None.
    probe
        Name in the catalog: of the virtual probe, and of the probe before the camera where no calibration tells.
    phantom
        What the virtual probe presses: a phantom of the catalog, or a sphere of it for hardness.
    diameter_mm, depth_mm, young_kpa
        Of the phantom's inclusion instead of the catalog's.
    seed
        Of the virtual probe's errors.

    Raises
    ------
    InputError
        When a name is unknown or a value outside its range.
    """

    spec: str = VIRTUAL
    mode: str | None = None
    probe: str = "tsis-domed"
    phantom: str = "hardness-100"
    diameter_mm: float | None = None
    depth_mm: float | None = None
    young_kpa: float | None = None
    seed: int = 4

    def __post_init__(self) -> None:
        require_type("spec", self.spec, str)
        self._require_live()
        if self.mode is not None:
            require_type("mode", self.mode, str)
            if self.is_virtual:  # whose modes are known before it runs
                require_one_of("mode", self.mode, [virtual_mode(Sensor()).label])
        require_one_of("probe", self.probe, list_probes())
        require_one_of("phantom", self.phantom, (*list_phantoms(), *list_spheres()))
        changed = (self.diameter_mm, self.depth_mm, self.young_kpa)
        if not self.is_sphere:
            phantom_variant(self.phantom, *changed)
        elif any(value is not None for value in changed):
            raise InputError(f"diameter_mm, depth_mm and young_kpa are of phantoms; {self.phantom} is a sphere")
        require_integer("seed", self.seed, 0, LARGEST_SEED)

    def _require_live(self) -> None:
        source = self.spec.partition(":")[0]
        if source in STORED_SOURCES:
            raise InputError(
                f"camera must be a live one; got {self.spec!r:.80}, which is stored (estimate from stored frames with "
                "tsis examine, or enter them with tsis records import)"
            )
        require_one_of("camera source", source, (VIRTUAL, *LIVE_SOURCES))
        if source == VIRTUAL and self.spec != VIRTUAL:
            raise InputError(f"the virtual probe is called virtual and nothing more; got {self.spec!r:.80}")
        if source == OPENCV and not OPENCV_SPEC.fullmatch(self.spec):
            raise InputError(f"opencv cameras go by their number, as in opencv:0; got {self.spec!r:.80}")
        if len(self.spec) > LONGEST_SPEC or not self.spec.isprintable():
            raise InputError(
                f"camera must be at most {LONGEST_SPEC} characters that can be shown; got {self.spec!r:.80}"
            )

    @property
    def is_virtual(self) -> bool:
        """Whether there is no hardware."""
        return self.spec == VIRTUAL

    @property
    def is_sphere(self) -> bool:
        """Whether the bare virtual probe touches an object, for its hardness."""
        return self.phantom in list_spheres()

    @property
    def roles(self) -> tuple[str, ...]:
        """What may be pressed with it; a press begins on the first."""
        if not self.is_virtual:
            return ROLES
        return (TARGET, BALL if self.is_sphere else PLAIN, UNTOUCHED)

    @property
    def touch_n(self) -> float | None:
        """Force with which the virtual probe begins, N; None for other cameras, of which nobody knows."""
        if not self.is_virtual:
            return None
        return SPHERE_N if self.is_sphere else TISSUE_N
