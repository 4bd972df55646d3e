"""``tsis optics angles``: light of the lamps that stays in the probe, and light that never reaches the face."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import tsis
from tsis.cli._options import AimDeg, AsJson, HalfAngleDeg, LampHeightMm, ProbeOption, chosen_lit_probe
from tsis.cli._output import CommandResult, Out, show_result
from tsis.present.page import Column, Table

if TYPE_CHECKING:
    from tsis.model.probe import Led, Probe
    from tsis.optics.angles import Acceptance


def angles(
    *,
    probe: ProbeOption = "tsis-2011",
    half_angle_deg: HalfAngleDeg = None,
    height_mm: LampHeightMm = None,
    aim_deg: AimDeg = None,
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Critical and acceptance angles of the probe's layers, beside the angles of its lamps."""
    chosen = chosen_lit_probe(probe, half_angle_deg, height_mm, aim_deg)
    result = tsis.optics.angles.acceptance(
        [layer.refractive_index for layer in chosen.layers] + [chosen.glass.refractive_index]
    )
    faced = [(led, tsis.optics.angles.layer_facing_lamp(chosen, led)) for led in chosen.leds if led.power > 0]
    lamps = [
        {**asdict(led), "height_mm": chosen.led_height_mm(led), "layer": layer, "widest_deg": _widest(led)}
        for led, layer in faced
    ]
    notes = (*_limits(result), *_lamps(result, faced))
    document = tsis.present.document.envelope("optics angles", probe=asdict(chosen), layers=asdict(result), leds=lamps)
    show_result(CommandResult(document=document, tables=(_table(chosen, result),), notes=notes), out, as_json=as_json)


def _widest(led: Led) -> float:
    """Angle from the side wall's normal of the outermost ray of half intensity that meets the wall."""
    return min(abs(led.aim_deg) + led.half_angle_deg, 90.0)


def _name(layer: int, count: int) -> str:
    return "glass" if layer == count - 1 else "layer 1, at the face" if layer == 0 else f"layer {layer + 1}"


def _table(probe: Probe, acceptance: Acceptance) -> Table:
    rows = []
    for layer, index in enumerate(acceptance.index):
        blind = acceptance.blind_deg[layer]
        rows.append((
            _name(layer, len(acceptance.index)),
            index,
            acceptance.critical_deg[layer],
            f"{acceptance.acceptance_deg[layer]:.2f}" + (" (all)" if acceptance.unlimited[layer] else ""),
            blind or None,
            acceptance.blind_fraction[layer] if blind else None,
        ))  # fmt: skip
    angles = ("critical", "acceptance", "never reaches the face below")
    return Table(
        title=f"{probe.name}: light through the side wall, from air; angles in degrees",
        columns=(
            "layer",
            Column(label="n", form=".4g"),
            *(Column(label=name, form=".2f") for name in angles),
            Column(label="of its angles", form=".0%"),
        ),
        values=tuple(rows),
    )


def _limits(acceptance: Acceptance) -> list[str]:
    import numpy as np

    low, high = acceptance.acceptance_deg.min(), acceptance.acceptance_deg.max()
    count = len(acceptance.index)
    notes = []
    if acceptance.unlimited.any():
        which = ", ".join(_name(layer, count) for layer in range(count) if acceptance.unlimited[layer])
        notes.append(f"n exceeds the square root of 2 in {which}: every ray that enters there from air stays.")
    if high > 75:
        notes.append(f"Acceptance is {low:.1f} to {high:.1f} degrees: it hardly limits the choice of a lamp.")
    else:
        notes.append(f"Acceptance is {low:.2f} to {high:.2f} degrees: lamps must stay within {low:.2f}.")
    notes.extend(
        f"Rays of n_eff between {acceptance.index[:layer].min():g} and {acceptance.index[layer]:g} never sense: light "
        f"that enters {_name(layer, count)} within {acceptance.blind_deg[layer]:.1f} degrees of the wall's normal "
        f"never reaches the pressed face, {acceptance.blind_fraction[layer]:.0%} of the angles of rays that stay in it."
        for layer in np.flatnonzero(acceptance.blind_deg).tolist()
    )
    return notes


def _lamps(acceptance: Acceptance, faced: list[tuple[Led, int]]) -> list[str]:
    """One note for lamps that differ only in their position around the probe."""
    correlation: dict[tuple[float, int], int] = {}
    for led, layer in faced:
        correlation[_widest(led), layer] = correlation.get((_widest(led), layer), 0) + 1
    notes = []
    for (widest, layer), count in correlation.items():
        accepts, name = acceptance.acceptance_deg[layer], _name(layer, len(acceptance.index))
        verdict = (
            f"within its acceptance of {accepts:.2f}: that cone stays in the probe."
            if widest <= accepts
            else f"beyond its acceptance of {accepts:.2f}: what enters further out leaks away."
        )
        blind = acceptance.blind_deg[layer]
        if widest <= blind:
            verdict += (
                f" But it lies within {blind:.1f} degrees and never reaches the face: change its aim or position."
            )
        notes.append(f"{count} lamp{'s' * (count > 1)} before {name}, half intensity at {widest:g} degrees, {verdict}")
    return notes
