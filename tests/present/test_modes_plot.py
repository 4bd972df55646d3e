from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from tsis.optics import guided_modes
from tsis.present.figures import mode_profiles


@pytest.mark.parametrize("polarization", ["TE", "TM"])
def test_each_mode_is_drawn_at_its_index_over_the_layers(polarization: str) -> None:
    modes = guided_modes([1.41, 1.515], [9.0, 1.0], wavelength_um=0.55, polarization=polarization)  # type: ignore[arg-type]
    ax = Figure().subplots()
    assert mode_profiles(modes, ax, shown=[0, 5, 30]) is ax
    for line, number in zip(ax.lines, (0, 5, 30), strict=True):
        x, y = (np.asarray(part, dtype=float) for part in line.get_data())
        field = modes.profile(number, x)
        np.testing.assert_allclose(np.corrcoef(y, field)[0, 1], 1.0, atol=1e-12)
        level = y[np.abs(field) < 1e-3 * np.abs(field).max()]
        np.testing.assert_allclose(level, modes.n_eff[number], atol=1e-3)
    (stack,) = (patch for patch in ax.patches if hasattr(patch, "get_data"))
    assert stack.get_data().values.tolist() == [1.0, 1.41, 1.515, 1.0]
    assert [text.get_text() for text in ax.texts] == ["0", "5", "30"]
    assert "µm" in ax.get_xlabel()
