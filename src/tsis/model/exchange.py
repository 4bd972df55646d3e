"""How values pass to notebooks, ArviZ and xarray (extra ``analysis``)."""

from __future__ import annotations

import base64
import warnings
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.errors import import_extra
from tsis.files.images import encode_picture

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray


THUMBNAIL_PX = 240  # longest side
CELL = "text-align:left;padding:1px 12px 1px 0"


def summary_html(
    title: str,
    rows: Iterable[tuple[str, ...]],
    *,
    headings: tuple[str, ...] = (),
    picture: str = "",
    result: bool = False,
) -> str:
    """A table in HTML without scripts and external resources; every text is escaped.

    Parameters
    ----------
    title
        The heading.
    rows
        The cells of each row.
    headings
        Headings of the columns, if any.
    picture
        Address of a picture beside the table, e.g. of `thumbnail`.
    result
        Whether the value is a result; then the notice of research use stands below.
    """
    head = "".join(f'<th style="{CELL}">{escape(item)}</th>' for item in headings)
    body = "".join(
        "<tr>" + "".join(f'<td style="{CELL}">{escape(cell)}</td>' for cell in row) + "</tr>" for row in rows
    )
    image = f'<img alt="{escape(title)}" src="{escape(picture)}">' if picture else ""
    notice = f"<p><strong>{RESEARCH_USE_ONLY}</strong></p>" if result else ""
    table = f"<table>{f'<tr>{head}</tr>' if head else ''}{body}</table>"
    return f"<div><p><strong>{escape(title)}</strong></p>{image}{table}{notice}</div>"


def thumbnail(grey: NDArray[np.float64], full_scale: float) -> str:
    """Grey levels as a small PNG file in a data address; black is 0 and white the full scale."""
    step = -(-max(grey.shape) // THUMBNAIL_PX)
    levels = np.clip(grey[::step, ::step] * (255.0 / full_scale), 0.0, 255.0).astype(np.uint8)
    return f"data:image/png;base64,{base64.b64encode(encode_picture(levels)).decode()}"


EXTRA = "analysis"


def posterior_for_arviz(
    samples: Mapping[str, NDArray[np.float64]],
    *,
    variables: Mapping[str, Mapping[str, Any]],
    attributes: Mapping[str, Any],
) -> Any:
    """Equally weighted samples as one chain: an ``InferenceData`` before release 1 of ArviZ, else a ``DataTree``.

    ``variables`` has the attributes of each parameter, ``attributes`` those of the group ``posterior``.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # releases before 1 announce release 1
        arviz = import_extra("arviz", feature="a posterior for ArviZ", extra=EXTRA)
    chains = {name: np.asarray(values)[None] for name, values in samples.items()}
    before_1 = "InferenceData" in vars(arviz)  # release 1 warns where it is asked for
    result = arviz.from_dict(posterior=chains) if before_1 else arviz.from_dict({"posterior": chains})
    group = result.posterior if before_1 else result["posterior"]
    for name, entries in variables.items():
        group[name].attrs.update(entries)
    group.attrs.update(attributes)
    return result


def grey_for_xarray(
    grey: NDArray[np.float64],
    *,
    axis_px: tuple[float, float],
    mm_per_pixel: tuple[float, float] | None,
    attributes: Mapping[str, Any],
) -> Any:
    """Grey levels as an array with the dimensions ``y`` and ``x``, in mm from the axis, in pixels without a scale."""
    xarray = import_extra("xarray", feature="an image for xarray", extra=EXTRA)
    unit, scale = ("px", (1.0, 1.0)) if mm_per_pixel is None else ("mm", mm_per_pixel)
    coordinates = {
        name: (
            name,
            (np.arange(grey.shape[number]) - axis_px[1 - number]) * scale[1 - number],
            {"units": unit, "long_name": f"{name} from the probe's axis"},
        )
        for number, name in enumerate(("y", "x"))
    }
    known = {} if mm_per_pixel is None else {"mm_per_pixel": list(mm_per_pixel)}
    return xarray.DataArray(
        np.array(grey),
        dims=("y", "x"),
        coords=coordinates,
        name="grey",
        attrs={"units": "grey level", "axis_px": list(axis_px), **known, **attributes},
    )
