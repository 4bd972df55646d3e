"""``tsis depth``: depth maps of a gel sensor, and their calibration by a ball."""

from __future__ import annotations

import io
import itertools
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tsis
from tsis.cli.commands import DefaultCommand
from tsis.cli.options import AsJson
from tsis.cli.output import leave, print_json
from tsis.cli.progress import progress_bar
from tsis.cli.sensor import (
    GelFrames,
    GelReference,
    SensorOption,
    chosen_sensor,
    gel_frame_paths,
    read_gel_frame,
    required_reference,
    untouched_of,
)
from tsis.present.page import Column, Table
from tsis.present.terminal import print_tables

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from tsis.imaging.depth import DepthMap


MOST_WEIGHTS = 10**6

app = typer.Typer(
    name="depth",
    cls=DefaultCommand.named("map", is_default=False),
)


@app.command(
    "calibrate",
    epilog="Example: tsis depth calibrate gel-frames/press-1.png gel-frames/press-2.png gel-frames/press-3.png "
    "--sensor gelsight-mini --ball-mm 6 --reference gel-frames/untouched.png --out depth.json",
)
def calibrate(
    frames: GelFrames,
    *,
    sensor: SensorOption = "",
    ball_mm: Annotated[float, typer.Option(help="Diameter of the ball in mm.")],
    reference: GelReference = None,
    out: Annotated[Path, typer.Option(help="Calibration file to write; it must not exist.")] = Path("depth.json"),
    as_json: AsJson = False,
) -> None:
    """Calibrate depth from presses of a ball of known diameter; each is left out in turn to measure the error."""
    tsis.files.result_folder.require_absent(out)
    chosen = chosen_sensor(sensor)
    untouched = required_reference(chosen, reference or untouched_of(frames))
    levels = [read_gel_frame(path) for path in gel_frame_paths(frames)]
    with progress_bar("reading presses") as advance:
        result = tsis.imaging.depth.calibrate_depth(
            levels, sensor=chosen, reference=untouched, ball_mm=ball_mm, progress=advance
        )
    tsis.files.atomic.write_durably(out, tsis.imaging.depth.depth_calibration_json(result))
    if as_json:
        document = tsis.present.document.envelope(
            "depth calibrate", sensor=chosen.name, method=result.method, presses=result.presses, sd_mm=result.sd_mm,
            other_sd_mm=result.other_sd_mm, errors_mm=list(result.errors_mm), file=str(out),
        )  # fmt: skip
        print_json(document)
        return
    left_out = (sum(error**2 for error in result.errors_mm) / len(result.errors_mm)) ** 0.5
    other = result.other_sd_mm
    rows = [
        ("method", result.method),
        ("good presses", f"{result.presses} of {len(levels)}"),
        ("distance from the ball, presses left out / mm", f"{left_out:.4f}"),
        *(() if other is None else (("that of the best other method / mm", f"{other:.4f}"),)),
        ("sd of a depth, the untouched face included / mm", f"{result.sd_mm:.4f}"),
    ]
    table = Table(title="Depth calibration", columns=("quantity", "value"), values=tuple(rows))
    print_tables([table], [], where=f"Calibration: {out}")


