"""Immutable values with validation, shared by all packages: probes, phantoms, presses, images, estimates."""

from tsis.model._bounded_value import BoundedValue
from tsis.model._budget import QuantityBudget, UncertaintyComponent
from tsis.model._calibration import Calibration, LightMap
from tsis.model._content import ContentValue
from tsis.model._estimate import (
    ABSENCE_FLAG,
    IMPROBABLE,
    LARGEST_EVIDENCE,
    NO_UNIT,
    NOT_IDENTIFIED,
    NOT_TRUSTED,
    UNITS,
    Estimate,
    label_of,
    probability_bound,
    probability_text,
    unit_of,
)
from tsis.model._gel_sensor import (
    CAMERA_2011_MM_PER_PIXEL,
    CAMERA_2011_PX,
    GEL_LIGHTS,
    GEL_SHAPES,
    GelSensor,
    gel_sensor_of_probe,
)
from tsis.model._html import summary_html
from tsis.model._image import (
    LARGEST_PIXEL_MM,
    SMALLEST_PIXEL_MM,
    TactileImage,
    require_image_numbers,
    require_pixel_scale,
)
from tsis.model._image_series import (
    as_images,
    grey_sha256,
    image_from_xarray,
    image_stack,
    require_frames_of_probe,
    require_image_series,
    require_same_probe,
)
from tsis.model._phantom import INCLUSION_RANGES, Inclusion, Phantom, Relaxation, SoftSphere
from tsis.model._posterior import INTERVAL_LEVEL, PosteriorSamples
from tsis.model._press import MN_PER_N, PressField, PressMap, interpolation_matrix, require_ascending
from tsis.model._probe import FOUR_LEDS, Glass, Layer, Led, Probe
from tsis.model._require import (
    freeze_arrays,
    freeze_mappings,
    require_array,
    require_integer,
    require_number,
    require_one_of,
    require_pair,
    require_type,
)

__all__ = [
    "ABSENCE_FLAG",
    "CAMERA_2011_MM_PER_PIXEL",
    "CAMERA_2011_PX",
    "FOUR_LEDS",
    "GEL_LIGHTS",
    "GEL_SHAPES",
    "IMPROBABLE",
    "INCLUSION_RANGES",
    "INTERVAL_LEVEL",
    "LARGEST_EVIDENCE",
    "LARGEST_PIXEL_MM",
    "MN_PER_N",
    "NOT_IDENTIFIED",
    "NOT_TRUSTED",
    "NO_UNIT",
    "SMALLEST_PIXEL_MM",
    "UNITS",
    "BoundedValue",
    "Calibration",
    "ContentValue",
    "Estimate",
    "GelSensor",
    "Glass",
    "Inclusion",
    "Layer",
    "Led",
    "LightMap",
    "Phantom",
    "PosteriorSamples",
    "PressField",
    "PressMap",
    "Probe",
    "QuantityBudget",
    "Relaxation",
    "SoftSphere",
    "TactileImage",
    "UncertaintyComponent",
    "as_images",
    "freeze_arrays",
    "freeze_mappings",
    "gel_sensor_of_probe",
    "grey_sha256",
    "image_from_xarray",
    "image_stack",
    "interpolation_matrix",
    "label_of",
    "probability_bound",
    "probability_text",
    "require_array",
    "require_ascending",
    "require_frames_of_probe",
    "require_image_numbers",
    "require_image_series",
    "require_integer",
    "require_number",
    "require_one_of",
    "require_pair",
    "require_pixel_scale",
    "require_same_probe",
    "require_type",
    "summary_html",
    "unit_of",
]
