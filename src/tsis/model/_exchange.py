"""Posteriors for ArviZ and grey levels for xarray, with the extra ``analysis``."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import import_extra

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray


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
