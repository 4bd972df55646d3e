"""Page, figures, document and volumes of a map of lumps."""

from __future__ import annotations

import base64
from dataclasses import asdict, dataclass, field, replace
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.patches import Circle

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.mapping.flags import MAP_FLAGS
from tsis.mapping.scan_folder import described
from tsis.model.estimate import INTERVAL_LEVEL, label_of, probability_text
from tsis.present.document import envelope, estimate_document
from tsis.present.labels import quantity_of
from tsis.present.page import Card, Column, Page, Picture, Table, flags_table, on_axes

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from tsis.mapping.lump_map import Lump, LumpMap, MapNumbers
    from tsis.mapping.scan import Scan
    from tsis.model.estimate import Estimate
    from tsis.records.values import StoredMap


SHOWN = ("x_mm", "y_mm", "depth_mm", "diameter_mm", "contrast", "young_kpa")
LISTED = ("x_mm", "y_mm", "depth_mm", "diameter_mm")
BALL = ("x_mm", "y_mm", "centre_depth_mm", "diameter_mm")
DRAWN_DEPTHS_MM = (5.0, 10.0)  # of the drawn blind zones and planes of modulus
LARGEST_DRAWN_MM = 20.0  # least diameter at the end of the blind zone's colours
MOST_SECTIONS = 4
SECTION_MM = 15.0  # drawn to either side of a lump
LUMP_COLOUR, PRESS_COLOUR, NEXT_COLOUR = "tab:red", "tab:gray", "tab:green"
VOLUMES = {
    "probability": "probability of a lump",
    "modulus_kpa": "mean of Young's modulus in kPa",
    "modulus_sd_kpa": "standard deviation of Young's modulus in kPa",
}
DICOM_LIBRARIES = ("pydicom", "highdicom", "sqlalchemy")  # of the extra dicom


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MapReport:
    """A map as it is published.

    Attributes
    ----------
    document
        The result for programs.
    page
        The page for people.
    volumes
        Files of the volumes by name: VTK, NIfTI where the extra ``map`` is installed, and DICOM where ``dicom`` is;
        none of an untrusted map.
    """

    document: Mapping[str, Any]
    page: Page
    volumes: Mapping[str, bytes] = field(default_factory=dict)


def map_report(
    found: LumpMap, scan: Scan, *, probe: str = "", calibration: Mapping[str, Any] | None = None
) -> MapReport:
    """What is published of a map of a scan by the named probe; frames cite their calibration."""
    provenance = {
        "notice": RESEARCH_USE_ONLY,
        "tsis": __version__,
        "scan": described(scan),
        "calibration": calibration if scan.kind == "frame" else None,
    }
    by = probe or f"a {scan.indenter.shape if scan.indenter else 'probe'}"
    page = lump_map_page(
        found,
        title=f"Map of {scan.name or 'a scan'}",
        subtitle=f"{len(found.places_mm)} presses by {by}",
        provenance=provenance,
    )
    volumes: dict[str, bytes] = {}
    if found.trusted:
        volumes["map.vti"] = vtk_bytes(found.numbers)
        volumes |= nifti_files(found.numbers) if find_spec("nibabel") else {}
        volumes |= dicom_volumes(found.numbers) if all(map(find_spec, DICOM_LIBRARIES)) else {}
    return MapReport(
        document=envelope("map", **lump_map_document(found), inputs=provenance), page=page, volumes=volumes
    )


def lump_map_page(
    found: LumpMap,
    *,
    title: str,
    subtitle: str,
    provenance: Mapping[str, Any] | None = None,
) -> Page:
    """The page of a map: cards, plan view, sections, blind zone and tables; an untrusted map shows its flags alone."""
    provenance = {**found.provenance, **(provenance or {})}
    flags = flags_table(dict.fromkeys(found.flags), MAP_FLAGS)
    if not found.trusted:
        card = Card(title="Lumps", value="withheld", detail="a check failed: see the flags", doubtful=True)
        return Page(
            title=title, subtitle=subtitle, cards=(card,), notes=found.notes, tables=flags, provenance=provenance
        )
    numbers = found.numbers
    return Page(
        title=title,
        subtitle=subtitle,
        cards=_cards(numbers),
        notes=found.notes,
        pictures=(_plan(found), *_sections(numbers), _moduli(numbers), _blind(numbers)),
        tables=(*_lumps_table(numbers), _counts_table(numbers), *_next_table(numbers), *flags),
        provenance=provenance,
    )


