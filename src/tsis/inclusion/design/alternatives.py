"""Alternatives to a planned probe and protocol, and their comparison."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

from tsis.errors import InputError
from tsis.inclusion.design.information import ProtocolInformation, even_inclusions, information_of, planned_view
from tsis.inclusion.design.limits import DesignLimits, limits_of
from tsis.inclusion.prior import PARAMETERS
from tsis.model.require import require_one_of
from tsis.optics.face_light import irradiance

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from tsis.imaging.sensor import Sensor
    from tsis.inclusion.design.information import PlannedView
    from tsis.inclusion.design.protocol import Protocol
    from tsis.inclusion.prior import InclusionPrior
    from tsis.mechanics.surrogate.polynomial import Degrees
    from tsis.model.calibration import Calibration
    from tsis.model.probe import Probe


Aspect = Literal["softness", "layers", "dome", "forces", "frames", "reference"]
ASPECTS: tuple[Aspect, ...] = ("softness", "layers", "dome", "forces", "frames", "reference")
SOFTNESS = (0.25, 0.5, 1.0, 2.0, 4.0)  # times every modulus
DOMES_MM = (None, 80.0, 40.0, 30.0)
FORCES = (0.5, 1.0, 1.5, 2.0)  # times every force
FRAMES = (1, 4, 16)
CRITERIA = ("all", *PARAMETERS)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Design:
    """A protocol, its information and its limits."""

    protocol: Protocol
    information: ProtocolInformation
    limits: DesignLimits


def design_of(view: PlannedView) -> Design:
    """Evaluate a protocol on inclusions spread over the prior."""
    inclusions = even_inclusions(view.model.prior)
    return Design(
        protocol=view.protocol, information=information_of(view, inclusions), limits=limits_of(view, inclusions)
    )


def score(protocol_information: ProtocolInformation, criterion: str) -> float:
    """Objective of a design: a parameter's expected error, or for ``"all"`` the mean log product of the sd."""
    require_one_of("criterion", criterion, CRITERIA)
    return protocol_information.log_sd if criterion == "all" else protocol_information.rmse[criterion]


def rank_designs(designs: Sequence[Design], criterion: str = "all") -> tuple[Design, ...]:
    """Evaluations by rising objective; those that violate a limit come last."""
    return tuple(sorted(designs, key=lambda design: (bool(design.limits.broken), score(design.information, criterion))))


def design_alternatives(planned: Protocol, aspect: Aspect) -> tuple[Protocol, ...]:
    """Variants of the planned protocol in one aspect, without the protocol itself.

    Parameters
    ----------
    planned
        The planned protocol.
    aspect
        ``"softness"``: all moduli times 1/4 to 4. ``"layers"``: one modulus of equal compliance under uniform pressure,
        and the moduli in reverse. ``"dome"``: a flat face, and curvatures of 80, 40 and 30 mm that fit the face.
        ``"forces"``: all forces times 1/2 to 2. ``"frames"``: 1, 4 or 16 repeats of each press. ``"reference"``: with
        and without reference presses.

    Raises
    ------
    UnknownNameError
        When the aspect is unknown.
    """
    require_one_of("aspect", aspect, ASPECTS)
    return tuple(other for other in _CHANGES[aspect](planned) if _unnamed(other) != _unnamed(planned))


def _unnamed(protocol: Protocol) -> Protocol:
    return replace(protocol, name="", probe=replace(protocol.probe, name=""))


def _softer(planned: Protocol) -> Iterator[Protocol]:
    for factor in SOFTNESS:
        layers = [factor * layer.young_kpa for layer in planned.probe.layers]
        yield replace(planned, probe=with_moduli(planned.probe, layers), name=f"layers {factor:g} times as stiff")


def _layered(planned: Protocol) -> Iterator[Protocol]:
    probe = planned.probe
    young = [layer.young_kpa for layer in probe.layers]
    even = probe.thickness_mm / sum(layer.thickness_mm / layer.young_kpa for layer in probe.layers)
    yield replace(planned, probe=with_moduli(probe, [even] * len(young)), name=f"layers all of {even:.0f} kPa")
    if len(set(young)) > 1:
        yield replace(planned, probe=with_moduli(probe, young[::-1]), name="layers in reverse")


