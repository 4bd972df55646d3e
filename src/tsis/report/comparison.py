"""Two frames beside each other: the same colours for both, what differs, and the features of each."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.imaging import match_light, subtract_background
from tsis.model.errors import TsisError
from tsis.plots import tactile_image
from tsis.report.contact import analyse_image, finding_rows
from tsis.report.page import Page, Picture, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tsis.model import TactileImage

SIZE = (4.4, 3.0)
DIVERGING = "RdBu_r"  # blue to red through white, which those see apart who do not tell red from green
NO_VALUE = "none"


def comparison(one: TactileImage, other: TactileImage, *, same_light: bool = False) -> Page:
    """Two frames, what differs between them, and what each says of its contact.

    Parameters
    ----------
    one, other
        Frames as the camera gave them, each with a name.
    same_light
        Whether to bring the second to the brightness of the first before it is taken away
        (`tsis.imaging.match_light`).

    Returns
    -------
    Page
        Both in one colour map, the first minus the second where they can be subtracted (a sentence says why where they
        cannot), and a table of features.
    """
    top = float(max(one.grey.max(), other.grey.max()))
    pictures = [_frame(one, top), _frame(other, top)]
    notes: list[str] = []
    try:
        change = subtract_background(one, match_light(other, one) if same_light else other)
    except TsisError as error:
        notes.append(f"These two cannot be subtracted: {error}.")
    else:
        pictures.append(_difference(change, one, other))
        notes.append(_said(change, same_light=same_light))
    return Page(
        title=f"{one.name} compared with {other.name}",
        subtitle="",
        pictures=tuple(pictures),
        notes=tuple(notes),
        tables=(_features(one, other),),
    )


def _frame(image: TactileImage, top: float) -> Picture:
    def draw(figure: Figure) -> None:
        tactile_image(image, figure.subplots(), low=0.0, high=top)

    force = "force not measured" if image.force_n is None else f"{image.force_n:g} N"
    return Picture(
        title=image.name,
        draw=draw,
        size=SIZE,
        alt=f"Frame of {image.name}, bright where the pressure is high",
        caption=f"{force}. Both frames in one colour map.",
        vector=False,
    )


def _difference(change: TactileImage, one: TactileImage, other: TactileImage) -> Picture:
    reach = float(np.abs(change.grey).max()) or 1.0

    def draw(figure: Figure) -> None:
        ax = figure.subplots()
        tactile_image(change, ax, low=-reach, high=reach, label="grey levels", colours=DIVERGING, ink="black")

    return Picture(
        title="Difference",
        draw=draw,
        size=SIZE,
        alt=f"{one.name} minus {other.name}: red where the first is brighter, blue where the second is",
        caption="The first minus the second: red where the first is brighter, blue where the second is.",
        vector=False,
    )


def _said(change: TactileImage, *, same_light: bool) -> str:
    grey = change.grey
    light = "; the second was brought to the brightness of the first" if same_light else ""
    return (
        f"Difference in grey levels: mean {grey.mean():.3g}, root mean square {np.sqrt(np.square(grey).mean()):.3g}, "
        f"from {grey.min():.4g} to {grey.max():.4g}{light}."
    )


def _features(one: TactileImage, other: TactileImage) -> Table:
    """Names of the features of either, and the value of each."""
    found = [dict(finding_rows(analyse_image(image, None, invert=False))) for image in (one, other)]
    names = list(dict.fromkeys([*found[0], *found[1]]))
    rows = tuple((name, *(each.get(name, NO_VALUE) for each in found)) for name in names)
    return Table(title="Features", headings=("quantity", one.name, other.name), rows=rows)
