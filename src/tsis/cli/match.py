"""``tsis match A B``: register the points of one file to those of another."""

from __future__ import annotations

import io
import itertools
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import tsis
from tsis.cli.options import AsJson
from tsis.cli.output import leave, print_json
from tsis.cli.progress import waiting
from tsis.errors import FileInputError, InputError
from tsis.present.page import Table
from tsis.present.terminal import print_tables

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

    from tsis.matching import Registration
    from tsis.matching.registration import PointMatch


def match(
    source: Annotated[Path, typer.Argument(metavar="A", help="Source points: CSV, NPY, PLY or an image.")],
    target: Annotated[Path, typer.Argument(metavar="B", help="Target points: CSV, NPY, PLY or an image.")],
    *,
    method: Annotated[str, typer.Option(help="One of tprl, cpd, bcpd, tps-rpm, rpm-lns, shape-context.")] = "tprl",
    out: Annotated[
        Path | None, typer.Option(help="New CSV file for the transformed points, their matches and confidences.")
    ] = None,
    figure: Annotated[
        Path | None, typer.Option(help="New PNG file: points, correspondences, warped grid and alternative poses.")
    ] = None,
    html: Annotated[Path | None, typer.Option(help="New HTML page with the same and the probabilities.")] = None,
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="Seed of the method, where it is random.")] = 0,
    untrusted: Annotated[
        bool, typer.Option("--untrusted", help="Give the most probable match also where it is not reliable.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Match the points of two files and transform the first onto the second.

    Files contain two or three coordinates per line, with or without a header; of an image the contours are matched.
    Matches are row numbers from 0; -1 is none. A match that is not reliable is withheld, with reasons, cures and the
    possible poses, unless --untrusted is given.
    """
    import numpy as np

    if method not in tsis.matching.registration.METHODS:
        tsis.model.require.require_one_of(
            "method", method, (*tsis.matching.registration.METHODS, *tsis.plugins.find_plugins("matching"))
        )
    files = {"out": out, "figure": figure, "html": html}
    for file in files.values():
        _refuse_existing(file)
    for (name, file), (other, second_file) in itertools.combinations(files.items(), 2):
        if file is not None and file == second_file:
            raise InputError(
                f"--{name} and --{other} must be two files; got {tsis.files.reading.printable_path(file)} for both"
            )
    first, second = tsis.matching.point_files.read_pair(source, target)
    with waiting("matching"):
        result = tsis.matching.register(first, second, method=method, rng=np.random.default_rng(seed))
    shown = result.untrusted if result.reliable or untrusted else None
    if out is not None and shown is not None:
        content = tsis.matching.point_files.csv_text(shown.moved, match=shown.matches, trust=shown.trust)
        _write(out, content.encode())
    if figure is not None:
        _write(figure, _picture(first, second, result, shown))
    if html is not None:
        title = f"{tsis.files.reading.printable_name(source)} to {tsis.files.reading.printable_name(target)}"
        provenance = {"method": method, "seed": seed, "source": title.split(" to ")[0], "points": len(first)}
        page = tsis.present.matching.registration_page(
            first, second, result, title=title, provenance=provenance, shown=shown
        )
        _write(html, tsis.present.html.html_bytes(page))
    if shown is None:
        files["out"] = None
    _result(source, target, first, second, result, shown, seed, files, as_json=as_json)


def _result(
    source: Path,
    target: Path,
    first: NDArray[np.float64],
    second: NDArray[np.float64],
    registration: Registration,
    shown: PointMatch | None,
    seed: int,
    files: Mapping[str, Path | None],
    *,
    as_json: bool,
) -> None:

    matched = before = after = None
    if shown is not None:
        paired = ~shown.outliers
        matched = int(paired.sum())
        before, after = (_rms_distance(item[paired], second[shown.matches[paired]]) for item in (first, shown.moved))
    if as_json:
        document = tsis.present.document.envelope(
            "match",
            method=registration.method,
            seed=seed,
            source={"name": tsis.files.reading.printable_name(source), "points": len(first)},
            target={"name": tsis.files.reading.printable_name(target), "points": len(second)},
            matched=matched,
            rms_before=before,
            rms_after=after,
            confidence=registration.confidence,
            reliable=registration.reliable,
            alternatives=[
                {"rotation_deg": pose.rotation_deg, "probability": pose.probability}
                | ({} if shown is None else {"moved": pose.moved})
                for pose in registration.alternatives
            ],
            matches=None if shown is None else shown.matches,
            trust=None if shown is None else shown.trust,
            moved=None if shown is None else shown.moved,
            flags=list(registration.flags),
            notes=list(registration.notes),
        )
        print_json(document | {name: str(file) for name, file in files.items() if file is not None})
        leave(trusted=registration.reliable)
        return
    sets = ((source, first), (target, second))
    title = " to ".join(f"{tsis.files.reading.printable_name(file)} ({len(points)} points)" for file, points in sets)
    rows = (
        ("method", registration.method),
        ("matched points", "withheld" if matched is None else f"{matched} of {len(first)}"),
        ("RMS distance of matched points, before", "-" if before is None else f"{before:.4g}"),
        ("RMS distance of matched points, after", "-" if after is None else f"{after:.4g}"),
        ("confidence", f"{registration.confidence:.3f}, {'reliable' if registration.reliable else 'not reliable'}"),
    )
    where = "\n".join(f"Written: {file}" for file in files.values() if file is not None)
    table = Table(title=title, columns=("quantity", "value"), values=rows)
    print_tables((table,), tsis.present.matching.sentences(registration), where=where)
    leave(trusted=registration.reliable)


def _rms_distance(points: NDArray[np.float64], others: NDArray[np.float64]) -> float | None:
    import numpy as np

    return float(np.sqrt(((points - others) ** 2).sum(axis=1).mean())) if len(points) else None


def _picture(
    first: NDArray[np.float64], second: NDArray[np.float64], registration: Registration, shown: PointMatch | None
) -> bytes:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 10.0 if registration.alternatives else 6.0), layout="constrained")
    if registration.alternatives:
        parts = figure.subfigures(2, 1, height_ratios=(1.4, 1.0), squeeze=False)
        tsis.present.matching.draw_registration(parts[0, 0], first, second, registration, shown)
        tsis.present.matching.draw_poses(parts[1, 0], second, registration.alternatives)
    else:
        tsis.present.matching.draw_registration(figure, first, second, registration, shown)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=120)
    return buffer.getvalue()


def _refuse_existing(file: Path | None) -> None:
    if file is not None and file.exists():
        raise FileInputError(
            f"{tsis.files.reading.printable_path(file)} must be new, so that nothing is overwritten; it exists "
            "(choose another)"
        )


def _write(file: Path, content: bytes) -> None:
    try:
        tsis.files.atomic.write_durably(file, content)
    except OSError as error:
        raise FileInputError(
            f"{tsis.files.reading.printable_path(file)} must be writable; got: {error.strerror or error}"
        ) from error
