from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.present.rough_pictures import rough_pictures

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture(scope="module", autouse=True)
def _rough_pictures() -> Iterator[None]:
    """Draw one picture of each title in a file and render none: tests of reports look at those."""
    with rough_pictures():
        yield
