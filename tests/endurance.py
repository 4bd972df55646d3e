"""How long tests of endurance and hostility run: ``TSIS_TEST_SCALE`` multiplies their counts."""

from __future__ import annotations

import os


def scaled(count: int) -> int:
    """So many by default, which takes a minute or two; ``TSIS_TEST_SCALE=50`` takes fifty times as many."""
    return max(1, round(count * float(os.environ.get("TSIS_TEST_SCALE", "1"))))
