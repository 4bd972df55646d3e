"""The scene of the tracers from a probe and a press."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tsis.errors import InputError
from tsis.model.press import PressField, PressMap
from tsis.model.probe import Probe
from tsis.model.require import require_type
from tsis.optics._angles import real_contact
from tsis.optics.rays import _surface as rays_surface
from tsis.optics.rays._face import face_grid, on_face

if TYPE_CHECKING:
    from tsis.optics._inputs import Floats
    from tsis.optics.rays._surface import Heights


THINNEST = 0.05  # least remaining fraction of the layers' thickness under a dent
WEAK = 0.1  # fraction of its first power below which a ray ends at random or continues with this power
MOST_MEETINGS = 1000
APERTURE = 0.1  # numerical, of the camera's lens


class Scene(NamedTuple):
    """The probe for the tracers: media from the face up, each between two interfaces, glass last.

    Interface ``k`` lies at ``level[k] + pull[k] * height``: layers under a dent are compressed in proportion.
    """

    radius: float
    level: Floats
    pull: Floats
    indices: Floats
    thinnest: Floats  # lowest index from the face up to each medium
    outside: float
    absorption: float
    face: Heights
    aperture: float
    weak: float
    most_meetings: int


def scene(
    probe: Probe,
    pressed: PressField | PressMap | None,
    *,
    saturation_kpa: float = 20.0,
    index_outside: float = 1.0,
    absorption_per_mm: float = 0.0,
    aperture: float = APERTURE,
) -> Scene:
    """The scene of a probe under the press ``pressed``."""
    require_type("probe", probe, Probe)
    if pressed is not None and not isinstance(pressed, PressField | PressMap):
        raise InputError(f"pressed must be a PressField, a PressMap or None; got {pressed!r:.80}")
    side, height, fraction = pressed_face(probe, pressed, saturation_kpa)
    thickness = probe.thickness_mm
    rest = float(thickness - height.max())
    if rest < THINNEST * thickness:
        raise InputError(
            f"face_displacement_mm must leave {THINNEST:.0%} of the layers' {thickness:g} mm; it leaves {rest:.3g} mm"
        )
    indices, levels = media(probe)
    return Scene(
        radius=probe.radius_mm,
        level=levels,
        pull=np.maximum(1.0 - levels / thickness, 0.0),
        indices=indices,
        thinnest=np.minimum.accumulate(indices),
        outside=index_outside,
        absorption=absorption_per_mm,
        face=rays_surface.heights(side, height, fraction),
        aperture=aperture,
        weak=WEAK,
        most_meetings=MOST_MEETINGS,
    )


def pressed_face(
    probe: Probe, pressed: PressField | PressMap | None, saturation_kpa: float
) -> tuple[Floats, Floats, Floats]:
    """Coordinates along one side of the tracer's grid, and there the face's height and its real contact."""
    side, from_axis = face_grid(probe.radius_mm)
    height = probe.sag_mm(from_axis)
    if pressed is None:
        return side, height, np.zeros(from_axis.shape)
    displacement, pressure = on_face(pressed, side, from_axis)
    return side, height + displacement, real_contact(pressure, saturation_kpa)


def media(probe: Probe) -> tuple[Floats, Floats]:
    """Refractive indices from the face up and the levels between them; neighbours of equal index are one medium."""
    parts = [(layer.refractive_index, layer.thickness_mm) for layer in probe.layers]
    parts.append((probe.glass.refractive_index, probe.glass.thickness_mm))
    indices: list[float] = []
    levels, top = [0.0], 0.0
    for index, thickness in parts:
        top += thickness
        if indices and indices[-1] == index:
            levels[-1] = top
        else:
            indices.append(index)
            levels.append(top)
    return np.array(indices), np.array(levels)
