from __future__ import annotations

import numpy as np
import pytest
from benchmarks.matching.methods import OWN_METHODS, RIVAL_METHODS, BenchmarkMethod
from benchmarks.matching.trials import generated_trials

from tsis.errors import InputError
from tsis.matching import register


@pytest.mark.parametrize("name", OWN_METHODS)
def test_a_method_is_judged_by_what_the_entry_answers(name: str) -> None:
    (trial,) = generated_trials(shape="strokes", family="deformation", level=1, count=1, points=40)
    found = register(trial.source, trial.target, method=name, rng=np.random.default_rng(1))
    judged = BenchmarkMethod(name=name)(trial.source, trial.target, rng=np.random.default_rng(1))
    assert found.reliable
    assert judged.reliable
    np.testing.assert_allclose(judged.transformed, found.moved, atol=1e-12)
    assert BenchmarkMethod(name=name).absent() == ""


def test_an_answer_that_the_entry_withholds_is_judged_all_the_same() -> None:
    rng = np.random.default_rng(2)
    source, target = rng.uniform(size=(40, 2)), rng.uniform(size=(4000, 2))
    judged = BenchmarkMethod(name="cpd")(source, target, rng=rng)
    assert not register(source, target, method="cpd").reliable
    assert judged.reliable is False
    assert not np.allclose(judged.transformed, source)


def test_names_that_do_not_exist_are_refused() -> None:
    with pytest.raises(InputError, match="did you mean 'pycpd'"):
        BenchmarkMethod(name="pycdp")
    assert "cpd" in RIVAL_METHODS
