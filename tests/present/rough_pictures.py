"""Pictures of reports without layout and rendering, for tests that look at other things of a report."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest
from matplotlib.figure import Figure

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.present.page import Picture


@contextmanager
def rough_pictures() -> Iterator[None]:
    """Draw one picture of each title, and spare its layout and rendering."""
    titles = set[str]()

    @contextmanager
    def figure(picture: Picture, size: tuple[float, float], *, dpi: float, **_: str) -> Iterator[Figure]:
        if picture.title not in titles:
            picture.draw(Figure(figsize=size))
            titles.add(picture.title)
        yield Figure(figsize=(0.1, 0.1), dpi=dpi)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tsis.present.page._figure", figure)
        yield
