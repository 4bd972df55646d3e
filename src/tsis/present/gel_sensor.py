"""Reports of gel sensors: contacts as a page, a document and a table."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.files.tables import table_bytes
from tsis.imaging.gel_contact import REASONS
from tsis.present.figures import gel_contact
from tsis.present.labels import counted
from tsis.present.page import Card, Page, Picture, Table

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.figure import FigureBase
    from numpy.typing import NDArray

    from tsis.imaging.gel_contact import GelContact
    from tsis.model.gel_sensor import GelSensor


ACROSS = 4  # overlays side by side
MOST_OVERLAYS = 24
COLUMNS = (
    "name", "good", "quality", "reasons", "x_px", "y_px", "radius_px", "radius_sd_px", "x_mm", "y_mm", "radius_mm",
    "radius_sd_mm", "area_mm2", "area_sd_mm2", "long_axis_px", "short_axis_px", "angle_deg", "force_n", "force_sd_n",
    "scale_sd",
)  # fmt: skip


def contact_documents(contacts: Sequence[GelContact]) -> list[dict[str, Any]]:
    """Each contact as a part of a JSON result; NaN becomes null."""
    return [{key: _plain(value) for key, value in asdict(contact).items()} for contact in contacts]


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


NO_FORCE: tuple[float | None, float | None] = (None, None)


def contacts_csv(
    contacts: Sequence[GelContact], forces: Sequence[tuple[float | None, float | None]] | None = None
) -> bytes:
    """The contacts as CSV, one row a frame, with the units in the names; ``forces`` are newtons with their sd."""
    rows = []
    for contact, force in zip(contacts, forces or [NO_FORCE] * len(contacts), strict=True):
        in_mm = contact.centre_mm or ("", "")
        rows.append([
            contact.name, contact.good, f"{contact.quality:.4f}", "; ".join(contact.reasons), *contact.centre_px,
            contact.radius_px, contact.radius_sd_px, *in_mm, contact.radius_mm, contact.radius_sd_mm,
            contact.area_mm2, contact.area_sd_mm2, *contact.semi_axes_px, contact.angle_deg, *force, contact.scale_sd,
        ])  # fmt: skip
    return table_bytes([COLUMNS, *(["" if value is None else value for value in row] for row in rows)])


def gel_contact_rows(contacts: Sequence[GelContact]) -> list[tuple[str, ...]]:
    """Cells for people: frame, centre, radius, quality and reasons."""
    return [
        (
            contact.name,
            "-" if not np.isfinite(contact.radius_px) else "{:.1f}, {:.1f}".format(*contact.centre_px),
            _with_sd(contact.radius_px, contact.radius_sd_px),
            _with_sd(contact.radius_mm, contact.radius_sd_mm),
            f"{contact.quality:.2f}",
            "good" if contact.good else ", ".join(contact.reasons),
        )
        for contact in contacts
    ]


CONTACT_HEADINGS = ("frame", "centre / px", "radius / px", "radius / mm", "quality", "verdict")


def _with_sd(value: float | None, sd: float | None) -> str:
    return "-" if value is None or sd is None or not np.isfinite(value) else f"{value:.3g} ± {sd:.2g}"


def contact_notes(contacts: Sequence[GelContact]) -> tuple[str, ...]:
    """One sentence for each reason that occurs, with its cure."""
    present = {reason for contact in contacts for reason in contact.reasons}
    return tuple(f"{name}: {text}." for name, text in REASONS.items() if name in present)


def draw_contacts(figure: FigureBase, frames: Sequence[NDArray[Any]], contacts: Sequence[GelContact]) -> None:
    """Draw frames with their contacts into a figure, at most 24."""
    count = min(len(contacts), MOST_OVERLAYS)
    across = min(count, ACROSS)
    axes = figure.subplots(-(-count // across), across, squeeze=False).ravel()
    for ax in axes:
        ax.set_axis_off()
    for frame, contact, ax in zip(frames[:count], contacts[:count], axes, strict=False):
        gel_contact(frame, contact, ax)


def overlay_inches(count: int) -> tuple[float, float]:
    """Size of the figure of `draw_contacts`."""
    shown = min(count, MOST_OVERLAYS)
    return 2.8 * min(shown, ACROSS), 2.6 * -(-shown // ACROSS)


def gel_contacts_page(
    frames: Sequence[NDArray[Any]], contacts: Sequence[GelContact], *, provenance: Mapping[str, Any]
) -> Page:
    """The contacts: how many are good, overlays, table, and what to do about the others."""
    good = sum(contact.good for contact in contacts)
    return Page(
        title="Contacts",
        subtitle=counted(len(contacts), "frame"),
        cards=(Card(title="Good contacts", value=f"{good} of {len(contacts)}", doubtful=good == 0),),
        notes=contact_notes(contacts),
        pictures=(
            Picture(
                title="Frames with their contacts",
                draw=lambda figure: draw_contacts(figure, frames, contacts),
                size=overlay_inches(len(contacts)),
                alt="Frames of the gel sensor, each with the outline of its contact",
                caption="A full line is a good contact, a broken one is refused for the reasons above it.",
                wide=True,
            ),
        ),
        tables=(Table(title="Contacts", columns=CONTACT_HEADINGS, values=tuple(gel_contact_rows(contacts))),),
        provenance=provenance,
    )


def sensor_document(sensor: GelSensor) -> dict[str, Any]:
    """The sensor as a part of a JSON result."""
    document = {name: getattr(sensor, name) for name in sensor.__slots__}
    for name in ("thickness_mm", "young_kpa", "poisson"):
        document[name] = asdict(document[name])
    return document | {"layers": [asdict(layer) for layer in sensor.layers], "sources": dict(sensor.sources)}


def sensor_table(sensor: GelSensor) -> Table:
    """What is known of a sensor."""
    radius, scale = sensor.face_radius_mm, sensor.mm_per_pixel
    face = f"{sensor.width_mm:g} x {sensor.height_mm:g} mm, {sensor.shape}, {sensor.outline}"
    known = "" if scale is None else f"{scale[0]:.4g} x {scale[1]:.4g}, sd {sensor.scale_uncertainty:.1%}"
    rows = (
        ("face", face + ("" if radius is None else f" of radius {radius:g} mm")),
        ("gel thickness / mm", str(sensor.thickness_mm)),
        ("Young's modulus / kPa", str(sensor.young_kpa)),
        ("Poisson's ratio", str(sensor.poisson)),
        ("frame / px", f"{sensor.image_px[0]} x {sensor.image_px[1]}"),
        ("mm per pixel", known or "to be calibrated"),
        ("light", f"{sensor.light}; a deeper press is {sensor.pressed}"),
        ("markers", "none" if sensor.marker_pitch_mm is None else f"every {sensor.marker_pitch_mm:g} mm"),
    )
    return Table(title=sensor.name, columns=("quantity", "value"), values=rows)


def sensor_notes(sensor: GelSensor) -> list[str]:
    """What is unknown and what is not valid."""
    notes = list(sensor.limits)
    if sensor.mm_per_pixel is None:
        notes.append("mm_per_pixel is unknown: results are in pixels until the file has it.")
    for name in ("thickness_mm", "young_kpa", "poisson"):
        bounded = getattr(sensor, name)
        if not bounded.exact and not sensor.layers:
            notes.append(f"{name} is known from {bounded.low:g} to {bounded.high:g}: measure it for narrower results.")
    return notes
