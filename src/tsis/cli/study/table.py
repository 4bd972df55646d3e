"""``tsis study import`` and ``tsis study export``: readings of other devices as a table, in and out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tsis.cli.console_output import people, print_json, print_notice
from tsis.cli.study.chosen import StudyFolder
from tsis.cli.targets import AsJson
from tsis.report.document import envelope

TableFile = Annotated[Path, typer.Argument(metavar="READINGS.csv", help="Comma-separated values in UTF-8.")]


def import_(
    folder: StudyFolder,
    readings: TableFile,
    *,
    device: Annotated[str, typer.Option(help="Name of the device that read them.")],
    threshold: Annotated[
        float | None,
        typer.Option(help="From which score on it calls an inclusion; fixed from now on.", show_default="the study's"),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Enter readings of another device: code, score, operator, repeat, diameter_mm, depth_mm, young_kpa.

    All of them or none. An empty score is a reading without an answer; the last three may be empty.
    """
    from tsis.study import import_readings, open_study

    study = open_study(folder)
    after = import_readings(study, readings, device=device, threshold=threshold)
    entered = len(after.readings) - len(study.readings)
    if as_json:
        told = {"folder": str(folder.resolve()), "device": device, "threshold": after.threshold_of(device)}
        print_json(envelope("study import", **told, entered=entered, head=after.chain.head))
        return
    console = people()
    console.print(
        f"{entered} readings of {device} entered; threshold {after.threshold_of(device):g}, fixed from now on.",
        markup=False,
    )
    print_notice(console)


def export(
    folder: StudyFolder,
    readings: TableFile,
    *,
    device: Annotated[str | None, typer.Option(help="Whose readings.", show_default="the only device's")] = None,
    as_json: AsJson = False,
) -> None:
    """Write the readings of a device as a table, without anything of the truth."""
    from tsis.records.export.whole import export_file
    from tsis.study import export_readings, open_study

    content = export_readings(open_study(folder), device)
    with export_file(readings) as draft:
        draft.write_bytes(content)
    if as_json:
        print_json(envelope("study export", file=str(readings.resolve())))
        return
    console = people()
    console.print(f"Readings: {readings.resolve()}", markup=False, soft_wrap=True)
    print_notice(console)
