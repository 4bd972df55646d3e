"""What R says of data drawn once: pROC's areas, variances and tests, psych's intraclass correlations."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

REFERENCES: dict[str, Any] = json.loads(Path(__file__).with_name("reference_values.json").read_text(encoding="utf-8"))