def _domed(planned: Protocol) -> Iterator[Protocol]:
    for curvature in DOMES_MM:
        name = "flat face" if curvature is None else f"face curved by {curvature:g} mm"
        try:
            probe = replace(planned.probe, face_curvature_mm=curvature, name=name)
        except InputError:  # the layers are too thin or the face is too wide for the dome
            continue
        yield replace(planned, probe=probe, name=name)


def _pressed(planned: Protocol) -> Iterator[Protocol]:
    for factor in FORCES:
        try:
            presses = tuple(replace(press, force_n=factor * press.force_n) for press in planned.presses)
        except InputError:  # a force outside the range of a plan
            continue
        forces = " and ".join(f"{press.force_n:g}" for press in presses)
        yield replace(planned, presses=presses, name=f"{forces} N")


def _repeated(planned: Protocol) -> Iterator[Protocol]:
    for frames in FRAMES:
        yield replace(planned, frames_each=frames, name=f"frames of each press: {frames}")


def _referred(planned: Protocol) -> Iterator[Protocol]:
    for requested, name in ((True, "with a reference"), (False, "without a reference")):
        presses = tuple(replace(press, with_reference=requested) for press in planned.presses)
        yield replace(planned, presses=presses, name=name)


_CHANGES: dict[str, Callable[[Protocol], Iterator[Protocol]]] = {
    "softness": _softer,
    "layers": _layered,
    "dome": _domed,
    "forces": _pressed,
    "frames": _repeated,
    "reference": _referred,
}


def with_moduli(probe: Probe, young_kpa: Sequence[float]) -> Probe:
    """The probe with other moduli of its layers, from the tissue up; a changed probe has no catalog name."""
    layers = tuple(replace(layer, young_kpa=float(young)) for layer, young in zip(probe.layers, young_kpa, strict=True))
    return replace(probe, layers=layers, name=probe.name if layers == probe.layers else f"{probe.name} (changed)")


def calibration_for(probe: Probe, *, of: Probe, calibration: Calibration, traced: bool = False) -> Calibration:
    """Predict the calibration of another probe from that ``of`` a probe.

    The pressure of saturation scales with the skin's modulus, because its asperities flatten in proportion; the
    exposure gives the same grey levels at small pressures. With ``traced`` the lamps' light on the face is traced, in
    seconds a probe; else the calibration's light is used.
    """
    stiffer = probe.layers[0].young_kpa / of.layers[0].young_kpa
    scaled = replace(calibration, saturation_kpa=calibration.saturation_kpa * stiffer, probe="")
    if not traced:
        return scaled
    light = irradiance(probe).near_undented()
    before = 1.0 if calibration.light is None else float(calibration.light.relative.max())
    gain = scaled.gain_grey_per_kpa * before / float(light.relative.max())
    return replace(scaled, light=light, gain_grey_per_kpa=gain)


def compare_designs(
    protocols: Sequence[Protocol],
    *,
    of: Probe,
    prior: InclusionPrior,
    calibration: Calibration,
    sensor: Sensor | None = None,
    traced: bool = False,
    degrees: Degrees | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Design, ...]:
    """Evaluate protocols, in their order.

    The press of a new probe takes seconds to solve and is cached on disk, so that an interrupted comparison resumes.

    Parameters
    ----------
    protocols
        The protocols.
    of, calibration, traced
        A probe, its calibration, and whether to trace the lamps' light; see `calibration_for`.
    prior, sensor, degrees
        See `information`.
    progress
        Called with (protocols done, all protocols).
    """
    designs = []
    for done, protocol in enumerate(protocols):
        if progress is not None:
            progress(done, len(protocols))
        own = calibration_for(protocol.probe, of=of, calibration=calibration, traced=traced)
        view = planned_view(protocol, prior=prior, calibration=own, sensor=sensor, degrees=degrees)
        designs.append(design_of(view))
    if progress is not None:
        progress(len(protocols), len(protocols))
    return tuple(designs)