def guide_page(found: LumpMap, *, title: str, subtitle: str) -> Page:
    """The page of an update between two presses: the plan view, the lumps and where to press next, withheld as ever."""
    whole = lump_map_page(found, title=title, subtitle=subtitle)
    if not found.trusted:
        return whole
    return replace(whole, pictures=(_plan(found),), tables=(*_next_table(found.numbers), *_lumps_table(found.numbers)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Ball:
    """A sphere of the 3-D view: centre in mm, z upwards from the skin, diameter in mm, and how opaque it is."""

    x_mm: float
    y_mm: float
    z_mm: float
    diameter_mm: float
    opacity: float
    is_sample: bool


def lump_balls(numbers: MapNumbers, *, samples: int = 25) -> tuple[Ball, ...]:
    """Spheres of a view in three dimensions: each lump's medians, and samples of its posterior."""
    balls = []
    for lump in numbers.lumps:
        rows = np.array([lump.estimate.samples[name] for name in BALL]).T
        chosen = rows[np.linspace(0, len(rows) - 1, min(samples, len(rows))).astype(int)]
        for place, row in enumerate([np.median(rows, axis=0), *chosen]):
            x, y, depth, diameter = row.tolist()
            opacity = 0.8 if place == 0 else 0.06
            balls.append(Ball(x_mm=x, y_mm=y, z_mm=-depth, diameter_mm=diameter, opacity=opacity, is_sample=place > 0))
    return tuple(balls)


def _cards(numbers: MapNumbers) -> tuple[Card, ...]:
    likeliest = int(np.argmax(numbers.count_probability))
    share = float(numbers.count_probability[likeliest])
    unevenness = " to ".join(f"{100 * end:.2g}" for end in numbers.unevenness.interval(INTERVAL_LEVEL)["sd"])
    return (
        Card(
            title="Lumps",
            value=str(likeliest),
            detail=f"with a probability of {probability_text(share)}",
            doubtful=share < INTERVAL_LEVEL,
        ),
        Card(title="Unevenness of the tissue", value=f"{unevenness} %", detail="90 % interval"),
    )


def _interval_text(estimate: Estimate, name: str) -> str:
    low, high = estimate.interval(INTERVAL_LEVEL)[name]
    return f"{low:.3g} to {high:.3g}"


def _lump_row(lump: Lump) -> tuple[str | float, ...]:
    cells = [_interval_text(lump.estimate, name) for name in SHOWN]
    if lump.contrast_above is not None:
        cells[SHOWN.index("contrast")] = f"above {lump.contrast_above:.2g}"
    return (lump.name, lump.probability, *cells)


def _lumps_table(numbers: MapNumbers) -> tuple[Table, ...]:
    if not numbers.lumps:
        return ()
    probability = Column(label="probability", form=probability_text)
    columns: tuple[str | Column, ...] = ("lump", probability, *(quantity_of(name).axis for name in SHOWN))
    return (Table(title="Lumps, 90 % intervals", columns=columns, values=tuple(map(_lump_row, numbers.lumps))),)


def _counts_table(numbers: MapNumbers) -> Table:
    columns = ("number of lumps", Column(label="probability", form=probability_text))
    shown = [(str(count), float(share)) for count, share in enumerate(numbers.count_probability) if share >= 1e-3]
    return Table(title="How many lumps", columns=columns, values=tuple(shown))


def _next_table(numbers: MapNumbers) -> tuple[Table, ...]:
    if not numbers.next_places:
        return ()
    columns = tuple(
        Column(label=label, unit=unit, form=form)
        for label, unit, form in (("x", "mm", ".1f"), ("y", "mm", ".1f"), ("expected gain", "nat", ".2g"))
    )
    rows = tuple((place.x_mm, place.y_mm, place.gain_nats) for place in numbers.next_places)
    return (Table(title="Where to press next", columns=columns, values=rows),)


KIND_NAMES = {"frame": "frames", "pressure_kpa": "pressures", "travel_force": "travel and force"}


def scan_summary(scan: Scan, *, probe: str = "") -> str:
    """How many presses a scan has, of what, and by which probe.

    Examples
    --------
    >>> from tsis.mapping.scan import Scan, ScanPress
    >>> rings = [1.0, 0.9, 0.8]
    >>> presses = tuple(ScanPress(place_mm=(x, 0.0), pressure_kpa=rings, force_n=1.0) for x in (0.0, 10.0))
    >>> scan_summary(Scan(presses=presses), probe="tsis-2011")
    '2 presses (pressures) by tsis-2011'
    """
    references = sum(press.reference for press in scan.presses)
    beside = f", {references} of them references" if references else ""
    return f"{len(scan.presses)} presses ({KIND_NAMES[scan.kind]}){beside}" + (f" by {probe}" if probe else "")


BESIDE: dict[str, Any] = {  # a legend that hides no corner
    "loc": "lower center",
    "bbox_to_anchor": (0.5, 1.0),
    "ncols": 2,
    "fontsize": 7,
    "frameon": False,
}


def scan_picture(scan: Scan) -> Picture:
    """The places of a scan's presses, before it is mapped."""

    def draw(ax: Axes) -> None:
        for reference, marker, label in ((False, "+", "press"), (True, "x", "reference")):
            places = np.array([press.place_mm for press in scan.presses if press.reference == reference])
            if len(places):
                ax.plot(*places.T, marker, label=label)
        ax.legend(**BESIDE)
        ax.set(xlabel="x / mm", ylabel="y / mm", aspect="equal")

    return Picture(title="Places", draw=on_axes(draw), size=(4.0, 3.4), alt=f"Places of {len(scan.presses)} presses")


def _extent(across: NDArray[np.float64], along: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Edges of the cells around centres: left, right, first and last of the other axis."""

    def edges(centres: NDArray[np.float64]) -> tuple[float, float]:
        half = (centres[1] - centres[0]) / 2 if len(centres) > 1 else 0.5
        return float(centres[0] - half), float(centres[-1] + half)

    return (*edges(across), *edges(along))


def plan_view(found: LumpMap, ax: Axes) -> Axes:
    """Draw the probability of a lump under each point, with presses, lumps and the next places."""
    numbers = found.numbers
    image = ax.imshow(
        numbers.area_probability,
        origin="lower",
        extent=_extent(numbers.x_mm, numbers.y_mm),
        cmap="Blues",
        vmin=0.0,
        vmax=1.0,
    )
    ax.figure.colorbar(image, ax=ax, label="probability of a lump", shrink=0.8)
    ax.plot(*found.places_mm.T, "+", color=PRESS_COLOUR, markersize=5, label="press")
    for lump in numbers.lumps:
        x, y, diameter = (float(np.median(lump.estimate.samples[name])) for name in ("x_mm", "y_mm", "diameter_mm"))
        ax.add_patch(Circle((x, y), diameter / 2, fill=False, color=LUMP_COLOUR, linewidth=1.5))
        ax.annotate(lump.name, (x, y), color=LUMP_COLOUR, ha="center", fontsize=8)
    if numbers.next_places:
        first = numbers.next_places[0]
        ax.plot([first.x_mm], [first.y_mm], "*", color=NEXT_COLOUR, markersize=9, label="press next")
    ax.legend(**BESIDE)
    ax.set(xlabel="x / mm", ylabel="y / mm", aspect="equal")
    return ax


def lump_section(numbers: MapNumbers, lump: Lump, ax: Axes) -> Axes:
    """Draw the probability in the plane of x and depth through a lump, with outlines of samples of its posterior."""
    samples = lump.estimate.samples
    row = int(np.argmin(np.abs(numbers.y_mm - np.median(samples["y_mm"]))))
    left, right, top, bottom = _extent(numbers.x_mm, numbers.depth_mm)
    ax.imshow(
        numbers.probability[:, row],
        origin="upper",
        extent=(left, right, bottom, top),
        cmap="Blues",
        vmin=0.0,
        vmax=1.0,
    )
    chosen = np.linspace(0, len(samples["x_mm"]) - 1, min(40, len(samples["x_mm"]))).astype(int)
    for index in chosen:
        centre = samples["x_mm"][index], samples["centre_depth_mm"][index]
        radius = samples["diameter_mm"][index] / 2
        ax.add_patch(Circle(centre, radius, fill=False, color=LUMP_COLOUR, alpha=0.25, linewidth=0.6))
    middle = float(np.median(samples["x_mm"]))
    ax.set(xlabel="x / mm", ylabel="depth / mm", title=f"{lump.name}, y {numbers.y_mm[row]:.0f} mm", aspect="equal")
    ax.set(xlim=(middle - SECTION_MM, middle + SECTION_MM))
    return ax


def blind_zone(numbers: MapNumbers, top_mm: float, ax: Axes) -> Axes:
    """Draw the least diameter that the scan would have shown with its top at a depth; blank where none would."""
    layer = int(np.argmin(np.abs(numbers.depth_mm - top_mm)))
    least = np.ma.masked_invalid(numbers.blind_diameter_mm[layer])
    ax.set_facecolor("0.75")
    image = ax.imshow(
        least,
        origin="lower",
        extent=_extent(numbers.x_mm, numbers.y_mm),
        cmap="viridis_r",
        vmin=0.0,
        vmax=LARGEST_DRAWN_MM,
    )
    ax.figure.colorbar(image, ax=ax, label="least diameter / mm", shrink=0.8)
    ax.set(xlabel="x / mm", ylabel="y / mm", title=f"top at {numbers.depth_mm[layer]:.0f} mm", aspect="equal")
    return ax


def modulus_plane(numbers: MapNumbers, depth_mm: float, ax: Axes) -> Axes:
    """Draw the mean of Young's modulus, lumps and uneven tissue together, in the plane at a depth."""
    layer = int(np.argmin(np.abs(numbers.depth_mm - depth_mm)))
    image = ax.imshow(
        numbers.modulus_kpa[layer],
        origin="lower",
        extent=_extent(numbers.x_mm, numbers.y_mm),
        cmap="magma",
        vmin=float(numbers.modulus_kpa.min()),
        vmax=float(numbers.modulus_kpa.max()),
    )
    ax.figure.colorbar(image, ax=ax, label="modulus / kPa", shrink=0.8)
    ax.set(xlabel="x / mm", ylabel="y / mm", title=f"at {numbers.depth_mm[layer]:.0f} mm", aspect="equal")
    return ax


def _planes(draw_plane: Callable[[MapNumbers, float, Axes], Axes], numbers: MapNumbers, **picture: str) -> Picture:
    """A picture of one plane beside another, at `DRAWN_DEPTHS_MM`."""

    def draw(figure: Figure) -> None:
        for depth, ax in zip(DRAWN_DEPTHS_MM, figure.subplots(1, len(DRAWN_DEPTHS_MM)), strict=True):
            draw_plane(numbers, depth, ax)

    return Picture(draw=draw, size=(8.0, 3.6), wide=True, vector=False, **picture)


def _plan(found: LumpMap) -> Picture:
    return Picture(
        title="Plan view",
        draw=on_axes(plan_view, found),
        size=(6.0, 5.0),
        alt="Probability of a lump under each point of the skin, with presses and lumps",
        caption="A circle has the medians of place and diameter.",
        vector=False,
    )


def _sections(numbers: MapNumbers) -> tuple[Picture, ...]:
    shown = numbers.lumps[:MOST_SECTIONS]
    if not shown:
        return ()

    def draw(figure: Figure) -> None:
        for lump, ax in zip(shown, figure.subplots(1, len(shown), squeeze=False)[0], strict=True):
            lump_section(numbers, lump, ax)

    return (
        Picture(
            title="Sections",
            draw=draw,
            size=(3.6 * len(shown), 3.2),
            alt="Probability of a lump in a vertical plane through each lump",
            caption="Each thin circle is one sample of the posterior: their spread is the uncertainty.",
            wide=len(shown) > 1,
            vector=False,
        ),
    )


def _moduli(numbers: MapNumbers) -> Picture:
    return _planes(
        modulus_plane,
        numbers,
        title="Modulus",
        alt="Mean of Young's modulus in planes at two depths",
        caption="Lumps and uneven tissue together; the volumes hold the standard deviation.",
    )


def _blind(numbers: MapNumbers) -> Picture:
    return _planes(
        blind_zone,
        numbers,
        title="Blind zone",
        alt="Least diameter of a lump that the scan would have shown, at two depths",
        caption="Of lumps of contrast 5, nine in ten would have been seen. Grey: none that the prior allows.",
    )


def lump_map_document(found: LumpMap) -> dict[str, Any]:
    """A map as a JSON document without its volumes; numbers of an untrusted map are left out."""
    numbers = found.numbers if found.trusted else None
    return {
        "trusted": found.trusted,
        "flags": list(found.flags),
        "notes": list(found.notes),
        "left_out": list(found.left_out),
        "lumps": None
        if numbers is None
        else [
            {
                "name": lump.name,
                "probability": lump.probability,
                "contrast_above": lump.contrast_above,
                "estimate": estimate_document(lump.estimate),
            }
            for lump in numbers.lumps
        ],
        "count_probability": None if numbers is None else numbers.count_probability.tolist(),
        "unevenness": None if numbers is None else estimate_document(numbers.unevenness),
        "next_places": None if numbers is None else [asdict(place) for place in numbers.next_places],
        "places_mm": found.places_mm.tolist(),
        "place_shift_mm": None if numbers is None else found.place_shift_mm.tolist(),
        "provenance": dict(found.provenance),
    }


def stored_map_document(stored: StoredMap) -> dict[str, Any]:
    """A stored map as a JSON document without its volumes; numbers of an untrusted map are left out."""
    from tsis.records.values import map_to_json  # loads the libraries of records

    return {**map_to_json(stored), **lump_map_document(stored.estimate)}


def lumps_text(found: LumpMap) -> str:
    """The lumps of a trusted map in one line, with the intervals of place and size.

    ``"lump 1: x 2.9 to 3.4 mm, ..."``, or that there is none.
    """
    told = (
        f"{lump.name}: {', '.join(f'{label_of(name)} {_interval_text(lump.estimate, name)} mm' for name in LISTED)}"
        for lump in found.lumps
    )
    return "; ".join(told) or "no lump"


def vtk_bytes(numbers: MapNumbers) -> bytes:
    """The volumes as ImageData of VTK (.vti), for ParaView, 3D Slicer and PyVista: x, y and z in mm, z upwards."""
    shape = [len(axis) for axis in (numbers.x_mm, numbers.y_mm, numbers.depth_mm)]
    whole = " ".join(f"0 {count - 1}" for count in shape)
    origin = f"{numbers.x_mm[0]} {numbers.y_mm[0]} {-numbers.depth_mm[-1]}"
    blocks = {name: _vtk_block(getattr(numbers, name)[::-1]) for name in VOLUMES}
    arrays = "".join(
        f'<DataArray type="Float64" Name="{name}" format="binary">{block}</DataArray>' for name, block in blocks.items()
    )
    return (
        '<?xml version="1.0"?>\n'
        '<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="UInt64">'
        f'<ImageData WholeExtent="{whole}" Origin="{origin}" Spacing="{" ".join(map(str, numbers.spacing_mm))}">'
        f'<Piece Extent="{whole}"><PointData Scalars="probability">{arrays}</PointData></Piece>'
        "</ImageData></VTKFile>\n"
    ).encode()


def _vtk_block(values: NDArray[np.float64]) -> str:
    """Values in base64 after their count of bytes; x runs fastest, then y, then z."""
    content = np.ascontiguousarray(values, dtype="<f8").tobytes()
    return base64.b64encode(np.array([len(content)], dtype="<u8").tobytes() + content).decode()


def nifti_files(numbers: MapNumbers) -> dict[str, bytes]:
    """The volumes as NIfTI files by name: x, y and z in mm, z upwards from the skin.

    Raises `ImportError` without nibabel, of the extra ``map``.
    """
    import nibabel as nib  # of the extra map

    affine = np.diag([*numbers.spacing_mm, 1.0])
    affine[:3, 3] = numbers.x_mm[0], numbers.y_mm[0], -numbers.depth_mm[-1]
    files = {}
    for name, what in VOLUMES.items():
        volume = np.moveaxis(getattr(numbers, name)[::-1], (0, 1, 2), (2, 1, 0))
        image = nib.Nifti1Image(volume, affine)  # type: ignore[no-untyped-call]
        image.header.set_xyzt_units("mm")  # type: ignore[no-untyped-call]
        image.header["descrip"] = f"{what}; research use only"[:79]
        files[f"{name.replace('_', '-')}.nii"] = image.to_bytes()
    return files


def dicom_volumes(numbers: MapNumbers) -> dict[str, bytes]:
    """The modulus and the probability as DICOM files by name; `MissingExtraError` without the extra ``dicom``."""
    from tsis.records.map_dicom import map_dicom_files  # of the extra dicom

    return {file.name: file.content for file in map_dicom_files(numbers)}
