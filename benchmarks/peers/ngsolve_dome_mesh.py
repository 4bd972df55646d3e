"""Mesh of a domed probe over a slab for `ngsolve_dome`, the spline between them, and points on their surfaces."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import BSpline
from scipy.sparse import coo_array, csr_array

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.phantom import Phantom
    from tsis.model.probe import Probe

    Floats = NDArray[np.float64]

FILLET_MM = 0.5
SKIN_MM = 17.0  # radius of the skin that may touch
CUT_MM = 110.0  # outer radius of the slab
CENTRE = 0.8  # height of the polar centre over the apex, of the probe's thickness


@dataclass(frozen=True, slots=True, kw_only=True)
class Fineness:
    """Sizes of triangles and of the spline's pieces in mm, the triangles' order, and the springs' softness.

    ``softness_mm`` is the overlap in mm under a pressure of the tissue's modulus.
    """

    skin: float = 0.5
    face: float = 0.5
    rim: float = 0.12
    sphere: float = 1.5
    layer: float = 1.0
    order: int = 3
    piece: float = 0.5
    rim_piece: float = 0.06
    softness_mm: float = 2e-3


class Outline:
    """The undeformed face and rim of a probe, its apex at (0, 0), z upwards."""

    def __init__(self, probe: Probe) -> None:
        self.probe, self.edge, self.thick = probe, probe.radius_mm, probe.thickness_mm

    def lifted(self, radius: Any, height: Any) -> tuple[Floats, Floats]:
        """Points (r, z) of a flat probe at ``height`` over its face, after the layers bulge together."""
        flat = np.broadcast_arrays(np.asarray(radius, dtype=float), np.asarray(height, dtype=float))
        at, above = (one.ravel() for one in flat)
        sag = self.probe.sag_mm(np.minimum(at, self.edge))
        return at, self.thick - (self.thick - above) * (self.thick - sag) / self.thick

    def along(self, face: Floats, turns: int, side: Floats) -> tuple[Floats, Floats]:
        """Points at radii ``face``, on ``turns`` equal pieces of the rim, and at heights ``side`` above the rim."""
        turn = np.linspace(0.0, np.pi / 2, turns + 1)
        radius = [face, self.edge - FILLET_MM * (1 - np.sin(turn)), np.full(len(side), self.edge)]
        height = [0 * face, FILLET_MM * (1 - np.cos(turn)), FILLET_MM + side]
        return self.lifted(np.concatenate(radius), np.concatenate(height))


def meshed(probe: Probe, phantom: Phantom, fine: Fineness) -> Any:
    """Both bodies, the slab just touching the apex from below; edges named axis, glass, wall, face and skin."""
    ng, occ, meshing = (importlib.import_module(name) for name in ("ngsolve", "netgen.occ", "netgen.meshing"))
    meshing.SetMessageImportance(0)
    outline = Outline(probe)
    own, thick = phantom.inclusion, phantom.thickness_mm
    assert own is not None
    half = own.diameter_mm / 2
    slab = occ.Rectangle(CUT_MM, thick).Face().Move(occ.Vec(0, -thick, 0))
    near = slab * occ.Rectangle(SKIN_MM, thick).Face().Move(occ.Vec(0, -thick, 0))
    box = occ.Rectangle(half, 2 * half).Face().Move(occ.Vec(0, -own.depth_mm - 2 * half, 0))
    ball = occ.Circle(occ.Pnt(0, -own.depth_mm - half), half).Face() * box
    far, near = slab - near, near - ball
    near.name = far.name = "slab"
    ball.name, ball.maxh = "ball", min(fine.sphere, half / 2, own.depth_mm / 1.5)
    layers, tissue = occ.Glue(_layers(occ, outline, fine)), occ.Glue([near, far, ball])
    _name_probe(layers.edges, outline, fine)
    for edge in tissue.edges:
        if _level(edge, 0, 0.0):
            edge.name = "axis"
        elif _level(edge, 1, -thick):
            edge.name = "wall"
        elif _level(edge, 1, 0.0) and edge.bounding_box[1][0] < 1.01 * SKIN_MM:
            edge.name, edge.maxh = "skin", fine.skin
    sizes = meshing.MeshingParameters(maxh=10.0, grading=0.35)
    for radius in np.arange(outline.edge - 1.4, outline.edge + 1.2, fine.rim):
        sizes.RestrictH(x=float(radius), y=0.0, z=0.0, h=1.5 * fine.rim)
    mesh = ng.Mesh(occ.OCCGeometry(occ.Compound([layers, tissue]), dim=2).GenerateMesh(sizes))
    mesh.Curve(4)
    return mesh


def _level(edge: Any, axis: int, level: float) -> bool:
    low, high = edge.bounding_box
    return bool(max(abs(low[axis] - level), abs(high[axis] - level)) < 1e-5)


def _layers(occ: Any, outline: Outline, fine: Fineness) -> list[Any]:
    edge, thick, layers = outline.edge, outline.thick, outline.probe.layers

    def points(radius: Any, height: Any) -> list[Any]:
        return [occ.Pnt(float(r), float(z), 0) for r, z in zip(*outline.lifted(radius, height), strict=True)]

    turn = np.linspace(0, np.pi / 2, 25)
    face = points(np.linspace(0.0, edge - FILLET_MM, 60), 0.0)
    rim = points(edge - FILLET_MM * (1 - np.sin(turn)), FILLET_MM * (1 - np.cos(turn)))
    corners = [rim[-1], *(points(*at)[0] for at in ((edge, layers[0].thickness_mm), (edge, thick), (0.0, thick)))]
    curves = [occ.SplineApproximation(one, tol=1e-7) for one in (face, rim)]
    sides = [occ.Segment(*ends) for ends in pairwise([*corners, face[0]])]
    rest, bodies, height = occ.Face(occ.Wire([*curves, *sides])), [], 0.0
    for index, layer in enumerate(layers):
        height += layer.thickness_mm
        body = rest
        if index < len(layers) - 1:
            curve = points(np.linspace(0.0, edge, 60), height)
            around = [curve[-1], occ.Pnt(edge, -1.0, 0), occ.Pnt(0, -1.0, 0), curve[0]]
            ends = [occ.Segment(*pair) for pair in pairwise(around)]
            below = occ.Face(occ.Wire([occ.SplineApproximation(curve, tol=1e-7), *ends]))
            body, rest = rest * below, rest - below
        body.name, body.maxh = f"layer{index}", fine.layer
        bodies.append(body)
    return bodies


def _name_probe(edges: Any, outline: Outline, fine: Fineness) -> None:
    """Names and sizes; the face goes over the rim up to the end of the first layer."""
    end = outline.lifted(outline.edge, outline.probe.layers[0].thickness_mm)[1][0] + 1e-4
    inner = outline.edge - FILLET_MM
    for edge in edges:
        low, high = edge.bounding_box
        if _level(edge, 0, 0.0):
            edge.name = "axis"
        elif _level(edge, 1, outline.thick):
            edge.name = "glass"
        elif high[1] < end and low[0] > inner - 1e-3:
            edge.name, edge.maxh = "face", fine.rim if high[0] - low[0] > FILLET_MM / 5 else 4 * fine.rim
        elif high[1] < end and abs(high[0] - inner) < 1e-3:
            edge.name, edge.maxh = "face", fine.face


class ContactSpline:
    """The even cubic spline between the bodies; ``basis`` has its functions and their two derivatives."""

    def __init__(self, outline: Outline, fine: Fineness) -> None:
        self.centre = CENTRE * outline.thick
        edge, fillet = outline.edge, FILLET_MM
        inside = np.arange(0.0, edge - 4 * fillet, fine.piece)
        pieces = int(3 * fillet / min(fine.piece, 4 * fine.rim_piece)) + 1
        shoulder = np.linspace(edge - 4 * fillet, edge - fillet, pieces + 1)[:-1]
        side = fillet * np.array([0.12, 0.3, 0.6, 1.2, 2.0, 3.0, 4.4, 6.0])
        turns = int(np.ceil(np.pi / 2 * fillet / fine.rim_piece))
        _, angle = self.polar(*outline.along(np.append(inside, shoulder), turns, side))
        both = np.concatenate([-angle[:0:-1], angle])
        knots = np.concatenate([[both[0]] * 3, both, [both[-1]] * 3])
        count = len(knots) - 4
        half = np.eye(count)[:, count // 2 :]
        fold = np.where(half + half[::-1] > 0, 1.0, 0.0)
        first = BSpline(knots, fold, 3)
        self.basis = (first, first.derivative(1), first.derivative(2))
        self.end, self.count = float(angle[-1]), fold.shape[1]
        bend = np.diff(np.eye(self.count), 2, axis=0)
        self.bending = bend.T @ bend
        dense = outline.along(np.linspace(0.0, edge - fillet, 800)[:-1], 400, np.linspace(0.0, 6 * fillet, 200)[1:])
        distance, angle = self.polar(*dense)
        self.start = np.linalg.lstsq(first(angle), distance, rcond=None)[0]

    def polar(self, radius: Floats, height: Floats) -> tuple[Floats, Floats]:
        """Distance from the centre and angle from the axis."""
        return np.hypot(radius, self.centre - height), np.arctan2(radius, self.centre - height)


class BoundaryPoints:
    """Integration points on a named boundary: positions, reference areas, and a matrix from a scalar's unknowns."""

    def __init__(self, ng: Any, scalar: Any, name: str, count: int) -> None:
        nodes, weights = np.polynomial.legendre.leggauss(count)
        rows: list[int] = []
        columns: list[int] = []
        values: list[float] = []
        where: list[list[float]] = []
        area: list[float] = []
        level: list[float] = []  # areas projected along the axis
        for element in scalar.Elements(ng.BND):
            if element.mat != name:
                continue
            functions, map_, numbers = scalar.GetFE(ng.ElementId(ng.BND, element.nr)), element.GetTrafo(), element.dofs
            for x, weight in zip((nodes + 1) / 2, weights / 2, strict=True):
                point, tangent = map_(x, 0, 0).point, np.array(map_(x, 0, 0).jacobi).ravel()
                rows += [len(where)] * len(numbers)
                columns += list(numbers)
                values += list(functions.CalcShape(x, 0, 0))
                where.append([point[0], point[1]])
                area.append(2 * np.pi * point[0] * np.linalg.norm(tangent) * weight)
                level.append(2 * np.pi * point[0] * abs(tangent[0]) * weight)
        self.where, self.area, self.level = (np.array(one) for one in (where, area, level))
        self.matrix = csr_array(coo_array((values, (rows, columns)), shape=(len(where), scalar.ndof)))
