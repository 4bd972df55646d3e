"""Pictures of frames (image, change, surface, ring profiles), and pages of frames without an estimate."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import TsisError
from tsis.imaging import corrections, features
from tsis.imaging.contact import ImageFinding, analyse_image
from tsis.imaging.profile import radial_profile
from tsis.imaging.surface import height_surface
from tsis.present.document import features_document
from tsis.present.figures import relief, ring_profile, tactile_image
from tsis.present.page import ON_IMAGE, Card, Page, Picture, Table, on_axes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from tsis.imaging import Features
    from tsis.inclusion.comparison import PressComparison
    from tsis.inclusion.relative import RelativeReading
    from tsis.inclusion.shape import ObjectShape
    from tsis.model.image import TactileImage


MARKERS = "os^v"
FRAMES_PER_ROW, SHEET_WIDTH = 4, 9.5  # frames in a row of a sheet, and its inches


def force_of(frame: TactileImage) -> float:
    """The force in newtons, 0 where unknown."""
    return frame.force_n or 0.0


def frame_picture(image: TactileImage) -> Picture:
    """The image of a frame."""
    force = "force not measured" if image.force_n is None else f"{image.force_n:g} N"
    return Picture(
        title="Tactile image",
        draw=on_axes(tactile_image, image),
        size=(6.0, 4.0),
        alt=f"Tactile image of {image.name}, bright where the pressure is high",
        caption=f"{image.name}, {force}. Bright is high pressure; the rim is the edge of the face.",
    )


def change_picture(
    signal: TactileImage,
    result: Features | None = None,
    *,
    title: str = "What the inclusion adds",
    alt: str = "Target minus reference press, with the outline and the centroid of the bright patch",
    caption: str = "Target minus reference press on plain tissue; outline and centroid in white.",
) -> Picture:
    """The difference of two frames, with the outline of the bright patch; ``result`` has its features."""
    draw = on_axes(tactile_image, signal, features=result or features(signal), low=0.0)
    return Picture(title=title, draw=draw, size=(6.0, 4.0), alt=alt, caption=caption)


def surface_picture(signal: TactileImage) -> Picture:
    """A signal of known scale as a surface."""

    def lifted(figure: Figure) -> None:
        relief(height_surface(signal, max_points=96), figure.add_subplot(projection="3d"))

    return Picture(
        title="Surface",
        draw=lifted,
        size=(6.0, 4.2),
        vector=False,
        alt="The same signal as a surface in three dimensions",
        caption="The same as a surface; heights are grey levels, not millimetres.",
    )


def profile_picture(
    groups: Mapping[str, Sequence[TactileImage]],
    edges_mm: NDArray[np.float64],
    *,
    title: str = "The profiles that the estimate rests on",
) -> Picture:
    """Ring means of frames of known scale, by group, with a line for each press; ``edges_mm`` bound the rings."""
    shown = [
        (what, frame, marker)
        for (what, frames), marker in zip(groups.items(), MARKERS, strict=False)
        for frame in sorted(frames, key=force_of, reverse=True)
    ]

    def profiles(figure: Figure) -> None:
        ax = figure.subplots()
        for what, frame, marker in shown:
            profile = radial_profile(frame, edges_mm=edges_mm)
            ring_profile(profile, ax, label=f"{what}, {force_of(frame):g} N", marker=marker)
        ax.legend(frameon=False)

    return Picture(
        title=title,
        draw=profiles,
        size=(5.5, 3.6),
        alt="Mean grey level in rings around the probe's axis, one line a press",
        caption="Mean grey level in rings around the probe's axis, one line a press.",
    )


def sheet_picture(frames: Sequence[tuple[str, TactileImage]]) -> Picture:
    """Thumbnails of (role, frame), at least one, in one colour map."""
    rows, span = -(-len(frames) // FRAMES_PER_ROW), min(FRAMES_PER_ROW, len(frames))
    tall = max(_aspect(frame) * frame.grey.shape[0] / frame.grey.shape[1] for _, frame in frames)
    height = min(max(SHEET_WIDTH / span * tall, 0.5), 4.0) + 0.25

    def sheet(figure: Figure) -> None:
        high = max(float(frame.grey.max()) for _, frame in frames)
        axes = figure.subplots(rows, span, squeeze=False).ravel()
        for ax in axes:
            ax.set_axis_off()
        for (role, frame), ax in zip(frames, axes, strict=False):
            ax.imshow(frame.grey, cmap="viridis", vmin=0.0, vmax=high, aspect=_aspect(frame))
            force = "" if frame.force_n is None else f", {frame.force_n:g} N"
            ax.set_title(f"{role}{force}", fontsize=8)

    return Picture(
        title="Every frame",
        draw=sheet,
        size=(SHEET_WIDTH, rows * height),
        vector=False,
        wide=True,
        alt=f"{len(frames)} frames side by side in the order in which they were taken",
        caption="In one colour map, from black to the brightest level of all.",
    )


def _aspect(frame: TactileImage) -> float:
    """Height over width of a pixel."""
    return 1.0 if frame.mm_per_pixel is None else frame.mm_per_pixel[1] / frame.mm_per_pixel[0]


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
        own, swapped = press_comparison.shapes, _swapped(press_comparison)
        shapes = [
            {"press": name, **_fields_by_name(shape), "notes": [*swapped.get(name, ()), *shape.notes]}
            for name, shape in own
        ]
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
        tables.append(Table(title=title, columns=("press", "quantity", "value"), values=rows))
    for name, shape in press_comparison.shapes:
        tables.append(Table(title=f"Shape in {name}", columns=("quantity", "value"), values=_shape_rows(shape)))
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
    """What looks swapped, assumptions, notes on presses, and missing readings."""
    swapped = [f"{name}: {note}" for name, notes in _swapped(press_comparison).items() for note in notes]
    values: list[tuple[str, RelativeReading | ObjectShape]] = [*press_comparison.relative, *press_comparison.shapes]
    messages = [f"Assumed: {assumption}" for _, value in values for assumption in value.assumptions]
    messages += [f"{name}: {note}" for name, value in values for note in value.notes]
    return tuple(dict.fromkeys([*swapped, *messages, *press_comparison.missing]))


LEAST_FALL, FALL_OVER_RISE = 0.01, 2.0  # of the full scale


def _swapped(press_comparison: PressComparison) -> dict[str, tuple[str, ...]]:
    """A message for each press whose light mostly falls against the untouched probe, by its name."""
    if press_comparison.against != "untouched probe":  # a soft inclusion is darker than plain tissue
        return {}
    messages: dict[str, tuple[str, ...]] = {}
    for name, change in press_comparison.changes:
        fall, rise = np.quantile(change.grey, [ODD_FRACTION, 1 - ODD_FRACTION]) * (-1, 1)  # without outliers
        if fall > max(FALL_OVER_RISE * rise, LEAST_FALL * change.full_scale):
            messages[name] = (
                f"The reference looks pressed, and this frame not: against it the light falls by {fall:.0f} grey "
                f"levels and rises by {max(rise, 0.0):.0f} (give the untouched probe as --reference).",
            )
    return messages


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


ROW = ("quantity", "value")
ODD_FRACTION = 1e-3  # of the pixels


NOT_ESTIMATED = (
    (
        "inclusion: diameter, depth, modulus",
        "needs a calibration of this probe, the forces and the scale: tsis examine",
    ),
    ("force", "needs a force calibration of this probe and camera"),
    ("hardness of a touched object", "needs a calibration of this probe and two presses on the object: tsis hardness"),
)


def contact_page(findings: Sequence[ImageFinding], *, provenance: Mapping[str, Any]) -> Page:
    """Contact features: images with outline, surface, profile, numbers, and the estimates that frames do not allow.

    ``provenance`` has versions, files and options.
    """
    return Page(
        title="Contact found in tactile images",
        subtitle=", ".join(finding.image.name for finding in findings),
        cards=_cards(findings[0]) if len(findings) == 1 else (),
        notes=tuple(note for finding in findings for note in finding_notes(finding)),
        pictures=tuple(picture for finding in findings for picture in _pictures(finding)),
        tables=tuple(
            Table(title=f"Features of {item.image.name}", columns=("quantity", "value"), values=finding_rows(item))
            for item in findings
        ),
        refused=NOT_ESTIMATED,
        provenance=provenance,
    )


def contacts_document(findings: Sequence[ImageFinding]) -> dict[str, Any]:
    """The features as JSON values, and the estimates that frames do not allow."""
    return {
        "images": [
            {"name": finding.image.name, "features": features_document(finding.features, finding.contact)}
            for finding in findings
        ],
        "refused": [{"estimate": name, "reason": reason} for name, reason in NOT_ESTIMATED],
    }


def comparison_page(press_comparison: PressComparison, *, names: Sequence[str], provenance: Mapping[str, Any]) -> Page:
    """Relative readings and shapes of the presses of these names, with the outlines."""
    return Page(
        title=f"Presses compared with the {press_comparison.against}",
        subtitle=", ".join(names),
        notes=comparison_notes(press_comparison),
        pictures=comparison_pictures(press_comparison),
        tables=comparison_tables(press_comparison),
        provenance=provenance,
    )


def finding_rows(finding: ImageFinding) -> tuple[tuple[str, str], ...]:
    """Names and values of the features, for people: lengths in millimetres where the scale is known, else in pixels."""
    result, circle = finding.features, finding.contact
    if not result.contact:
        return (("contact", "none found: nothing stands out of the noise"),)
    rows = [
        ("centroid", _pair(result.centroid_px, "px") + _also(_pair(result.centroid_mm, "mm from the axis"))),
        ("area", _number(result.area_mm2, "mm²") or f"{result.area_px:.0f} px"),
        (
            "equivalent diameter",
            _number(result.equivalent_diameter_mm, "mm") or f"{result.equivalent_diameter_px:.1f} px",
        ),
        ("ellipse semi-axes", _pair(result.semi_axes_mm, "mm") or _pair(result.semi_axes_px, "px")),
        ("direction of the long axis", _number(result.angle_deg, "degrees")),
        ("eccentricity", _number(result.eccentricity, "")),
        ("circularity", _number(result.circularity, "")),
        ("peak", f"{result.peak:.1f} grey levels"),
        ("sum of grey levels", f"{result.total:.0f}"),
        ("saturated share", f"{100 * result.saturated_fraction:.1f} %"),
        ("touches the border", "yes" if result.cropped else "no"),
    ]
    if circle is not None:
        rows[1:1] = [
            ("centre of the round contact", _pair(circle.centre_px, "px")),
            ("radius of its steepest edge", _number(circle.radius_mm, "mm") or f"{circle.radius_px:.1f} px"),
        ]
    return tuple((name, value.strip()) for name, value in rows)


def finding_notes(finding: ImageFinding) -> tuple[str, ...]:
    """Notes on the limits of the image."""
    image, result, notes = finding.image, finding.features, []
    if not result.contact:
        notes.append(
            f"{image.name}: no contact stands out of the noise (is --invert right, and the reference untouched?)."
        )
    if result.cropped:
        notes.append(f"{image.name}: the contact touches the picture's border, so area and diameter are too small.")
    fall, rise = np.quantile(finding.change.grey, [ODD_FRACTION, 1 - ODD_FRACTION]) * (-1, 1)  # without outliers
    if result.contact and fall > rise:
        notes.append(
            f"{image.name}: the light changes more the other way, by {fall:.0f} against {rise:.0f} grey levels: is "
            "--invert right, which says that light falls where this probe is pressed?"
        )
    clipped = float(np.mean(image.grey >= image.full_scale))
    if not result.contact and clipped > 0:
        notes.append(
            f"{image.name}: {100 * clipped:.1f} % of the picture is clipped by the camera (shorten the exposure)."
        )
    if result.saturated_fraction > 0:
        notes.append(f"{image.name}: {100 * result.saturated_fraction:.1f} % of the contact is clipped by the camera.")
    if image.mm_per_pixel is None:
        notes.append(f"{image.name}: lengths are in pixels; give the scale to have them in millimetres.")
    return tuple(notes)


def _cards(finding: ImageFinding) -> tuple[Card, ...]:
    features, rows = finding.features, dict(finding_rows(finding))
    if not features.contact:
        return (Card(title="Contact", value="none", detail="nothing stands out of the noise", doubtful=True),)
    return (
        Card(
            title="Centroid",
            value=_pair(features.centroid_px, "px"),
            detail=_pair(features.centroid_mm, "mm from the axis"),
        ),
        Card(title="Equivalent diameter", value=rows["equivalent diameter"], detail="of the disc of the same area"),
        Card(
            title="Area",
            value=rows["area"],
            detail="cropped by the picture" if features.cropped else "inside the outline",
        ),
    )


def _pictures(finding: ImageFinding) -> tuple[Picture, ...]:
    image, change, result = finding.image, finding.change, finding.features
    pictures = [
        change_picture(
            change,
            result,
            title=f"Signal of {image.name}",
            alt=f"Change of grey level in {image.name} with the contact's outline and centroid",
            caption="Change of grey level, positive where the probe is pressed; outline and centroid in white.",
        )
    ]
    if change.mm_per_pixel is not None and min(change.grey.shape) > 1:
        pictures.append(surface_picture(change))
    if result.profile is not None:
        pictures.append(
            Picture(
                title="Profile",
                draw=on_axes(ring_profile, result.profile),
                size=(5.5, 3.6),
                alt="Mean grey level in rings around the centroid",
                caption="Mean change of grey level in rings around the centroid.",
            )
        )
    return tuple(pictures)


def _number(value: float | None, unit: str) -> str:
    return "" if value is None else f"{value:.3g} {unit}"


def _pair(values: tuple[float, float] | None, unit: str) -> str:
    return "" if values is None else f"({values[0]:.2f}, {values[1]:.2f}) {unit}"


def _also(text: str) -> str:
    return f", {text}" if text else ""


SIZE = (4.4, 3.0)
DIVERGING = "RdBu_r"  # blue to red through white, distinct without red-green vision
NO_VALUE = "none"


def comparison(image: TactileImage, other: TactileImage, *, match_light: bool = False) -> Page:
    """A page with two frames in one colour map, their difference or the reason why there is none, and their features.

    ``match_light`` scales the second to the brightness of the first before the subtraction
    (`tsis.imaging.corrections.match_light`).
    """
    top = float(max(image.grey.max(), other.grey.max()))
    pictures = [_frame(image, top), _frame(other, top)]
    notes: list[str] = []
    try:
        change = _subtracted(image, other, match_light)
    except TsisError as error:
        notes.append(f"These two cannot be subtracted: {error}.")
    else:
        pictures.append(_difference(change, image, other))
        notes.append(_change_text(change, match_light=match_light))
    return Page(
        title=f"{image.name} compared with {other.name}",
        subtitle="",
        pictures=tuple(pictures),
        notes=tuple(notes),
        tables=(_features(image, other),),
    )


def difference(image: TactileImage, other: TactileImage, *, match_light: bool = False) -> TactileImage | None:
    """The first frame minus the second, as in `comparison`; None where they cannot be subtracted."""
    try:
        return _subtracted(image, other, match_light)
    except TsisError:
        return None


def _subtracted(image: TactileImage, other: TactileImage, match_light: bool) -> TactileImage:
    return corrections.subtract_background(image, corrections.match_light(other, image) if match_light else other)


def _frame(image: TactileImage, top: float) -> Picture:
    force = "force not measured" if image.force_n is None else f"{image.force_n:g} N"
    return Picture(
        title=image.name,
        draw=on_axes(tactile_image, image, low=0.0, high=top),
        size=SIZE,
        alt=f"Frame of {image.name}, bright where the pressure is high",
        caption=f"{force}. Both frames in one colour map.",
        vector=False,
    )


def _difference(change: TactileImage, image: TactileImage, other: TactileImage) -> Picture:
    most = float(np.abs(change.grey).max()) or 1.0
    colours = {"label": "grey levels", "colours": DIVERGING, "ink": ON_IMAGE}
    return Picture(
        title="Difference",
        draw=on_axes(tactile_image, change, low=-most, high=most, **colours),
        size=SIZE,
        alt=f"{image.name} minus {other.name}: red where the first is brighter, blue where the second is",
        caption="The first minus the second: red where the first is brighter, blue where the second is.",
        vector=False,
    )


def _change_text(change: TactileImage, *, match_light: bool) -> str:
    grey = change.grey
    light = "; the second was brought to the brightness of the first" if match_light else ""
    return (
        f"Difference in grey levels: mean {grey.mean():.3g}, root mean square {np.sqrt(np.square(grey).mean()):.3g}, "
        f"from {grey.min():.4g} to {grey.max():.4g}{light}."
    )


def _features(item: TactileImage, other: TactileImage) -> Table:
    results = [dict(finding_rows(analyse_image(image, None, invert=False))) for image in (item, other)]
    names = list(dict.fromkeys([*results[0], *results[1]]))
    rows = tuple((name, *(item.get(name, NO_VALUE) for item in results)) for name in names)
    return Table(title="Features", columns=("quantity", item.name, other.name), values=rows)
