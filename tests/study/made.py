"""Studies for tests, read by a device that needs no press."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.study.folder import new_study, printed_targets, read_seal
from tsis.study.readings import import_readings

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.study.folder import Study

HEADINGS = "code,score,operator,repeat,diameter_mm,depth_mm,young_kpa"


def made_study(folder: Path, *, present: int = 8, blank: int = 8, seed: int | None = 3, repeats: int = 1) -> Study:
    return new_study(
        folder, printed_targets(present, blank), seed=seed, probe="tsis-2011", repeats=repeats, actor="maker"
    )


def table(study: Study, *, seed: int = 0, apart: float = 1.0, operators: tuple[str, ...] = ("Cleo",)) -> str:
    """A device that scores inclusions higher by ``apart`` of its scatter, with sizes that miss by a tenth."""
    rng, rows = np.random.default_rng(seed), [HEADINGS]
    truths = read_seal(study)[0].truths
    for operator in operators:
        for repeat in range(1, study.plan.repeats + 1):
            for code in study.plan.codes:
                truth = truths[code]
                score = float(
                    np.clip(0.5 + 0.2 * (apart * (truth.has_inclusion - 0.5) + rng.standard_normal()), 0.0, 1.0)
                )
                sizes = [f"{value * (1 + 0.1 * rng.standard_normal()):.3f}" for value in truth.values.values()]
                rows.append(",".join([code, f"{score:.4f}", operator, str(repeat), *(sizes or ["", "", ""])]))
    return "\n".join(rows) + "\n"


def read_study(folder: Path, *, device: str = "feeler", apart: float = 1.0, **options: int) -> Study:
    study = made_study(folder / "study", **options)
    (folder / "readings.csv").write_text(table(study, apart=apart), encoding="utf-8")
    return import_readings(study, folder / "readings.csv", device=device, actor="Cleo")
