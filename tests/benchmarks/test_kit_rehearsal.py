"""The rehearsal of the validation kit: its bench tests come by another path, and the whole of it ends in a score."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.kit_rehearsal import bench_table, held_cylinder_force, made_phantoms, measured_phantoms, rehearse

from tsis.inclusion import InclusionPrior
from tsis.mechanics.bench_tests import bonded_factor
from tsis.study.kit import bench_moduli
from tsis.study.readings import read_truth_table

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize(("diameter", "height"), [(20.0, 15.0), (20.0, 10.0), (10.0, 30.0)])
def test_ritz_and_finite_elements_agree_on_a_held_cylinder(diameter: float, height: float) -> None:
    force = held_cylinder_force(10.0, np.array([1.0]), diameter_mm=diameter, height_mm=height, terms=8)
    free = 1e-3 * 10.0 * np.pi * diameter**2 / 4 / height
    expected = bonded_factor(diameter, height, 0.4999)
    assert expected < force[0] / free < 1.005 * expected  # a bound from above


@pytest.mark.slow
def test_the_bench_finds_the_moduli_within_what_poissons_ratio_moves(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    made = made_phantoms(rng)
    (tmp_path / "phantoms.csv").write_bytes(measured_phantoms(made, rng))
    (tmp_path / "modulus.csv").write_bytes(bench_table(made, rng))
    found = bench_moduli(tmp_path / "modulus.csv")
    assert [found[label].young_kpa for label in ("1", "6", "tissue")] == pytest.approx(
        [made.young_kpa[batch] for batch in ("A", "B", "tissue")], rel=0.05
    )
    sealed = read_truth_table(tmp_path / "phantoms.csv")
    assert [target.has_inclusion for target in sealed] == [True] * 7 + [False] * 3
    prior = InclusionPrior()
    for target in made.targets:  # what is cast lies inside what is believed
        for name, value in target.values.items():
            low, high = getattr(prior, name)
            assert low < value < high


@pytest.mark.slow
def test_the_whole_validation_is_rehearsed(tmp_path: Path) -> None:
    folder = tmp_path / "kit"
    _, score = rehearse(folder, law="growing", probe_name="tsis-domed", seed=11, repeats=1, strain="small")
    by = {item.quantity: item for item in score.quantities}
    assert by["diameter_mm"].count == by["depth_mm"].count == by["young_kpa"].count >= 12
    # Depths are read more finely than the pours are known: the interval alone need not hold what was measured.
    assert all(item.hits_widened >= 9 for item in by.values())
    assert score.counts is not None
    assert score.counts.false_positives == 0
    assert not score.of_recipe
    assert score.faults == 0
    assert (folder / "score.pdf").read_bytes().startswith(b"%PDF")
    again = rehearse(folder, law="growing", probe_name="tsis-domed", seed=11, repeats=1, strain="small")[1]
    assert again.quantities == score.quantities  # a second run takes up what is there
