"""Mesh of a press in three dimensions; mirror planes through the probe's axis halve or quarter it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import MechanicsError, import_extra

if TYPE_CHECKING:
    from tsis.mechanics._element import Floats
    from tsis.model.phantom import Inclusion, Phantom
    from tsis.model.probe import Probe


ROUNDING_MM = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Symmetry:
    """Mirror symmetry of a phantom in a frame rotated about the probe's axis."""

    angle: float  # angle of the frame's x axis from the phantom's, radians
    mirrors: str  # mirrored coordinates of the frame: ``""``, ``"y"`` (half model) or ``"xy"`` (quarter)

    @property
    def copies(self) -> int:
        """Number of modelled parts in the whole: 1, 2 or 4."""
        return int(2 ** len(self.mirrors))

    def rotated(self, x_mm: Floats, y_mm: Floats) -> tuple[Floats, ...]:
        """Points of the phantom in the rotated frame."""
        cosine, sine = np.cos(self.angle), np.sin(self.angle)
        return cosine * x_mm + sine * y_mm, cosine * y_mm - sine * x_mm

    def folded(self, x_mm: Floats, y_mm: Floats) -> tuple[Floats, ...]:
        """The mirror images of the points in the modelled part."""
        x, y = self.rotated(x_mm, y_mm)
        return np.abs(x) if "x" in self.mirrors else x, np.abs(y) if "y" in self.mirrors else y


def symmetry_of(inclusions: tuple[Inclusion, ...]) -> Symmetry:
    """The symmetry with the smallest modelled part.

    Ellipsoids lie along the phantom's axes, so the frame's angle is free only with equal horizontal semi-axes.
    """
    free = all(_is_round(inclusion) for inclusion in inclusions)
    away = [inclusion for inclusion in inclusions if np.hypot(*inclusion.offset_mm) > ROUNDING_MM]
    angles = [0.0, np.pi / 2]
    if free and away:
        x, y = away[0].offset_mm
        angles = [float(np.arctan2(y, x))]
    for angle in angles:
        frame = Symmetry(angle=angle, mirrors="")
        offsets = [frame.rotated(*np.array(inclusion.offset_mm)) for inclusion in inclusions]
        positions = np.array(offsets).reshape(-1, 2)
        if np.abs(positions[:, 1:]).max(initial=0.0) <= ROUNDING_MM:
            on_axis = np.abs(positions).max(initial=0.0) <= ROUNDING_MM
            return Symmetry(angle=angle, mirrors="xy" if on_axis else "y")
    return Symmetry(angle=0.0, mirrors="")


def _is_round(inclusion: Inclusion) -> bool:
    x, y, _ = inclusion.half_axes_mm
    return x == y


FEATURE = "a press in three dimensions (inclusions off the axis, ellipsoids, several at once)"
SAME = 1e-6  # of the face's radius: coordinates closer than this are equal


@dataclass(frozen=True, slots=True, kw_only=True)
class SolidResolution:
    """Mesh density of a press in three dimensions.

    Parameters
    ----------
    order
        Polynomial order of the elements; order 2 locks in nearly incompressible material.
    face
        Largest triangle on the contact face as a fraction of its radius.
    rim
        The same along the rim, where the pressure is singular.
    inclusion
        Largest element of an inclusion as a fraction of its smallest diameter.
    growth
        Growth of elements away from small ones, in (0, 1].
    """

    order: int = 3
    face: float = 0.1
    rim: float = 0.08
    inclusion: float = 0.3
    growth: float = 0.5


def outer_radius_mm(probe: Probe, thickness_mm: float) -> float:
    """Outer radius of the slab: the influence of the face has decayed there."""
    return max(10 * probe.radius_mm, 4 * thickness_mm)


def layer_name(index: int) -> str:
    """Name of the probe's layer, counted from the tissue up."""
    return f"layer{index}"


def inclusion_name(index: int) -> str:
    """Name of an inclusion."""
    return f"inclusion{index}"


def solid_mesh(probe: Probe, phantom: Phantom, symmetry: Symmetry, resolution: SolidResolution) -> Any:
    """Mesh the modelled part of probe and slab.

    The skin lies at z = 0 and the glass above. Regions: ``tissue``, ``inclusion0`` ..., ``layer0`` ... from the tissue
    up; boundaries: ``face``, ``glass``, ``side`` (of the probe), ``wall``, ``mirror_x``, ``mirror_y``.
    """
    occ = import_extra("netgen.occ", feature=FEATURE, extra="fem3d")
    whole = occ.Glue([*_slab(occ, probe, phantom, symmetry, resolution), *_layers(occ, probe)])
    part = _cut(occ, whole, probe, phantom, symmetry)
    _name_faces(part, probe, phantom, resolution, symmetry)
    meshing = import_extra("netgen.meshing", feature=FEATURE, extra="fem3d")
    meshing.SetMessageImportance(0)  # it prints on the terminal
    try:
        generated = occ.OCCGeometry(part).GenerateMesh(maxh=phantom.thickness_mm, grading=resolution.growth)
    except meshing.NgException as error:
        raise MechanicsError(
            f"the phantom cannot be meshed at {resolution}; choose smaller elements or a smaller growth"
        ) from error
    mesh = import_extra("ngsolve", feature=FEATURE, extra="fem3d").Mesh(generated)
    mesh.Curve(resolution.order)
    return mesh


