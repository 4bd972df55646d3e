"""Comparison of presses: relative size, depth and hardness, and the shape of the lit area."""

from __future__ import annotations

from dataclasses import dataclass, fields
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.inclusion.relative import (
    RelativeReading,
    change_of_light,
    matching_references,
    relative_depth,
    relative_hardness,
    relative_size,
)
from tsis.inclusion.shape import ObjectShape, object_shape
from tsis.plots import tactile_image
from tsis.report._page import Picture, Table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from tsis.model import Calibration, TactileImage


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressComparison:
    """Relative readings of presses, for comparisons with each other only.

    Attributes
    ----------
    against
        Kind of the references: ``"untouched probe"`` or ``"plain tissue"``.
    relative
        Relative readings by name: of a press, or of two presses of different force.
    shapes
        Shape of the lit area of each press, by the name of the frame.
    changes
        Change of light of each press, by the name of the frame.
    missing
        A message for each reading that the frames do not allow.
    """

    against: str
    relative: tuple[tuple[str, RelativeReading], ...]
    shapes: tuple[tuple[str, ObjectShape], ...]
    changes: tuple[tuple[str, TactileImage], ...]
    missing: tuple[str, ...] = ()


def compare_presses(
    images: Sequence[TactileImage],
    references: Sequence[TactileImage],
    *,
    against: str,
    calibration: Calibration | None = None,
    relative: bool = True,
    shape: bool = True,
) -> PressComparison:
    """Relative readings and shapes of presses, each against references of the same force.

    The frames have a scale. ``against`` is the kind of the references: ``"untouched probe"`` or ``"plain tissue"``.
    Relative hardness requires a calibration, whose gain converts grey levels to pressure. ``relative`` and ``shape``
    select what is read.

    Raises
    ------
    InputError, ImageMismatchError
        As `tsis.inclusion.relative.relative_size`; when an image has no reference of the same force.
    """
    fitting = [matching_references(image, references, against=against) for image in images]
    given: dict[str, Any] = {"against": against, "calibration": calibration}
    readings, shapes, changes = [], [], []
    for image, own in zip(images, fitting, strict=True):
        if relative:
            readings += [(image.name, read(image, own, **given)) for read in (relative_size, relative_depth)]
        if shape:
            shapes.append((image.name, object_shape(image, own, **given)))
        changes.append((image.name, change_of_light(image, own, **given).image))
    rising = sorted(zip(images, fitting, strict=True), key=lambda pair: pair[0].force_n or 0.0)
    pairs = [(item, other) for item, other in pairwise(rising) if (item[0].force_n or 0.0) < (other[0].force_n or 0.0)]
    missing = _missing(pairs, calibration) if relative else ()
    if relative and not missing and calibration is not None:
        for (first, item), (second, other) in pairs:
            reading = relative_hardness(first, second, reference=item, second_reference=other, **given)
            readings.append((f"{first.name}, {second.name}", reading))
    return PressComparison(
        against=against, relative=tuple(readings), shapes=tuple(shapes), changes=tuple(changes), missing=missing
    )


def _missing(pairs: Sequence[Any], calibration: Calibration | None) -> tuple[str, ...]:
    if calibration is None:
        return ("Relative hardness is not read: it needs a calibration, whose gain turns grey levels into pressure.",)
    if not pairs:
        return ("Relative hardness is not read: it needs two presses on one target with different known forces.",)
    return ()


def comparison_document(press_comparison: PressComparison) -> dict[str, Any]:
    """The readings as JSON values, under ``relative`` and ``shape``."""
    document: dict[str, Any] = {}
    if press_comparison.relative:
        document["relative"] = {
            "against": press_comparison.against,
            "readings": [{"presses": name, **_fields_by_name(reading)} for name, reading in press_comparison.relative],
            "missing": list(press_comparison.missing),
        }
    if press_comparison.shapes:
        own = press_comparison.shapes
        shapes = [{"press": name, **_fields_by_name(shape), "notes": list(shape.notes)} for name, shape in own]
        document["shape"] = {"against": press_comparison.against, "presses": shapes}
    return document


def _fields_by_name(value: Any) -> dict[str, Any]:
    return {field.name: getattr(value, field.name) for field in fields(value)}


def comparison_tables(press_comparison: PressComparison) -> tuple[Table, ...]:
    """A table of the relative readings, and one of the shapes."""
    tables = []
    if press_comparison.relative:
        rows = tuple((name, reading.quantity, _reading(reading)) for name, reading in press_comparison.relative)
        title = f"Relative readings against {press_comparison.against}"
        tables.append(Table(title=title, headings=("press", "quantity", "value"), rows=rows))
    for name, shape in press_comparison.shapes:
        tables.append(Table(title=f"Shape in {name}", headings=("quantity", "value"), rows=_shape_rows(shape)))
    return tuple(tables)


def _reading(reading: RelativeReading) -> str:
    return "no value" if reading.value is None else f"{reading.value:.4g} {reading.unit}"


def _shape_rows(shape: ObjectShape) -> tuple[tuple[str, str], ...]:
    if shape.area_mm2 is None or shape.centre_mm is None or shape.semi_axes_mm is None:
        return (("shape", "nothing stands out of the noise"),)
    long, short = shape.semi_axes_mm
    return (
        ("area", f"{shape.area_mm2:.4g} mm²"),
        ("centre from the axis", f"({shape.centre_mm[0]:.2f}, {shape.centre_mm[1]:.2f}) mm"),
        ("semi-axes", f"{long:.3g} and {short:.3g} mm"),
        ("direction of the long axis", f"{shape.angle_deg:.3g} degrees"),
        ("eccentricity", f"{shape.eccentricity:.3g}"),
        ("circularity", f"{shape.circularity:.3g}"),
        ("threshold", f"{shape.levels.threshold_grey:.3g} grey levels"),
    )


def comparison_notes(press_comparison: PressComparison) -> tuple[str, ...]:
    """Assumptions, notes on presses, and missing readings."""
    values: list[tuple[str, RelativeReading | ObjectShape]] = [*press_comparison.relative, *press_comparison.shapes]
    messages = [f"Assumed: {assumption}" for _, value in values for assumption in value.assumptions]
    messages += [f"{name}: {note}" for name, value in values for note in value.notes]
    return tuple(dict.fromkeys([*messages, *press_comparison.missing]))


def comparison_pictures(press_comparison: PressComparison) -> tuple[Picture, ...]:
    """The change of light of each press with a shape, with its outline."""
    changes = dict(press_comparison.changes)
    return tuple(_outline(name, changes[name], shape) for name, shape in press_comparison.shapes)


def _outline(name: str, change: TactileImage, shape: ObjectShape) -> Picture:
    def draw(figure: Figure) -> None:
        ax = tactile_image(change, figure.subplots(), low=0.0)
        if len(shape.contour_mm):
            outline = shape.contour_mm + np.multiply(change.axis(), change.scale())
            ax.plot(*outline.T, color="white", linewidth=1.0)

    return Picture(
        title=f"Shape in {name}",
        draw=draw,
        size=(6.0, 4.2),
        alt=f"Change of light in {name} with the outline by the two-means threshold",
        caption=f"Change of light against the {shape.against}; outline by the two-means threshold in white.",
    )
