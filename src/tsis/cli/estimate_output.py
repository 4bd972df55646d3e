"""An estimate of an inclusion, made with a progress bar and shown as a table."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.markup import escape
from rich.table import Table

from tsis.cli.progress import progress_bar
from tsis.inclusion import InclusionPrior, estimate
from tsis.mechanics import build_full_contact_surrogate
from tsis.model.estimate import INTERVAL_LEVEL
from tsis.report.document import sd_text, withheld_reason

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from tsis.model import Calibration, Estimate, Probe, TactileImage


def estimate_with_progress(
    images: Sequence[TactileImage],
    *,
    probe: Probe,
    calibration: Calibration,
    reference: Sequence[TactileImage],
    prior: InclusionPrior,
) -> Estimate:
    """Estimate; the first time for a probe its surrogate is built, which takes seconds and is kept."""
    with progress_bar("solving the press for this probe (kept for next time)") as progress:
        build_full_contact_surrogate(probe, prior.box(), progress=progress)
    return estimate(images, probe=probe, calibration=calibration, reference=reference, prior=prior)


def estimate_table(result: Estimate, *, title: str, truth: Mapping[str, float] | None = None) -> Table:
    """Mean, interval, and what the data narrowed and could at best narrow, with the truth if known."""
    headings = ["", "mean", "90 %\ninterval", "sd", "prior\nsd", "bound\non sd"] + ([] if truth is None else ["truth"])
    table = Table(title=escape(title))
    for heading in headings:
        table.add_column(heading, justify="right" if heading else "left", no_wrap=not heading)
    for name in result.samples:
        table.add_row(name, *_numbers(result, name), *([] if truth is None else [f"{truth[name]:.3g}"]))
    return table


def _numbers(result: Estimate, name: str) -> tuple[str, ...]:
    """Cells of one parameter; of an estimate that is not to be trusted only what was believed before."""
    prior_sd = sd_text(result.prior_sd[name])
    if not result.trusted:
        return withheld_reason(result, name), "", "", prior_sd, ""
    low, high = result.interval(INTERVAL_LEVEL)[name]
    bound = result.cramer_rao_sd.get(name)  # of a hardness nobody computes it
    return (
        withheld_reason(result, name) or f"{result.mean[name]:.3g}",
        f"{low:.3g} to {high:.3g}",
        sd_text(result.sd[name]),
        prior_sd,
        "" if bound is None else sd_text(bound),
    )
