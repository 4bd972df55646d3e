"""What a press is compared with: the untouched probe, a level press, a patch that only the lamps light."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tsis.calibration.lamps.patch import LEAST_LIT, ReferencePatch
from tsis.imaging.correct import require_image, require_same_frame
from tsis.model.check import require_number, require_type
from tsis.model.errors import ImageMismatchError, InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tsis.calibration.guard.blocks import FrameShape
    from tsis.model import TactileImage


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GuardReference:
    """What a press is compared with. Each part is optional, and lets the guard tell more.

    Parameters
    ----------
    untouched
        A frame of the probe that touches nothing: tells light from outside, and what a press adds.
    level
        A press held square on plain tissue: the tilt is told against it, as lamps of unequal power light a level press
        unevenly too. Taken as even when None.
    patch
        A part of the frame that the lamps light and no press reaches: tells the lamps' drift; needs ``untouched``.
    face_radius_mm
        Radius of the probe's face, mm, in [0.1, 1000]: beyond it nothing is touched. Without it, or where the scale is
        unknown, the darkest part of the frame is taken as untouched when it is a tenth of the frame or more.
    dark_grey
        What the camera reads without light, grey levels; None when nobody measured it.
    invert
        True for probes whose light falls where they are pressed; needs ``untouched``.

    Raises
    ------
    InputError
        When a part lacks what it needs or is of the wrong kind.
    ImageMismatchError
        When the frames differ in size, scale or full scale.
    """

    untouched: TactileImage | None = None
    level: TactileImage | None = None
    patch: ReferencePatch | None = None
    face_radius_mm: float | None = None
    dark_grey: float | None = None
    invert: bool = False

    def __post_init__(self) -> None:
        if self.untouched is not None:
            require_image("untouched", self.untouched)
        if self.level is not None:
            require_same_frame(self.level, self.untouched or self.level, "untouched")
        for name, wanted in (("patch", self.patch is not None), ("invert", self.invert)):
            if wanted and self.untouched is None:
                raise InputError(f"{name} needs a frame of the untouched probe to compare with; give untouched")
        if self.patch is not None:
            require_type("patch", self.patch, ReferencePatch)
            assert self.untouched is not None
            self.patch.of(self.untouched)  # inside the frame
        if self.face_radius_mm is not None:
            require_number("face_radius_mm", self.face_radius_mm, 0.1, 1000.0, hint="millimetres")
        if self.dark_grey is not None:
            require_number("dark_grey", self.dark_grey, 0.0, 65535.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prepared:
    """A reference in the blocks of one shape of frame, so that each frame costs little.

    Attributes
    ----------
    shape
        Of the frames.
    untouched
        Blocks of the untouched probe; None when there is none.
    sign
        1, or -1 for probes whose light falls where they are pressed.
    places
        Coordinates (x, y) of the blocks' columns and rows.
    beyond_rim
        Blocks of each quadrant beyond the face's rim; empty where it is not known or not seen.
    patch, patch_before
        The reference patch and its level when untouched.
    dark_grey
        Level without light; None when unknown.
    level_tilt
        Gradient of a level press.
    """

    shape: FrameShape
    untouched: NDArray[np.float64] | None
    sign: float
    places: tuple[NDArray[np.float64], NDArray[np.float64]]
    beyond_rim: tuple[NDArray[np.bool], ...]
    patch: ReferencePatch | None
    patch_before: float | None
    dark_grey: float | None
    level_tilt: tuple[float, float] = (0.0, 0.0)

    @property
    def least_lit(self) -> float:
        """Grey levels above dark from which a place counts as lit by the lamps."""
        return LEAST_LIT * self.shape.full_scale

    def patch_level(self, pixels: NDArray[Any]) -> float | None:
        """Mean of the reference patch; None without one."""
        if self.patch is None:
            return None
        return float(self.patch.cut(pixels).mean())

    def check_fits(self, pixels: NDArray[Any], full_scale: float) -> None:
        """Refuse a frame of another shape or depth."""
        wanted = (self.shape.rows, self.shape.columns)
        if pixels.shape != wanted or full_scale != self.shape.full_scale:
            raise ImageMismatchError(
                f"frames must keep the size {wanted} and full scale {self.shape.full_scale:g} of the watch; got "
                f"{pixels.shape} and {full_scale:g}: begin a new watch for another mode"
            )
