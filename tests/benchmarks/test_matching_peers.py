from __future__ import annotations

import numpy as np
import pytest
from benchmarks.matching.distort import public_distortion
from benchmarks.matching.methods import PEERS, Peer, peer
from benchmarks.matching.trials import generated_trials, matching_error

from tsis.errors import InputError, MissingExtraError


@pytest.mark.parametrize("name", PEERS)
def test_a_peer_matches_a_mild_warp_wherever_it_is_installed(name: str) -> None:
    chosen = peer(name)
    if chosen.absent():
        with pytest.raises(MissingExtraError, match=f"{chosen.library} must be installed"):
            chosen.transformed(np.zeros((5, 2)), np.zeros((5, 2)))
        pytest.skip(chosen.absent())
    assert public_distortion("deformation", 1).bending == 0.02
    (trial,) = generated_trials(shape="strokes", family="deformation", level=1, count=1, points=60)
    before = matching_error(trial, trial.source)
    assert matching_error(trial, chosen.transformed(trial.source, trial.target)) < before / 2


def test_absence_is_told_in_words() -> None:
    nowhere = Peer(library="no_such_library", scaling="raw")  # type: ignore[arg-type]
    assert nowhere.absent() == "no_such_library is not installed"
    with pytest.raises(InputError, match="known: biocpd"):
        peer("nobody")
