"""A gel sensor: gel, camera and lamps, and the source of each value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from tsis.errors import ImageMismatchError, InputError
from tsis.model.content import ContentValue
from tsis.model.exchange import summary_html
from tsis.model.image import require_pixel_scale
from tsis.model.probe import Layer, Probe
from tsis.model.require import freeze_mappings, require_integer, require_number, require_one_of, require_type

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class BoundedValue:
    """A value that is known within limits; every value between them is possible.

    Parameters
    ----------
    value
        The best value; the middle of the limits when None.
    low, high
        The limits; both the value itself where they are None, for a value that is exact.

    Raises
    ------
    InputError
        When a number is not finite, a limit is missing, or the value does not lie between the limits.

    Examples
    --------
    >>> BoundedValue(low=100.0, high=200.0).value
    150.0
    >>> BoundedValue(value=5.5).exact
    True
    """

    value: float | None = None
    low: float | None = None
    high: float | None = None

    def __post_init__(self) -> None:
        if (self.low is None) != (self.high is None) or (self.value is None and self.low is None):
            raise InputError(f"a value must have low and high, or be one number; got {self!r}")
        low = self.value if self.low is None else self.low
        high = self.value if self.high is None else self.high
        assert low is not None
        assert high is not None
        numbers = [require_number(name, part, -1e9, 1e9) for name, part in (("low", low), ("high", high))]
        middle = sum(numbers) / 2 if self.value is None else require_number("value", self.value, -1e9, 1e9)
        if not numbers[0] <= middle <= numbers[1]:
            requirement = f"must lie between low = {low:g} and high = {high:g}"
            raise InputError(name="value", requirement=requirement, value=f"{middle:g}", bounds=(low, high))
        for name, number in zip(("low", "high", "value"), (*numbers, middle), strict=True):
            object.__setattr__(self, name, number)

    @property
    def best(self) -> float:
        """The best value, as a number."""
        assert self.value is not None
        return self.value

    @property
    def limits(self) -> tuple[float, float]:
        """The limits (low, high), as numbers."""
        assert self.low is not None
        assert self.high is not None
        return self.low, self.high

    @property
    def exact(self) -> bool:
        """Whether the limits leave no room."""
        return self.low == self.high

    def __str__(self) -> str:
        return f"{self.value:g}" if self.exact else f"{self.value:g} ({self.low:g} to {self.high:g})"


LABEL_SOURCES = ("label", "data sheet", "datasheet", "shore", "maker", "vendor", "given by the user")
LABEL_SPREAD = 1.25  # factor between a modulus on a label, as of a Shore hardness, and that of the gel
GEL_SHAPES = ("flat", "domed", "curved")
GEL_OUTLINES = ("rectangle", "round")
GEL_LIGHTS = ("rgb", "white")
PRESS_SIGNS = ("brighter", "darker", "either")
ASPECT_TOLERANCE = 0.02  # of the frame's sides
CAMERA_2011_PX = (768, 492)  # the dissertation's camera
CAMERA_2011_MM_PER_PIXEL = (0.0336, 0.0392)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GelSensor(ContentValue):
    """A camera that looks through a soft gel at its face (GelSight, DIGIT, 9DTact, the probe of 2011).

    Parameters
    ----------
    name
        Name in reports.
    width_mm, height_mm
        Sides of the face along the columns and the rows of the frame, mm, each in [1, 500].
    thickness_mm, young_kpa, poisson
        The gel as one layer: thickness in mm, Young's modulus in kPa, Poisson's ratio.
    shape
        ``"flat"``; ``"domed"``, curved in both directions; or ``"curved"``, in one direction or in an unknown form.
    outline
        ``"rectangle"`` or ``"round"``; a round face has equal sides.
    face_radius_mm
        Radius of curvature of the face in mm; None for a flat face.
    backing
        What the gel is bonded to; only ``"rigid"``.
    layers
        The layers from the object up where the gel has several; `young_kpa` is then that of one layer as stiff.
    image_px
        Columns and rows of the frame to which `mm_per_pixel` belongs. A frame of the same aspect ratio and other size
        has its scale by `scale_of`.
    mm_per_pixel
        Size (x, y) of a pixel on the face, mm; None where it is yet to be calibrated.
    raw_px, corners_px
        Columns and rows of the camera's frame, and in it the places (x, y) of the face's corners: upper left, upper
        right, lower right, lower left of the upright face, so that their order turns and mirrors. Frames of this size
        are warped to `image_px`. None where frames show the face upright already.
    bits
        Bits of a level in files of 16 bits, from 9 to 16; None where the levels tell.
    resampled
        Whether a frame of another size is the same picture with other pixels; where not, it is refused.
    scale_uncertainty
        Relative standard deviation of `mm_per_pixel`, in [0, 0.5].
    distortion
        Radial distortion ``(k1, k2)``: an object at r appears at ``r (1 + k1 r² + k2 r⁴)``, r from the middle of the
        frame in half diagonals.
    light
        ``"rgb"``, coloured lamps from the sides code the slope of the face; ``"white"``, grey codes its depth.
    lamp_azimuth_deg
        Directions from which the lamps shine, degrees from x (columns) towards y (rows); empty where unknown.
    pressed
        Whether a deeper press is ``"brighter"``, ``"darker"``, or ``"either"``, as under coloured lamps.
    marker_pitch_mm
        Distance of the printed markers; None for a face without markers.
    reference_file
        A frame of the untouched sensor, relative to the sensor's file; None where each recording has its own.
    limits
        Sentences on what is not valid with this sensor.
    sources
        Where each value comes from, by the name of the value.

    Raises
    ------
    InputError
        When a value lies outside its range, or values contradict each other.

    Examples
    --------
    >>> gel = GelSensor(name="mine", width_mm=20.0, height_mm=15.0, thickness_mm=BoundedValue(value=4.0),
    ...     young_kpa=BoundedValue(low=100.0, high=200.0), poisson=BoundedValue(low=0.48, high=0.4999),
    ...     image_px=(320, 240), mm_per_pixel=(0.06, 0.06))
    >>> tuple(round(side, 6) for side in gel.scale_of(640, 480))
    (0.03, 0.03)
    """

    name: str
    width_mm: float
    height_mm: float
    thickness_mm: BoundedValue
    young_kpa: BoundedValue
    poisson: BoundedValue
    shape: Literal["flat", "domed", "curved"] = "flat"
    outline: Literal["rectangle", "round"] = "rectangle"
    face_radius_mm: float | None = None
    backing: Literal["rigid"] = "rigid"
    layers: tuple[Layer, ...] = ()
    image_px: tuple[int, int] = (640, 480)
    mm_per_pixel: tuple[float, float] | None = None
    raw_px: tuple[int, int] | None = None
    corners_px: tuple[tuple[float, float], ...] | None = None
    bits: int | None = None
    resampled: bool = True
    scale_uncertainty: float = 0.02
    distortion: tuple[float, float] = (0.0, 0.0)
    light: Literal["rgb", "white"] = "rgb"
    lamp_azimuth_deg: tuple[float, ...] = ()
    pressed: Literal["brighter", "darker", "either"] = "either"
    marker_pitch_mm: float | None = None
    reference_file: str | None = None
    limits: tuple[str, ...] = ()
    sources: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.strip():
            raise InputError(f"name of a sensor must be text; got {self.name!r:.80}")
        require_type("resampled", self.resampled, bool)
        for name in ("width_mm", "height_mm"):
            require_number(name, getattr(self, name), 1.0, 500.0, hint="millimetres")
        for name, low, high in (("thickness_mm", 0.05, 100.0), ("young_kpa", 0.1, 1e6), ("poisson", 0.0, 0.49999)):
            bounded = getattr(self, name)
            require_type(name, bounded, BoundedValue)
            for part in bounded.limits:
                require_number(name, part, low, high)
        self._check_choices()
        self._check_shape()
        self._check_camera()
        for name, kind in (("limits", str), ("layers", Layer), ("lamp_azimuth_deg", (int, float))):
            items = tuple(getattr(self, name))
            if not all(isinstance(item, kind) for item in items):
                raise InputError(f"{name} must be a list; got {items!r:.80}")
            object.__setattr__(self, name, items)
        if not isinstance(self.sources, Mapping):
            raise InputError(f"sources must be a table of names and texts; got {self.sources!r:.80}")
        for name, text in self.sources.items():
            require_one_of("value of a sensor with a source", name, self.__slots__)
            require_type(f"source of {name}", text, str)
        freeze_mappings(self, "sources")

    def _check_choices(self) -> None:
        for name, choices in (
            ("shape", GEL_SHAPES),
            ("outline", GEL_OUTLINES),
            ("light", GEL_LIGHTS),
            ("pressed", PRESS_SIGNS),
            ("backing", ("rigid",)),
        ):
            require_one_of(f"{name} of a sensor", getattr(self, name), choices)

    def _check_shape(self) -> None:
        if self.outline == "round" and self.width_mm != self.height_mm:
            raise InputError(f"height_mm of a round face must be width_mm = {self.width_mm:g}; got {self.height_mm:g}")
        if self.face_radius_mm is None:
            if self.shape == "domed":
                raise InputError("face_radius_mm must be given for a domed face; got none")
        elif self.shape == "flat":
            raise InputError(f"face_radius_mm must be left out for a flat face; got {self.face_radius_mm:g}")
        else:
            require_number("face_radius_mm", self.face_radius_mm, 1.0, 1e6, hint="millimetres")

    def _check_camera(self) -> None:
        for name, size in (("image_px", tuple(self.image_px)), ("distortion", tuple(self.distortion))):
            if len(size) != 2:
                raise InputError(f"{name} must hold two numbers; got {size!r:.80}")
        columns, rows = (require_integer("image_px", part, 16, 16384) for part in self.image_px)
        object.__setattr__(self, "image_px", (columns, rows))
        self._check_warp()
        if self.bits is not None:
            require_integer("bits", self.bits, 9, 16)
        k1, k2 = (require_number("distortion", part, -1.0, 1.0) for part in self.distortion)
        object.__setattr__(self, "distortion", (k1, k2))
        require_number("scale_uncertainty", self.scale_uncertainty, 0.0, 0.5)
        if self.mm_per_pixel is not None:
            object.__setattr__(self, "mm_per_pixel", require_pixel_scale(self.mm_per_pixel))
        if self.marker_pitch_mm is not None:
            require_number("marker_pitch_mm", self.marker_pitch_mm, 0.05, 50.0, hint="millimetres")
        if self.reference_file is not None:
            require_type("reference_file", self.reference_file, str)

    def _check_warp(self) -> None:
        if (self.raw_px is None) != (self.corners_px is None):
            raise InputError("raw_px and corners_px must be given together; got one of them")
        if self.raw_px is None or self.corners_px is None:
            return
        if len(self.raw_px) != 2 or len(self.corners_px) != 4 or any(len(corner) != 2 for corner in self.corners_px):
            raise InputError(
                f"corners_px must hold four places (x, y), raw_px two numbers; got {self.corners_px!r:.80}"
            )
        sizes = tuple(require_integer("raw_px", part, 16, 16384) for part in self.raw_px)
        if sizes == self.image_px:
            raise InputError(f"image_px must differ from raw_px, so that a warped frame is known; got {sizes} for both")
        corners = tuple(
            tuple(
                require_number("corners_px", part, -0.2 * size, 1.2 * size)
                for part, size in zip(corner, sizes, strict=True)
            )
            for corner in self.corners_px
        )
        turns = [
            (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
            for a, b, c in ((corners[n], corners[(n + 1) % 4], corners[(n + 2) % 4]) for n in range(4))
        ]
        if not (min(turns) > 1.0 or max(turns) < -1.0):
            raise InputError(f"corners_px must go around the face without crossing; got {corners}")
        object.__setattr__(self, "raw_px", sizes)
        object.__setattr__(self, "corners_px", corners)

    @property
    def believed_young_kpa(self) -> BoundedValue:
        """The modulus; where it has no limits and its source is a label, not a measurement, within a factor of 1.25."""
        source = self.sources.get("young_kpa", "").lower()
        if not self.young_kpa.exact or "measured" in source or not any(word in source for word in LABEL_SOURCES):
            return self.young_kpa
        best = self.young_kpa.best
        return BoundedValue(value=best, low=best / LABEL_SPREAD, high=best * LABEL_SPREAD)

    def require_frame(self, columns: int, rows: int) -> None:
        """Refuse a frame of a size that the sensor does not have; `ImageMismatchError`."""
        wide, high = self.image_px
        if not self.resampled and (columns, rows) != self.image_px:
            raise ImageMismatchError(
                f"frames of {self.name} must have {wide} x {high} pixels; got {columns} x {rows}: rectify and crop the "
                "frames first, or give the corners of the face (tsis sensor new --corners-px) or image_px in the "
                "sensor's file"
            )
        if abs(columns * high - rows * wide) > ASPECT_TOLERANCE * columns * high:
            raise ImageMismatchError(
                f"frames of {self.name} must have the aspect ratio of {wide} x {high} pixels; got {columns} x {rows}: "
                "use frames of this sensor, or correct image_px in its file"
            )

    def scale_of(self, columns: int, rows: int) -> tuple[float, float] | None:
        """Millimetres per pixel (x, y) of a frame of this size; None where the scale is not known.

        Raises
        ------
        ImageMismatchError
            When frames of the sensor do not have this size, or this ratio of sides.
        """
        self.require_frame(columns, rows)
        if self.mm_per_pixel is None:
            return None
        return self.mm_per_pixel[0] * self.image_px[0] / columns, self.mm_per_pixel[1] * self.image_px[1] / rows

    def known_scale(self, columns: int, rows: int) -> tuple[float, float]:
        """Millimetres per pixel (x, y) as `scale_of`; `InputError` where the scale is not known."""
        scale = self.scale_of(columns, rows)
        if scale is None:
            raise InputError(f"mm_per_pixel of {self.name} is not known; put it into the sensor's file")
        return scale

    def face_mm(self, points_px: Any, columns: int, rows: int) -> NDArray[np.float64]:
        """Positions on the face in mm from its middle, of positions (x, y) in pixels; shape (n, 2).

        The lens's distortion is taken away. Raises `InputError` where the scale is not known.
        """
        scale = self.known_scale(columns, rows)
        points = np.atleast_2d(np.asarray(points_px, dtype=float)) - ((columns - 1) / 2, (rows - 1) / 2)
        distorted = points / np.hypot(columns, rows) * 2.0
        straight, (k1, k2) = distorted.copy(), self.distortion
        for _ in range(20 if k1 or k2 else 0):  # a contraction at the lenses' distortions
            squared = np.square(straight).sum(axis=1, keepdims=True)
            straight = distorted / (1.0 + k1 * squared + k2 * squared**2)
        return np.asarray(straight * np.hypot(columns, rows) / 2.0 * scale)

    def _repr_html_(self) -> str:
        """The values with their limits."""
        scale = "to be calibrated" if self.mm_per_pixel is None else " x ".join(f"{x:.4g}" for x in self.mm_per_pixel)
        rows = [
            ("face", f"{self.shape}, {self.width_mm:g} x {self.height_mm:g} mm"),
            ("thickness / mm", str(self.thickness_mm)),
            ("Young's modulus / kPa", str(self.young_kpa)),
            ("Poisson's ratio", str(self.poisson)),
            ("frame", f"{self.image_px[0]} x {self.image_px[1]} pixels"),
            ("mm per pixel", scale),
            ("light", self.light),
        ]
        return summary_html(self.name, rows)


def gel_sensor_of_probe(
    probe: Probe,
    *,
    image_px: tuple[int, int] = CAMERA_2011_PX,
    mm_per_pixel: tuple[float, float] = CAMERA_2011_MM_PER_PIXEL,
) -> GelSensor:
    """The probe as a gel sensor with the dissertation's camera: white light, brighter where pressed.

    The stack counts as one layer: its modulus is that of springs in series, between the softest and the stiffest layer.

    Examples
    --------
    >>> stack = Probe(radius_mm=12.0, layers=(Layer(thickness_mm=1.0, young_kpa=60.0),
    ...                                       Layer(thickness_mm=1.0, young_kpa=30.0)), name="two layers")
    >>> str(gel_sensor_of_probe(stack).young_kpa)
    '40 (30 to 60)'
    """
    young = [layer.young_kpa for layer in probe.layers]
    ratios = [layer.poisson for layer in probe.layers]
    series = probe.thickness_mm / sum(layer.thickness_mm / layer.young_kpa for layer in probe.layers)
    weighted = sum(layer.poisson * layer.thickness_mm for layer in probe.layers) / probe.thickness_mm
    domed = probe.face_curvature_mm is not None
    return GelSensor(
        name=probe.name or "probe",
        width_mm=2 * probe.radius_mm,
        height_mm=2 * probe.radius_mm,
        outline="round",
        shape="domed" if domed else "flat",
        face_radius_mm=probe.face_curvature_mm,
        thickness_mm=BoundedValue(value=probe.thickness_mm),
        young_kpa=BoundedValue(value=min(max(series, min(young)), max(young)), low=min(young), high=max(young)),
        poisson=BoundedValue(value=min(max(weighted, min(ratios)), max(ratios)), low=min(ratios), high=max(ratios)),
        layers=probe.layers,
        image_px=image_px,
        mm_per_pixel=mm_per_pixel,
        light="white",
        pressed="brighter",
        lamp_azimuth_deg=tuple(led.azimuth_deg for led in probe.leds),
        sources={"layers": "entry of the probe in the catalog"},
    )
