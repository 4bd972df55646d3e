"""``tsis study kit`` and ``tsis study score``: the first physical validation, from the moulds to the score."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import tsis
from tsis.cli._options import AsJson
from tsis.cli._output import CommandOutcome, print_json, print_tables, publish, result_bytes, rich_tables

KIT_PAPER, KIT_FILE, MODULI = "kit.pdf", "kit.json", "modulus.csv"


def kit(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="New folder of the kit.")],
    *,
    as_json: AsJson = False,
) -> None:
    """Write the kit for a first physical validation: moulds, instructions and data sheets, tables to fill in.

    Moulds are STL files in mm. kit.pdf has recipe, phantoms, protocol and sheets; phantoms.csv the phantoms of the
    recipe, to be replaced by measured sizes; modulus.csv takes the bench tests; kit.json the hashes of all.
    """
    from tsis.report.paper import pdf
    from tsis.report.study import kit_document, kit_page
    from tsis.study.kit import kit_files

    files = {**kit_files(), KIT_PAPER: pdf(kit_page())}
    document = kit_document(files)
    written = tsis.report.write_folder(folder, {**files, KIT_FILE: result_bytes(document)})
    if as_json:
        print_json({**document, "folder": str(written)})
        return
    notes = (f"{len(files)} files and their hashes in {KIT_FILE}.", f"Begin with {KIT_PAPER}.")
    print_tables((), notes, where=f"Kit: {written}")


def score(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the kit, with modulus.csv filled in.")],
    *,
    study: Annotated[Path, typer.Option(help="Folder of the unblinded study.")],
    device: Annotated[str | None, typer.Option(help="Whose readings.", show_default="the first device's")] = None,
    poisson: Annotated[float, typer.Option(help="Poisson's ratio of the tested materials.")] = 0.49,
    diameter_sd: Annotated[float, typer.Option(help="Standard uncertainty of the sealed diameters, mm.")] = 0.0,
    depth_sd: Annotated[float, typer.Option(help="Standard uncertainty of the sealed depths, mm.")] = 0.0,
    out: Annotated[Path, typer.Option(help="Folder to write; a number is added when it exists.")] = Path("tsis-score"),
    as_json: AsJson = False,
) -> None:
    """Score a validation: readings against measured moduli, with intervals that held, bias and detection.

    The bench tests in modulus.csv replace the moduli that were sealed. Writes index.html, report.pdf and result.json.
    """
    from tsis.report.paper import pdf
    from tsis.report.study import PAPER, score_document, score_page
    from tsis.study.folder import open_study
    from tsis.study.kit import bench_moduli, score_validation

    opened = open_study(study)
    moduli = bench_moduli(folder / MODULI, poisson=poisson)
    result = score_validation(opened, moduli, device=device, diameter_sd_mm=diameter_sd, depth_sd_mm=depth_sd)
    page = score_page(result)
    outcome = CommandOutcome(
        document=score_document(result),
        page=tsis.report.html(page),
        tables=tuple(rich_tables(page.tables)),
        notes=page.notes,
        files={PAPER: pdf(page)},
    )
    publish(outcome, out, as_json=as_json)
