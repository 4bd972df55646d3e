"""The guard that refuses tables while data are made."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from benchmarks.simulated_presses import PROTOCOLS, examine
from benchmarks.solved_data import TableReadError, solved_data

import tsis
from tsis.virtual.probe import VirtualProbe

PROBE = tsis.load_probe("tsis-domed")


@pytest.mark.parametrize("strain", [pytest.param("small", marks=pytest.mark.slow), "finite"])
def test_an_estimate_that_is_called_while_data_are_made_is_refused(strain: str) -> None:
    virtual = VirtualProbe(PROBE, rng=np.random.default_rng(1), strain="small")
    frame = virtual.press(tsis.load_phantom("size-8"), force_n=1.0)
    arguments: dict[str, Any] = {"probe": PROBE, "calibration": virtual.calibration, "strain": strain}
    with solved_data(), pytest.raises(TableReadError):
        tsis.inclusion.estimate(frame, **arguments)
    assert (
        tsis.inclusion.estimate(frame, **arguments).names == tsis.inclusion.prior.PARAMETERS
    )  # the guard is gone again


def test_presses_of_a_benchmark_need_no_table() -> None:
    case = examine(PROTOCOLS["domed"], tsis.load_phantom("size-8"), np.random.default_rng(2))
    assert [frame.force_n for frame in case.frames] == [0.5, 1.0]
