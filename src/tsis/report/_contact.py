"""Report of contact features of image files without a probe calibration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import TsisError
from tsis.imaging import features, find_contact, match_light, signal, subtract_background
from tsis.plots import ring_profile, tactile_image
from tsis.report._frames import change_picture, surface_picture
from tsis.report._page import Card, Page, Picture, Table, html, on_axes
from tsis.report._relative import comparison_notes, comparison_pictures, comparison_tables

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from tsis.imaging import Contact, Features
    from tsis.model import TactileImage
    from tsis.report._relative import PressComparison


ROW = ("quantity", "value")
ODD_FRACTION = 1e-3  # of the pixels


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImageFinding:
    """Analysis of an image: its change of grey level, its features, and the round contact or None."""

    image: TactileImage
    change: TactileImage
    features: Features
    contact: Contact | None


def analyse_image(image: TactileImage, reference: TactileImage | None, *, invert: bool) -> ImageFinding:
    """Analyse an image without a calibration."""
    result = features(image, reference, invert=invert)
    change = signal(image, reference, invert=invert)
    contact = find_contact(change, patch=result.patch) if result.contact else None
    return ImageFinding(image=image, change=change, features=result, contact=contact)


def contact_report(
    findings: Sequence[ImageFinding],
    *,
    refused: Sequence[tuple[str, str]],
    provenance: Mapping[str, Any],
    comparison: PressComparison | None = None,
) -> bytes:
    """Contact features as HTML: images with outline, surface, profile, numbers, and refused estimates.

    ``refused`` has the estimates that these files do not allow, each with the reason; ``provenance`` versions, files
    and options; ``comparison`` relative readings and shapes of the same images.
    """
    return html(
        Page(
            title="Contact found in tactile images",
            subtitle=", ".join(finding.image.name for finding in findings),
            cards=_cards(findings[0].features) if len(findings) == 1 else (),
            notes=(
                *(note for finding in findings for note in finding_notes(finding)),
                *(() if comparison is None else comparison_notes(comparison)),
            ),
            pictures=(
                *(picture for finding in findings for picture in _pictures(finding)),
                *(() if comparison is None else comparison_pictures(comparison)),
            ),
            tables=(
                *(() if comparison is None else comparison_tables(comparison)),
                *(
                    Table(
                        title=f"Features of {item.image.name}", headings=("quantity", "value"), rows=finding_rows(item)
                    )
                    for item in findings
                ),
            ),
            refused=tuple(refused),
            provenance=provenance,
        )
    )


def finding_rows(finding: ImageFinding) -> tuple[tuple[str, str], ...]:
    """Names and values of the features, for people."""
    result, circle = finding.features, finding.contact
    if not result.contact:
        return (("contact", "none found: nothing stands out of the noise"),)
    diameter_mm = _also(_number(result.equivalent_diameter_mm, "mm"))
    rows = [
        ("centroid", _pair(result.centroid_px, "px") + _also(_pair(result.centroid_mm, "mm from the axis"))),
        ("area", f"{result.area_px:.0f} px" + _also(_number(result.area_mm2, "mm²"))),
        ("equivalent diameter", f"{result.equivalent_diameter_px:.1f} px{diameter_mm}"),
        ("ellipse semi-axes", _pair(result.semi_axes_px, "px") + _also(_pair(result.semi_axes_mm, "mm"))),
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
            ("radius of its steepest edge", f"{circle.radius_px:.1f} px" + _also(_number(circle.radius_mm, "mm"))),
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


def _cards(features: Features) -> tuple[Card, ...]:
    if not features.contact:
        return (Card(title="Contact", value="none", detail="nothing stands out of the noise", doubtful=True),)
    in_mm = features.equivalent_diameter_mm is not None
    diameter = _number(features.equivalent_diameter_mm, "mm") if in_mm else f"{features.equivalent_diameter_px:.1f} px"
    area = _number(features.area_mm2, "mm²") if in_mm else f"{features.area_px:.0f} px"
    return (
        Card(
            title="Centroid",
            value=_pair(features.centroid_px, "px"),
            detail=_pair(features.centroid_mm, "mm from the axis"),
        ),
        Card(title="Equivalent diameter", value=diameter, detail="of the disc of the same area"),
        Card(title="Area", value=area, detail="cropped by the picture" if features.cropped else "inside the outline"),
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


def comparison(image: TactileImage, other: TactileImage, *, same_light: bool = False) -> Page:
    """A page with two frames in one colour map, their difference or the reason why there is none, and their features.

    ``same_light`` scales the second to the brightness of the first before the subtraction (`tsis.imaging.match_light`).
    """
    top = float(max(image.grey.max(), other.grey.max()))
    pictures = [_frame(image, top), _frame(other, top)]
    notes: list[str] = []
    try:
        change = subtract_background(image, match_light(other, image) if same_light else other)
    except TsisError as error:
        notes.append(f"These two cannot be subtracted: {error}.")
    else:
        pictures.append(_difference(change, image, other))
        notes.append(_change_text(change, same_light=same_light))
    return Page(
        title=f"{image.name} compared with {other.name}",
        subtitle="",
        pictures=tuple(pictures),
        notes=tuple(notes),
        tables=(_features(image, other),),
    )


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
    colours = {"label": "grey levels", "colours": DIVERGING, "ink": "black"}
    return Picture(
        title="Difference",
        draw=on_axes(tactile_image, change, low=-most, high=most, **colours),
        size=SIZE,
        alt=f"{image.name} minus {other.name}: red where the first is brighter, blue where the second is",
        caption="The first minus the second: red where the first is brighter, blue where the second is.",
        vector=False,
    )


def _change_text(change: TactileImage, *, same_light: bool) -> str:
    grey = change.grey
    light = "; the second was brought to the brightness of the first" if same_light else ""
    return (
        f"Difference in grey levels: mean {grey.mean():.3g}, root mean square {np.sqrt(np.square(grey).mean()):.3g}, "
        f"from {grey.min():.4g} to {grey.max():.4g}{light}."
    )


def _features(item: TactileImage, other: TactileImage) -> Table:
    results = [dict(finding_rows(analyse_image(image, None, invert=False))) for image in (item, other)]
    names = list(dict.fromkeys([*results[0], *results[1]]))
    rows = tuple((name, *(item.get(name, NO_VALUE) for item in results)) for name in names)
    return Table(title="Features", headings=("quantity", item.name, other.name), rows=rows)