def _slab(occ: Any, probe: Probe, phantom: Phantom, symmetry: Symmetry, resolution: SolidResolution) -> list[Any]:
    thickness = phantom.thickness_mm
    tissue = occ.Cylinder(occ.Pnt(0, 0, -thickness), occ.Z, outer_radius_mm(probe, thickness), thickness)
    bodies = []
    for index, inclusion in enumerate(phantom.inclusions):
        body = _ellipsoid(occ, inclusion, symmetry)
        body.mat(inclusion_name(index))
        body.maxh = 2 * resolution.inclusion * min(inclusion.half_axes_mm)
        tissue = tissue - body
        bodies.append(body)
    tissue.mat("tissue")
    return [tissue, *bodies]


def _ellipsoid(occ: Any, inclusion: Inclusion, symmetry: Symmetry) -> Any:
    x, y = (float(value) for value in symmetry.rotated(*np.array(inclusion.offset_mm)))
    centre = occ.Pnt(x, y, -inclusion.centre_depth_mm)
    half_x, half_y, half_z = inclusion.half_axes_mm
    if half_x == half_y == half_z:
        return occ.Sphere(centre, half_z)
    along = occ.Vec(np.cos(symmetry.angle), -np.sin(symmetry.angle), 0)  # the phantom's x axis in the rotated frame
    return occ.Ellipsoid(occ.Axes(centre, n=occ.Z, h=along), half_z, half_x, half_y)  # along n, along h, across both


def _layers(occ: Any, probe: Probe) -> list[Any]:
    layers, height = [], 0.0
    for index, layer in enumerate(probe.layers):
        body = occ.Cylinder(occ.Pnt(0, 0, height), occ.Z, probe.radius_mm, layer.thickness_mm)
        body.mat(layer_name(index))
        layers.append(body)
        height += layer.thickness_mm
    return layers


def _cut(occ: Any, whole: Any, probe: Probe, phantom: Phantom, symmetry: Symmetry) -> Any:
    if not symmetry.mirrors:
        return whole
    far = 2 * outer_radius_mm(probe, phantom.thickness_mm)
    low = (0 if "x" in symmetry.mirrors else -far, 0, -2 * phantom.thickness_mm)
    return whole * occ.Box(occ.Pnt(*low), occ.Pnt(far, far, 2 * probe.thickness_mm))


def _name_faces(part: Any, probe: Probe, phantom: Phantom, resolution: SolidResolution, symmetry: Symmetry) -> None:
    """Name the boundaries by their position, and set the mesh density of the face and its rim."""
    radius, close = probe.radius_mm, SAME * probe.radius_mm

    def flat(shape: Any, axis: int, level: float) -> bool:
        low, high = shape.bounding_box
        # Bounding boxes of curved shapes are a little too large; those of planes are not.
        return bool(abs(low[axis] - level) < close and abs(high[axis] - level) < close)

    def extent(shape: Any) -> float:
        low, high = shape.bounding_box
        return float(max(abs(low[0]), abs(high[0]), abs(low[1]), abs(high[1])))

    for face in part.faces:
        face.name = "inside"
        if flat(face, 2, -phantom.thickness_mm):
            face.name = "wall"
        elif flat(face, 2, probe.thickness_mm):
            face.name = "glass"
        elif flat(face, 2, 0.0):
            face.name = "skin"
            if extent(face) < 1.01 * radius:
                face.name, face.maxh = "face", resolution.face * radius
        elif "y" in symmetry.mirrors and flat(face, 1, 0.0):
            face.name = "mirror_y"
        elif "x" in symmetry.mirrors and flat(face, 0, 0.0):
            face.name = "mirror_x"
        elif _is_side(face, close) and extent(face) > 0.99 * radius:
            face.name = "side"
    for edge in part.edges:
        if flat(edge, 2, 0.0) and 0.99 * radius < extent(edge) < 1.01 * radius and abs(edge.center[1]) > close:
            edge.maxh = resolution.rim * radius


def _is_side(face: Any, close: float) -> bool:
    """Whether a face is vertical and beside a layer of the probe."""
    low, high = face.bounding_box
    return bool(low[2] > -close and high[2] - low[2] > close)
