"""Small detection studies that hypothesis draws."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

Study = tuple[np.ndarray, np.ndarray]


@st.composite
def studies(draw: st.DrawFn) -> Study:
    """Scores with many ties, and both kinds of target."""
    m, n = draw(st.integers(1, 12)), draw(st.integers(1, 12))
    scores = draw(st.lists(st.integers(-5, 5), min_size=m + n, max_size=m + n))
    order = draw(st.permutations(range(m + n)))
    return np.array(scores, dtype=float), np.array(order) < m
