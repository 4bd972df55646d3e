"""Report of one estimate of an inclusion."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

from tsis.imaging import features, radial_profile, subtract_background, surface
from tsis.plots import marginal, relief, ring_profile, tactile_image, trade_off
from tsis.report.document import LEVEL, doubt_of
from tsis.report.page import Card, Page, Picture, html, picture_source

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from tsis.inclusion import InclusionPrior
    from tsis.model import Estimate, TactileImage

TITLES = {"diameter_mm": ("Diameter d", "mm"), "depth_mm": ("Depth h", "mm"), "young_kpa": ("Modulus E", "kPa")}


def inclusion_report(
    estimate: Estimate,
    *,
    title: str,
    subtitle: str,
    target: TactileImage,
    reference: TactileImage | None,
    prior: InclusionPrior,
    ring_edges_mm: NDArray[np.float64],
    truth: Mapping[str, float] | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> bytes:
    """One HTML page: images, surface, posterior with the truth if known, and where all of it came from.

    Parameters
    ----------
    estimate
        What was estimated.
    title, subtitle
        Heading of the page.
    target, reference
        The press on the target, and the one on plain tissue if there was one.
    prior
        Ranges that the posteriors are drawn in.
    ring_edges_mm
        Rings of the profile.
    truth
        True parameters of a virtual phantom.
    provenance
        Anything to add to the estimate's own provenance.
    """
    return html(
        Page(
            title=title,
            subtitle=subtitle,
            cards=tuple(_card(estimate, name, truth) for name in estimate.samples),
            notes=(estimate.identifiability, *estimate.notes, _presence(estimate), f"Prior: {estimate.prior}."),
            pictures=(
                _marginals_picture(estimate, prior, truth),
                *_image_pictures(target, reference),
                _profile_picture(target, reference, ring_edges_mm),
                _trade_off_picture(estimate, truth),
            ),
            provenance={**(provenance or {}), **estimate.provenance},
        )
    )


def _card(estimate: Estimate, name: str, truth: Mapping[str, float] | None) -> Card:
    heading, unit = TITLES[name]
    low, high = estimate.interval(LEVEL)[name]
    interval, doubt = f"{low:.3g} to {high:.3g} {unit}", doubt_of(estimate, name)
    known = "" if truth is None else f"; truth {truth[name]:.3g} {unit}"
    value = {"": f"{estimate.mean[name]:.3g} {unit}", "not identified": interval}.get(doubt, doubt)
    return Card(
        title=heading,
        value=value,
        detail=f"{doubt or '90 % interval ' + interval}; {_spreads(estimate, name, unit)}{known}",
        doubtful=bool(doubt),
    )


def _spreads(estimate: Estimate, name: str, unit: str) -> str:
    """How wide the posterior is, the prior was, and any unbiased estimate has to be."""
    bound = estimate.cramer_rao_sd.get(name, float("inf"))
    return f"sd {estimate.sd[name]:.2g} of prior {estimate.prior_sd[name]:.2g} {unit}, bound {bound:.2g}"


def _presence(estimate: Estimate) -> str:
    return "" if estimate.presence is None else f"Probability that there is an inclusion: {estimate.presence:.3g}."


def _marginals_picture(estimate: Estimate, prior: InclusionPrior, truth: Mapping[str, float] | None) -> Picture:
    def marginals(figure: Figure) -> None:
        axes = figure.subplots(1, len(estimate.samples))
        for name, ax in zip(estimate.samples, axes, strict=True):
            known = None if truth is None else truth[name]
            marginal(estimate, name, ax, prior_range=getattr(prior, name), truth=known)
        axes[0].legend(frameon=False, fontsize=8)

    intervals = estimate.interval(LEVEL)
    words = ", ".join(f"{name} {low:.3g} to {high:.3g}" for name, (low, high) in intervals.items())
    marked = "" if truth is None else " The dashed line is the truth."
    return Picture(
        title="What the press told",
        source=picture_source(marginals, size=(9.5, 2.8)),
        alt=f"Posterior of each parameter, 90 % intervals: {words}",
        caption=f"Posterior (blue) against the uniform prior (grey), 90 % interval shaded.{marked}",
        wide=True,
    )


def _trade_off_picture(estimate: Estimate, truth: Mapping[str, float] | None) -> Picture:
    def pairs(figure: Figure) -> None:
        names = list(itertools.combinations(estimate.samples, 2))
        for pair, ax in zip(names, figure.subplots(1, len(names)), strict=True):
            trade_off(estimate, pair, ax, truth=None if truth is None else (truth[pair[0]], truth[pair[1]]))

    marked = "" if truth is None else " The cross is the truth."
    return Picture(
        title="Which parameters trade off",
        source=picture_source(pairs, size=(9.5, 3.0)),
        alt="Joint posterior of each pair of parameters",
        caption=f"Joint posteriors: a slanted band is a combination that is known better than its parts.{marked}",
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
            source=picture_source(frame, size=(6.0, 4.0)),
            alt=f"Tactile image of {target.name}, bright where the pressure is high",
            caption=f"{target.name}, {target.force_n:g} N. Bright is high pressure; the rim is the edge of the face.",
        )
    ]
    if reference is not None:
        pictures.append(
            Picture(
                title="What the inclusion adds",
                source=picture_source(change, size=(6.0, 4.0)),
                alt="Target minus reference press, with the outline and the centroid of the bright patch",
                caption="Target minus reference press on plain tissue; outline and centroid in white.",
            )
        )
    pictures.append(
        Picture(
            title="Surface",
            source=picture_source(lifted, size=(6.0, 4.2), vector=False),
            alt="The same signal as a surface in three dimensions",
            caption="The same as a surface; heights are grey levels, not millimetres.",
        )
    )
    return tuple(pictures)


def _profile_picture(target: TactileImage, reference: TactileImage | None, edges: NDArray[np.float64]) -> Picture:
    def profiles(figure: Figure) -> None:
        ax = figure.subplots()
        ring_profile(radial_profile(target, edges_mm=edges), ax, label="target")
        if reference is not None:
            ring_profile(radial_profile(reference, edges_mm=edges), ax, label="plain tissue", marker="s")
        ax.legend(frameon=False)

    return Picture(
        title="The profile that the estimate rests on",
        source=picture_source(profiles, size=(5.5, 3.6)),
        alt="Mean grey level in rings around the probe's axis",
        caption="Mean grey level in rings around the probe's axis.",
    )
