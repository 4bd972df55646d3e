"""How well and how fast points are matched, beside other programs, on the same trials in one run."""

from __future__ import annotations

from pathlib import Path

DATA = Path(__file__).resolve().parents[2] / "shared" / "data" / "matching"
