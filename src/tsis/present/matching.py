"""Report of a registration: points, matches, grid, poses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tsis.matching.flags import MATCHING_FLAGS
from tsis.present.figures import alternative_pose, point_sets, warped_grid
from tsis.present.page import Card, Page, Picture, Table

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from matplotlib.figure import FigureBase
    from numpy.typing import NDArray

    from tsis.matching import Registration
    from tsis.matching.registration import Alternative, PointMatch

    Floats = NDArray[np.float64]


MOST_POSES = 4  # drawn side by side
SIDE_INCHES = 4.0


def registration_page(
    source: Floats,
    target: Floats,
    registration: Registration,
    *,
    title: str,
    provenance: Mapping[str, Any],
    shown: PointMatch | None,
) -> Page:
    """The report of a registration of points, shapes (n, d) and (m, d); ``provenance`` names its origin.

    ``shown`` is its match; None withholds it.
    """
    poses = registration.alternatives
    pictures = [
        Picture(
            title="Points and transform",
            draw=lambda figure: draw_registration(figure, source, target, registration, shown),
            size=(2 * SIDE_INCHES, SIDE_INCHES),
            alt="Both point sets before and after the transform, with correspondences and the warped grid",
            wide=True,
        )
    ]
    if poses:
        pictures.append(
            Picture(
                title="Poses that the data allow",
                draw=lambda figure: draw_poses(figure, target, poses),
                size=(SIDE_INCHES * max(min(len(poses), MOST_POSES), 2), SIDE_INCHES),
                alt="The source in each pose over the target, with its probability",
                caption="Probabilities are among the poses that were compared; the confidence allows for missed ones.",
                wide=True,
            )
        )
    rows = tuple((f"{pose.rotation_deg:.1f}", f"{pose.probability:.4g}") for pose in poses)
    return Page(
        title=title,
        subtitle=f"method {registration.method}",
        cards=(
            Card(
                title="Confidence",
                value=f"{registration.confidence:.4f}",
                detail="reliable" if registration.reliable else "not reliable",
                doubtful=not registration.reliable,
            ),
            Card(
                title="Matched points",
                value="withheld" if shown is None else f"{int((~shown.outliers).sum())} of {len(source)}",
                doubtful=not registration.reliable,
            ),
        ),
        notes=sentences(registration),
        pictures=tuple(pictures),
        tables=(Table(title="Poses", columns=("rotation / degrees", "probability"), values=rows),),
        provenance=provenance,
    )


def sentences(registration: Registration) -> tuple[str, ...]:
    """A sentence for each flag of a registration, with its cure."""
    return tuple(
        f"{note[:1].upper()}{note[1:]}; {MATCHING_FLAGS[flag].cure}."
        for flag, note in zip(registration.flags, registration.notes, strict=True)
    )


def draw_registration(
    figure: FigureBase, source: Floats, target: Floats, registration: Registration, shown: PointMatch | None
) -> None:
    """Draw both sets with their correspondences, and the transformed source with the warped grid, into a figure.

    Where the match is not ``shown``, both sets are drawn as they are.
    """
    if shown is None:
        title = f"no reliable match: confidence {registration.confidence:.3f}"
        point_sets(source, target, figure.subplots(**_axes(source))).set_title(title)
        return
    doubt = "" if registration.reliable else ", not reliable"
    before, after = figure.subplots(1, 2, **_axes(source))
    point_sets(source, target, before, matches=shown.matches).set_title(f"before, with the matches{doubt}")
    title = f"after {registration.method}{doubt}"
    point_sets(shown.moved, target, after, source_label="moved source").set_title(title)
    if source.shape[1] == 2:
        warped_grid(shown.transform, source, after)


def draw_poses(figure: FigureBase, target: Floats, poses: tuple[Alternative, ...]) -> None:
    """Draw the likeliest poses side by side into a figure."""
    shown = poses[:MOST_POSES]
    for pose, ax in zip(shown, figure.subplots(1, len(shown), squeeze=False, **_axes(target))[0], strict=True):
        alternative_pose(pose, target, ax)


def _axes(points: Floats) -> dict[str, Any]:
    return {"subplot_kw": {"projection": "3d"}} if points.shape[1] == 3 else {}
