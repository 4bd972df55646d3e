"""Report of one estimate of an inclusion."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.imaging import features, radial_profile, subtract_background, surface
from tsis.plots import marginal, relief, ring_profile, tactile_image, trade_off
from tsis.report.document import LEVEL, doubt_of, sentences, shown_probability, spread
from tsis.report.page import Card, Page, Picture, html

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from tsis.inclusion import InclusionPrior
    from tsis.model import Estimate, TactileImage

LIKELY = 0.95  # probability of an inclusion from which nobody need doubt it
TITLES = {"diameter_mm": ("Diameter d", "mm"), "depth_mm": ("Depth h", "mm"), "young_kpa": ("Modulus E", "kPa")}


def inclusion_report(
    estimate: Estimate,
    *,
    title: str,
    subtitle: str,
    targets: Sequence[TactileImage],
    references: Sequence[TactileImage],
    prior: InclusionPrior,
    ring_edges_mm: NDArray[np.float64],
    truth: Mapping[str, float] | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> bytes:
    """One HTML page: images, surface, posterior with the truth if known, and where all of it came from.

    Pictures show the target of the highest force and the reference nearest to it; the profiles are those of all frames.

    Parameters
    ----------
    estimate
        What was estimated.
    title, subtitle
        Heading of the page.
    targets, references
        The presses on the target, at least one, and those on plain tissue, each of known force.
    prior
        Ranges that the posteriors are drawn in.
    ring_edges_mm
        Rings of the profile.
    truth
        True parameters of a virtual phantom.
    provenance
        Anything to add to the estimate's own provenance.
    """
    target, reference = _shown(targets, references)
    return html(
        Page(
            title=title,
            subtitle=subtitle,
            cards=(*(_card(estimate, name, truth) for name in estimate.samples), *_presence_card(estimate)),
            notes=sentences(estimate),
            pictures=(
                _marginals_picture(estimate, prior, truth),
                *_image_pictures(target, reference),
                _profile_picture(targets, references, ring_edges_mm),
                _trade_off_picture(estimate, truth),
            ),
            provenance={**(provenance or {}), **estimate.provenance},
        )
    )


def _shown(
    targets: Sequence[TactileImage], references: Sequence[TactileImage]
) -> tuple[TactileImage, TactileImage | None]:
    """The target of the highest force, and the reference whose force is nearest."""
    target = max(targets, key=_force)
    return target, min(references, key=lambda frame: abs(_force(frame) - _force(target)), default=None)


def _force(frame: TactileImage) -> float:
    return frame.force_n or 0.0


def _card(estimate: Estimate, name: str, truth: Mapping[str, float] | None) -> Card:
    heading, unit = TITLES[name]
    known = [] if truth is None else [f"truth {truth[name]:.3g} {unit}"]
    doubt = doubt_of(estimate, name)
    if not estimate.trusted:
        return Card(title=heading, value=doubt, detail="; ".join(known), doubtful=True)
    low, high = estimate.interval(LEVEL)[name]
    interval = f"{low:.3g} to {high:.3g} {unit}"
    value = interval if doubt else f"{estimate.mean[name]:.3g} {unit}"
    detail = [doubt or f"90 % interval {interval}", _spreads(estimate, name, unit), *known]
    return Card(title=heading, value=value, detail="; ".join(detail), doubtful=bool(doubt))


def _spreads(estimate: Estimate, name: str, unit: str) -> str:
    """How wide the posterior is, the prior was, and any unbiased estimate has to be."""
    bound = estimate.cramer_rao_sd.get(name, float("inf"))
    limit = f", Cramér-Rao bound {spread(bound)}" if np.isfinite(bound) else ""
    return f"sd {spread(estimate.sd[name])} {unit} (prior {spread(estimate.prior_sd[name])}{limit})"


def _presence_card(estimate: Estimate) -> tuple[Card, ...]:
    if estimate.presence is None:
        return ()
    return (
        Card(
            title="Is there an inclusion?",
            value=shown_probability(estimate.presence),
            detail="probability of an inclusion over plain tissue",
            doubtful=estimate.presence < LIKELY,
        ),
    )


def _marginals_picture(estimate: Estimate, prior: InclusionPrior, truth: Mapping[str, float] | None) -> Picture:
    def marginals(figure: Figure) -> None:
        axes = figure.subplots(1, len(estimate.samples))
        for name, ax in zip(estimate.samples, axes, strict=True):
            known = None if truth is None else truth[name]
            marginal(estimate, name, ax, prior_range=getattr(prior, name), truth=known)
        axes[0].legend(frameon=False, fontsize=8)

    intervals = estimate.interval(LEVEL) if estimate.trusted else {}
    words = ", ".join(f"{name} {low:.3g} to {high:.3g}" for name, (low, high) in intervals.items())
    doubt = "" if estimate.trusted else "Not to be trusted. "
    marked = "" if truth is None else " The dashed line is the truth."
    return Picture(
        title="What the presses told",
        draw=marginals,
        size=(9.5, 2.8),
        alt=f"Posterior of each parameter, 90 % intervals: {words or 'not to be trusted'}",
        caption=f"{doubt}Posterior (blue) against the uniform prior (grey), 90 % interval shaded.{marked}",
        wide=True,
    )


def _trade_off_picture(estimate: Estimate, truth: Mapping[str, float] | None) -> Picture:
    def pairs(figure: Figure) -> None:
        names = list(itertools.combinations(estimate.samples, 2))
        for pair, ax in zip(names, figure.subplots(1, len(names)), strict=True):
            trade_off(estimate, pair, ax, truth=None if truth is None else (truth[pair[0]], truth[pair[1]]))

    doubt = "" if estimate.trusted else "Not to be trusted. "
    marked = "" if truth is None else " The cross is the truth."
    return Picture(
        title="Which parameters trade off",
        draw=pairs,
        size=(9.5, 3.0),
        alt="Joint posterior of each pair of parameters",
        caption=f"{doubt}Joint posteriors: a slanted band is a combination known better than its parts.{marked}",
        wide=True,
    )


def _image_pictures(target: TactileImage, reference: TactileImage | None) -> tuple[Picture, ...]:
    signal = target if reference is None else subtract_background(target, reference)
    found = features(signal) if reference is not None else None

    def frame(figure: Figure) -> None:
        tactile_image(target, figure.subplots())

    def change(figure: Figure) -> None:
        tactile_image(signal, figure.subplots(), found=found, low=0.0)

    def lifted(figure: Figure) -> None:
        relief(surface(signal, max_points=96), figure.add_subplot(projection="3d"))

    pictures = [
        Picture(
            title="Tactile image",
            draw=frame,
            size=(6.0, 4.0),
            alt=f"Tactile image of {target.name}, bright where the pressure is high",
            caption=f"{target.name}, {target.force_n:g} N. Bright is high pressure; the rim is the edge of the face.",
        )
    ]
    if reference is not None:
        pictures.append(
            Picture(
                title="What the inclusion adds",
                draw=change,
                size=(6.0, 4.0),
                alt="Target minus reference press, with the outline and the centroid of the bright patch",
                caption="Target minus reference press on plain tissue; outline and centroid in white.",
            )
        )
    pictures.append(
        Picture(
            title="Surface",
            draw=lifted,
            size=(6.0, 4.2),
            vector=False,
            alt="The same signal as a surface in three dimensions",
            caption="The same as a surface; heights are grey levels, not millimetres.",
        )
    )
    return tuple(pictures)


def _profile_picture(
    targets: Sequence[TactileImage], references: Sequence[TactileImage], edges: NDArray[np.float64]
) -> Picture:
    def profiles(figure: Figure) -> None:
        ax = figure.subplots()
        for frames, what, marker in ((targets, "target", "o"), (references, "plain tissue", "s")):
            for frame in sorted(frames, key=_force, reverse=True):
                profile = radial_profile(frame, edges_mm=edges)
                ring_profile(profile, ax, label=f"{what}, {_force(frame):g} N", marker=marker)
        ax.legend(frameon=False)

    return Picture(
        title="The profiles that the estimate rests on",
        draw=profiles,
        size=(5.5, 3.6),
        alt="Mean grey level in rings around the probe's axis, one line a press",
        caption="Mean grey level in rings around the probe's axis, one line a press.",
    )
