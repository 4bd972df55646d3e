"""``tsis network``: train networks and apply them to frames."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tsis
from tsis.__about__ import LARGEST_SEED
from tsis.cli.options import (
    AsJson,
    InclusionPriorChoice,
    ProbeOption,
    ShowPrior,
    calibrated_probe,
    chosen_prior,
    chosen_probe,
    chosen_scale,
)
from tsis.cli.output import CommandResult, Out, show_result
from tsis.cli.progress import progress_bar
from tsis.errors import InputError
from tsis.present.page import Table

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tsis.inclusion.network import TrainedNetworks


app = typer.Typer(
    name="network",
    no_args_is_help=True,
)
UNNAMED = "tsis-2011"  # for calibrations that name no probe
SPREAD = (
    "sd is the spread of the networks and no uncertainty of the estimate: tsis examine gives one with its interval.",
    "The modulus is hardly better than the middle of its range: three numbers of one press do not determine it.",
)


@app.command(epilog="Example: tsis network train networks.json --probe tsis-domed --samples 40 --networks 5")
def train(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="File of the networks to write; it must not exist yet.")],
    *,
    probe: ProbeOption = "tsis-2011",
    force_n: Annotated[float, typer.Option(help="Force of the presses in newtons.")] = 1.0,
    samples: Annotated[int, typer.Option(help="Inclusions to simulate.")] = 134,
    networks: Annotated[int, typer.Option(help="How many networks to train.")] = 100,
    hidden: Annotated[
        list[int] | None, typer.Option(help="Units of a hidden layer; repeat it for more layers.", show_default="10")
    ] = None,
    method: Annotated[str, typer.Option(help="scg: scaled conjugate gradients; lm: Levenberg-Marquardt.")] = "scg",
    seed: Annotated[int, typer.Option(help="Seed of inclusions and first weights.", min=0, max=LARGEST_SEED)] = 1,
    prior: InclusionPriorChoice = None,
    show_prior: ShowPrior = False,
    as_json: AsJson = False,
) -> None:
    """Simulate presses on inclusions of the prior, and train networks on three outputs of each press."""
    import numpy as np

    tsis.files.result_folder.require_absent(file)
    chosen = chosen_probe(probe)
    assumed = chosen_prior(prior)
    with progress_bar("simulating presses, then training networks") as progress:
        trained = tsis.inclusion.network.train_networks(
            chosen,
            rng=np.random.default_rng(seed),
            force_n=force_n,
            prior=assumed,
            samples=samples,
            networks=networks,
            hidden=tuple(hidden or (10,)),
            method=method,
            solving=progress,
            progress=progress,
        )
    tsis.inclusion.network.write_networks(trained, file)
    document = tsis.present.document.envelope(
        "network train", file=str(file), seed=seed, samples=samples, method=method, **_about(trained)
    )
    rows = (
        ("file", str(file)),
        ("probe", trained.probe),
        ("force", f"{trained.force_n:g} N"),
        ("networks", str(len(trained.networks))),
        ("simulated inclusions", str(samples)),
    )
    table = Table(title="Trained networks", columns=("quantity", "value"), values=rows)
    show_result(CommandResult(document=document, tables=(table,), notes=(f"Prior: {assumed}.",)), None, as_json=as_json)


@app.command(
    epilog=(
        "Example: tsis network apply networks.json first-press/target-1N.png --reference-press "
        "first-press/reference-1N.png --calibration first-press/calibration.json --scale-mm 0.0336,0.0392 --force-n 1"
    )
)
def apply(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="File that tsis network train wrote.")],
    images: Annotated[list[Path], typer.Argument(help="Frames of presses over inclusions, at the training's force.")],
    *,
    reference_press: Annotated[Path, typer.Option(help="The same press on tissue without inclusion.")],
    calibration: Annotated[Path, typer.Option(help="Calibration file of the probe.")],
    force_n: Annotated[
        float | None, typer.Option(help="Force of all presses in newtons; left out with a force line.")
    ] = None,
    scale_mm: Annotated[
        str | None,
        typer.Option(help="Millimetres per pixel on the face; left out with a calibration that contains it."),
    ] = None,
    probe: Annotated[
        str | None,
        typer.Option(
            help="Name in the catalog, or a file of your own, as mine.toml.",
            show_default=f"the calibration's, else {UNNAMED}",
        ),
    ] = None,
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Estimate diameter, depth and modulus of inclusions from frames by trained networks."""
    trained, usable = (
        tsis.inclusion.network.read_networks(file),
        tsis.calibration.frames.load_calibration(calibration),
    )
    scale = chosen_scale(usable, scale_mm)
    if scale is None or (force_n is None and usable.calibration.force_line is None):
        raise InputError(
            "networks need --scale-mm and --force-n, where the calibration contains neither scale nor force line"
        )
    frames = [
        tsis.instrument.image_files.read_image(path, mm_per_pixel=scale, force_n=force_n)
        for path in (*images, reference_press)
    ]
    pressed, response = usable.pressed(frames, on_tissue=True)
    chosen = chosen_probe(probe) if probe else calibrated_probe(response.probe, unnamed=UNNAMED)
    outputs = trained.outputs(pressed[:-1], pressed[-1], probe=chosen, calibration=response)
    result = trained(outputs)
    outside = trained.outside(outputs)
    notes = (
        *SPREAD,
        *(f"The {name} output lies outside those of the training: the networks extrapolate." for name in outside),
    )
    rows, presses = [], []
    for number, path in enumerate(images):
        mean, sd = result[:, number].mean(axis=0), result[:, number].std(axis=0)
        rows.append((path.name, *(f"{item:.3g} ± {other:.2g}" for item, other in zip(mean, sd, strict=True))))
        presses.append({"press": path.name, "outputs": outputs[number].tolist(), **_parameters(mean, sd)})
    document = tsis.present.document.envelope(
        "network apply", presses=presses, outside=list(outside), networks=_about(trained), calibration=usable.citation()
    )
    labels = (tsis.present.labels.quantity_of(name).axis for name in tsis.inclusion.prior.PARAMETERS)
    table = Table(title="Mean and sd over the networks", columns=("press", *labels), values=tuple(rows))
    show_result(CommandResult(document=document, tables=(table,), notes=notes), out, as_json=as_json)


def _parameters(mean: NDArray[np.float64], sd: NDArray[np.float64]) -> dict[str, Any]:
    values = zip(tsis.inclusion.prior.PARAMETERS, mean.tolist(), sd.tolist(), strict=True)
    return {"parameters": {name: {"mean": item, "sd_of_networks": other} for name, item, other in values}}


def _about(trained: TrainedNetworks) -> dict[str, Any]:
    return {
        "probe": trained.probe,
        "force_n": trained.force_n,
        "reach_mm": trained.reach_mm,
        "networks": len(trained.networks),
        "prior": dict(trained.prior),
    }