@app.command(
    "map",
    epilog="Example: tsis depth map gel-frames/press-4.png --sensor gelsight-mini --calibration depth.json "
    "--reference gel-frames/untouched.png --out depth-maps",
)
def depth_map(
    frames: GelFrames,
    *,
    sensor: SensorOption = "",
    calibration: Annotated[Path, typer.Option(help="File that tsis depth calibrate wrote.")],
    reference: GelReference = None,
    out: Annotated[Path, typer.Option(help="Folder to write; a number is added when it exists.")] = Path("depth-maps"),
    as_json: AsJson = False,
) -> None:
    """Write depth maps in mm with their uncertainty: NPY (depth and sd), TIFF of floats, PLY points, and a picture."""
    chosen = chosen_sensor(sensor)
    parse = tsis.imaging.depth.parse_depth_calibration
    document = tsis.files.reading.read_object(calibration, values=MOST_WEIGHTS)
    mapper = tsis.imaging.depth.DepthMapper(
        parse(document), chosen, required_reference(chosen, reference or untouched_of(frames))
    )
    files: dict[str, bytes] = {}
    rows: list[tuple[str, float, float]] = []
    maps: list[dict[str, Any]] = []
    said: dict[str, None] = {}
    trusted = True
    paths = gel_frame_paths(frames)
    names = _map_names(paths)
    with progress_bar("mapping depth") as advance:
        for number, path in enumerate(paths):
            result = mapper.map(read_gel_frame(path), name=path.name)
            files |= {f"{names[number]}{ending}": content(result) for ending, content in FORMS.items()}
            rows.append((path.name, float(result.depth_mm.max()), _sd(result)))
            maps.append(
                dict(zip(("frame", "deepest_mm", "sd_mm"), rows[-1], strict=True))
                | {"map": names[number], "problems": list(result.problems), "notes": list(result.notes)}
            )
            said.update(dict.fromkeys((*result.problems, *result.notes)))
            trusted = trusted and not result.problems
            advance(number + 1, len(paths))
    folder = tsis.files.result_folder.write_folder(tsis.files.result_folder.free_folder(out), files)
    if as_json:
        print_json(tsis.present.document.envelope("depth map", sensor=chosen.name, maps=maps, folder=str(folder)))
        leave(trusted=trusted)
        return
    depths = (Column(label="deepest", unit="mm", form=".3f"), Column(label="sd there", unit="mm", form=".3f"))
    columns: tuple[str | Column, ...] = ("frame", *depths)
    values: list[tuple[Any, ...]] = list(rows)
    if names != [path.stem for path in paths]:  # frames of one name, from several folders
        columns, values = (*columns, "map"), [(*row, name) for row, name in zip(rows, names, strict=True)]
    table = Table(title="Depth maps", columns=columns, values=tuple(values))
    print_tables([table], list(said), where=f"Maps: {folder}")
    leave(trusted=trusted)


def _map_names(paths: Sequence[Path]) -> list[str]:
    """Names of the maps without endings: those of their frames, a second of one name with ``-2``, and so on."""
    names: list[str] = []
    taken: set[str] = set()  # files of earlier maps, as systems without capitals see them
    own = {path.stem.casefold() for path in paths}
    for path in paths:
        numbered = (name for number in itertools.count(2) if (name := f"{path.stem}-{number}").casefold() not in own)
        for name in itertools.chain([path.stem], numbered):
            files = {f"{name}{ending}".casefold() for ending in FORMS}
            if not files & taken:
                break
        names.append(name)
        taken |= files
    return names


def _sd(result: DepthMap) -> float:
    return float(result.sd_mm.ravel()[int(result.depth_mm.argmax())])


def _npy(values: NDArray[Any]) -> bytes:
    import numpy as np

    buffer = io.BytesIO()
    np.save(buffer, values.astype(np.float32))
    return buffer.getvalue()


def _tiff(result: DepthMap) -> bytes:
    import numpy as np
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(result.depth_mm.astype(np.float32)).save(buffer, format="TIFF")
    return buffer.getvalue()


def _png(result: DepthMap) -> bytes:
    from matplotlib.figure import Figure

    figure, buffer = Figure(figsize=(6, 4), layout="constrained"), io.BytesIO()
    tsis.present.figures.gel_depth(
        result.depth_mm, figure.subplots(), mm_per_pixel=result.mm_per_pixel, label="depth / mm"
    )
    figure.savefig(buffer, format="png", dpi=120)
    return buffer.getvalue()


FORMS: dict[str, Callable[[DepthMap], bytes]] = {
    ".npy": lambda result: _npy(result.depth_mm),
    "-sd.npy": lambda result: _npy(result.sd_mm),
    ".tiff": _tiff,
    ".ply": lambda result: result.ply_bytes(),
    ".png": _png,
}
