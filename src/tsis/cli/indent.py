"""``tsis indent``: Young's modulus from curves of force over depth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

import tsis
from tsis.__about__ import LARGEST_SEED, RESEARCH_USE_ONLY, __version__
from tsis.cli.options import AsJson, typed_options
from tsis.cli.output import leave, print_json
from tsis.cli.progress import progress_bar
from tsis.errors import InputError
from tsis.present.terminal import print_page

OF_BALL_OR_PUNCH, OF_CONE, OF_LAYER = ("radius_mm",), ("half_angle_deg",), ("base", "thickness_sd")


def indent(
    context: typer.Context,
    files: Annotated[
        list[Path],
        typer.Argument(help="Curves: CSV or text with units in its headings, Chiaro text or ZIP, JPK files and maps."),
    ],
    *,
    radius_mm: Annotated[
        float | None,
        typer.Option("--radius-mm", help="Radius of ball or punch, 1e-5 to 50.", show_default="the file's"),
    ] = None,
    indenter: Annotated[str, typer.Option(help="ball, punch (flat) or cone.")] = "ball",
    half_angle_deg: Annotated[
        float | None, typer.Option("--half-angle-deg", help="Of a cone, between axis and side.")
    ] = None,
    thickness_mm: Annotated[
        float | None, typer.Option("--thickness-mm", help="Of the sample; left out: thick.")
    ] = None,
    base: Annotated[str, typer.Option(help="The sample is bonded to its base, or sliding on it.")] = "bonded",
    poisson: Annotated[str, typer.Option(help="Poisson's ratio: one number, or least,greatest.")] = "0.48,0.5",
    compliance_mm_per_n: Annotated[
        float, typer.Option("--compliance-mm-per-n", help="How far the machine bends.")
    ] = 0.0,
    force_sd: Annotated[float, typer.Option(help="Relative sd of the force's scale or the spring constant.")] = 0.01,
    radius_sd: Annotated[float, typer.Option(help="Relative sd of the radius.")] = 0.01,
    thickness_sd: Annotated[float, typer.Option(help="Relative sd of the thickness.")] = 0.02,
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Of the samples.")] = 0,
    page: Annotated[Path | None, typer.Option("--html", help="Page with the curves to write.")] = None,
    as_json: AsJson = False,
) -> None:
    """Estimate Young's modulus from curves of force over depth, with its interval; one row a curve.

    The exit code is 3 where no curve gives a trusted modulus.
    """
    if page is not None:
        tsis.files.result_folder.require_absent(page)
    _require_options_that_count(context, indenter, thick=thickness_mm is None)
    options: dict[str, Any] = {
        "radius_mm": radius_mm, "indenter": indenter, "half_angle_deg": half_angle_deg, "thickness_mm": thickness_mm,
        "base": base, "poisson": _poisson(poisson), "compliance_mm_per_n": compliance_mm_per_n, "force_sd": force_sd,
        "radius_sd": radius_sd, "thickness_sd": thickness_sd, "seed": seed,
    }  # fmt: skip
    curves = [curve for path in files for curve in tsis.hardness.curve_files.read_curves(path)]
    estimates = []
    with progress_bar("fitting curves") as advance:
        for number, curve in enumerate(curves, start=1):
            estimates.append(tsis.hardness.indentation(curve, **options))
            advance(number, len(curves))
    provenance = {"notice": RESEARCH_USE_ONLY, "tsis": __version__, "options": {**options, "poisson": poisson}}
    shown = tsis.present.indentation.indentation_page(estimates, provenance=provenance)
    if page is not None:
        tsis.files.atomic.write_durably(page, tsis.present.html.html_bytes(shown))
    if as_json:
        results = [
            {
                "curve": tsis.present.indentation.curve_name(estimate),
                "estimate": tsis.present.document.estimate_document(estimate, None),
            }
            for estimate in estimates
        ]
        print_json(tsis.present.document.envelope("indent", curves=results, provenance=provenance))
    else:
        print_page(shown, where="" if page is None else f"Page: {page}")
    leave(trusted=any(estimate.trusted for estimate in estimates))


def _require_options_that_count(context: typer.Context, indenter: str, *, thick: bool) -> None:
    """`InputError` for an option that this indenter, or a thick sample, would ignore."""
    tsis.model.require.require_one_of("indenter", indenter, tsis.mechanics.layer_indentation.INDENTERS)
    of_others = OF_BALL_OR_PUNCH if indenter == "cone" else OF_CONE
    for option in typed_options(context, of_others):
        raise InputError(f"{option} must be left out with --indenter {indenter}, which has none (or name the other)")
    for option in typed_options(context, OF_LAYER if thick else ()):
        raise InputError(f"{option} must be given with --thickness-mm, without which the sample is thick; add it")


def _poisson(text: str) -> tuple[float, float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (1, 2):
        raise InputError(name="--poisson", requirement="must be one number or two with a comma", value=f"{text!r:.40}")
    return numbers[0], numbers[-1]
