"""A pressed thin guide from its side: its layers, the light in it, and what leaves through the pressed face."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage

    from tsis.optics import Propagation

FAINTEST_DB = -30.0


def guide_index(result: Propagation, ax: Axes) -> Axes:
    """Draw the refractive index, the pressed face on top, with a colour bar."""
    shown = _map(result, result.index.T, ax, cmap="YlGnBu")
    _bar(shown, ax, "refractive index")
    return ax


def guide_light(result: Propagation, ax: Axes) -> Axes:
    """Draw the mean intensity of the launched modes in decibels below its largest, and the borders of the layers."""
    brightest = result.intensity.max()
    decibels = 10 * np.log10(np.maximum(result.intensity / brightest, 10 ** (FAINTEST_DB / 10)))
    shown = _map(result, decibels.T, ax, cmap="inferno", vmin=FAINTEST_DB, vmax=0.0)
    _bar(shown, ax, "intensity / dB")
    for interface in result.interfaces_um.T:
        ax.plot(result.z_um, interface, color="white", linewidth=0.5, alpha=0.6)
    return ax


def light_out_of_the_top(results: Iterable[Propagation], ax: Axes) -> Axes:
    """Draw the mean share of the light that leaves through the pressed side a µm, along the guide, for each dent."""
    for result in results:
        total = abs(round(100 * result.powers.top.mean(), 1))  # no minus before nothing
        whole = slice(1, -1)
        ax.plot(
            result.z_um[whole],
            100 * result.top_per_um[whole].mean(axis=1),
            label=f"{result.dent.depth_um:g} µm deep: {total} % in all",
        )
    ax.set(xlabel="distance from the dent's middle / µm", ylabel="light out of the top / (% / µm)")
    ax.set_ylim(top=1.6 * ax.get_ylim()[1])  # room for the legend
    ax.legend(title="dent", loc="upper left")
    ax.grid(visible=True, alpha=0.3)
    return ax


def _map(result: Propagation, values: np.ndarray, ax: Axes, **style: object) -> AxesImage:
    left, right, top, bottom = result.z_um[0], result.z_um[-1], result.x_um[0], result.x_um[-1]
    shown = ax.imshow(values, extent=(left, right, bottom, top), aspect="auto", interpolation="nearest", **style)  # type: ignore[arg-type]
    ax.set(xlabel="distance from the dent's middle / µm", ylabel="depth / µm", xlim=(left, right), ylim=(bottom, top))
    return shown


def _bar(shown: AxesImage, ax: Axes, label: str) -> None:
    ax.figure.colorbar(shown, ax=ax, label=label, pad=0.01)
