"""``tsis match A B``: register the points of one file to those of another."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape
from rich.table import Table

import tsis
from tsis.cli._options import AsJson
from tsis.cli._output import leave, people, print_json, print_notice
from tsis.cli._progress import waiting
from tsis.errors import FileInputError, InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tsis.matching import Registration


def points(
    source: Annotated[Path, typer.Argument(metavar="A", help="Source points: CSV, NPY or PLY.")],
    target: Annotated[Path, typer.Argument(metavar="B", help="Target points: CSV, NPY or PLY.")],
    *,
    method: Annotated[str, typer.Option(help="One of tprl, cpd, tps-rpm, rpm-lns, shape-context.")] = "tprl",
    out: Annotated[
        Path | None, typer.Option(help="New CSV file for the transformed points, their matches and confidences.")
    ] = None,
    figure: Annotated[Path | None, typer.Option(help="New PNG file for a picture of before and after.")] = None,
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="Seed of the method, where it is random.")] = 0,
    as_json: AsJson = False,
) -> None:
    """Match the points of two files and transform the first onto the second.

    Files contain two or three coordinates per line, with or without a header. Matches are row numbers from 0; -1 is
    none.
    """
    import numpy as np

    tsis.model.require_one_of("method", method, tsis.matching.METHODS)
    for file in (out, figure):
        _refuse_existing(file)
    if out is not None and out == figure:
        raise InputError(f"--out and --figure must be two files; got {tsis.files.printable_path(out)} for both")
    first, second = tsis.matching.read_points(source), tsis.matching.read_points(target)
    if first.shape[1] != second.shape[1]:
        raise InputError(
            f"both files must contain points of the plane or both of space; got {first.shape[1]} coordinates in "
            f"{tsis.files.printable_path(source)} and {second.shape[1]} in {tsis.files.printable_path(target)}"
        )
    with waiting("matching"):
        result = tsis.matching.register(first, second, method=method, rng=np.random.default_rng(seed))
    transformed, matches = np.asarray(result.moved), np.asarray(result.matches)
    if out is not None:
        _write(out, tsis.matching.csv_text(transformed, match=matches, trust=result.trust).encode())
    if figure is not None:
        _write(figure, _picture(first, second, result, method))
    _result(source, target, first, second, result, method, seed, (out, figure), as_json=as_json)


def _result(
    source: Path,
    target: Path,
    first: NDArray[np.float64],
    second: NDArray[np.float64],
    registration: Registration,
    method: str,
    seed: int,
    files: tuple[Path | None, Path | None],
    *,
    as_json: bool,
) -> None:
    import numpy as np

    matches = np.asarray(registration.matches)
    paired = matches != tsis.matching.UNMATCHED
    before, after = (
        _rms_distance(item[paired], second[matches[paired]]) for item in (first, np.asarray(registration.moved))
    )
    if as_json:
        names = {"out": files[0], "figure": files[1]}
        document = tsis.report.envelope(
            "match",
            method=method,
            seed=seed,
            source={"name": tsis.files.printable_name(source), "points": len(first)},
            target={"name": tsis.files.printable_name(target), "points": len(second)},
            matched=int(paired.sum()),
            rms_before=before,
            rms_after=after,
            confidence=registration.confidence,
            reliable=registration.reliable,
            alternatives=[
                {"rotation_deg": pose.rotation_deg, "probability": pose.probability, "moved": pose.moved}
                for pose in registration.alternatives
            ],
            matches=matches,
            trust=registration.trust,
            moved=registration.moved,
            notes=list(registration.notes),
        )
        print_json(document | {name: str(file) for name, file in names.items() if file is not None})
        leave(trusted=registration.reliable)
        return
    console = people()
    sets = ((source, first), (target, second))
    title = escape(" to ".join(f"{tsis.files.printable_name(file)} ({len(points)} points)" for file, points in sets))
    table = Table("quantity", "value", title=title)
    table.add_row("method", method)
    table.add_row("matched points", f"{paired.sum()} of {len(first)}")
    table.add_row("RMS distance of matched points, before", "-" if before is None else f"{before:.4g}")
    table.add_row("RMS distance of matched points, after", "-" if after is None else f"{after:.4g}")
    table.add_row(
        "confidence", f"{registration.confidence:.2f}, {'reliable' if registration.reliable else 'not reliable'}"
    )
    console.print(table)
    for note in registration.notes:
        console.print(f"- {note}", markup=False)
    for file in files:
        if file is not None:
            console.print(f"Written: {file}", soft_wrap=True, markup=False)
    print_notice(console)
    leave(trusted=registration.reliable)


def _rms_distance(points: NDArray[np.float64], others: NDArray[np.float64]) -> float | None:
    import numpy as np

    return float(np.sqrt(((points - others) ** 2).sum(axis=1).mean())) if len(points) else None


def _picture(first: NDArray[np.float64], second: NDArray[np.float64], registration: Registration, method: str) -> bytes:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 6.0), layout="constrained")
    before, after = figure.subplots(1, 2, subplot_kw={"projection": "3d"} if first.shape[1] == 3 else {})
    tsis.plots.point_sets(first, second, before, matches=registration.matches).set_title("before, with the matches")
    tsis.plots.point_sets(registration.moved, second, after, source_label="moved source").set_title(f"after {method}")
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=120)
    return buffer.getvalue()


def _refuse_existing(file: Path | None) -> None:
    if file is not None and file.exists():
        raise FileInputError(
            f"{tsis.files.printable_path(file)} must be new, so that nothing is overwritten; it exists (choose another)"
        )


def _write(file: Path, content: bytes) -> None:
    try:
        tsis.files.write_durably(file, content)
    except OSError as error:
        raise FileInputError(
            f"{tsis.files.printable_path(file)} must be writable; got: {error.strerror or error}"
        ) from error
