"""A registration goes through pickle and copy."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

from tsis.matching import register
from tsis.matching.registration import METHODS


@pytest.mark.parametrize("method", METHODS)
def test_a_registration_pickles(method: str) -> None:
    rng = np.random.default_rng(0)
    source = rng.uniform(size=(30, 2))
    registration = register(source, source + 0.01 * rng.normal(size=source.shape), method=method)
    for again in (pickle.loads(pickle.dumps(registration)), copy.deepcopy(registration)):
        np.testing.assert_array_equal(again.transform(source), registration.transform(source))
        np.testing.assert_array_equal(again.matches, registration.matches)
