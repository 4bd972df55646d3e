"""Stiffness matrices of axisymmetric quadratic quadrilaterals with scikit-fem."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import csr_matrix


def assembled(columns: int, rows: int, young_kpa: float, poisson: float) -> csr_matrix[Any]:
    """Stiffness of a cylinder of 10 mm radius and height in ``columns`` by ``rows`` elements of nine nodes."""
    import skfem
    from skfem.helpers import ddot, grad

    mesh = skfem.MeshQuad.init_tensor(np.linspace(0, 10, columns + 1), np.linspace(0, 10, rows + 1))
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementQuad2()), intorder=4)
    lame, shear = young_kpa * poisson / (1 + poisson) / (1 - 2 * poisson), young_kpa / 2 / (1 + poisson)

    def energy(u: Any, v: Any, w: Any) -> Any:
        radius = w.x[0]
        slopes = [grad(field) for field in (u, v)]
        shears = [slope + slope.swapaxes(0, 1) for slope in slopes]
        hoops = [field[0] / radius for field in (u, v)]
        traces = [slope[0, 0] + slope[1, 1] + hoop for slope, hoop in zip(slopes, hoops, strict=True)]
        density = lame * traces[0] * traces[1] + shear * (ddot(*shears) / 2 + 2 * hoops[0] * hoops[1])
        return 2 * np.pi * radius * density

    return csr_matrix(skfem.BilinearForm(energy).assemble(basis))
