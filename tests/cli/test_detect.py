"""``tsis detect``: a classifier of stored targets, trained and applied as in Python."""

from __future__ import annotations

import json
from datetime import timedelta
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.records.sample import WHEN, levels, sample_calibration

from tsis.inclusion import InclusionPrior
from tsis.model.estimate import Estimate
from tsis.model.image import TactileImage
from tsis.model.phantom import Inclusion
from tsis.records.provenance import environment
from tsis.records.store import open_store
from tsis.study.classifier import (
    ClassifierSettings,
    ClassSplit,
    TrainingSet,
    read_classifier,
    target_evidence,
    train_classifier,
)

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis

    from tsis.records.store import Store

TRUTH = {
    **dict.fromkeys(range(1, 7)),
    **{number: Inclusion(diameter_mm=8.0, depth_mm=5.0, young_kpa=45.0) for number in range(7, 13)},
    **{number: Inclusion(diameter_mm=8.0, depth_mm=5.0, young_kpa=100.0) for number in range(13, 19)},
}
UNKNOWN = {19: 105.0, 20: 42.0}  # moduli that the store does not know
NAMES = ("none", "softer than 60 kPa", "stiffer than 60 kPa")


def found(number: int, inclusion: Inclusion | None) -> Estimate:
    """A posterior around the truth, or of the prior's width where there is nothing."""
    rng, prior = np.random.default_rng([8101, number]), InclusionPrior()
    if inclusion is None:
        samples = rng.uniform(prior.low, prior.high, (100, 3))
    else:
        middle = np.array([inclusion.diameter_mm, inclusion.depth_mm, inclusion.young_kpa])
        samples = middle * (1 + 0.05 * rng.standard_normal(3)) * (1 + 0.05 * rng.standard_normal((100, 3)))
    return Estimate(
        samples=dict(zip(("diameter_mm", "depth_mm", "young_kpa"), samples.T, strict=True)),
        prior_sd=prior.sd,
        presence=0.02 if inclusion is None else 0.999,
        log_bayes_factor=float(rng.normal(-4.0, 1.0) if inclusion is None else rng.normal(60.0, 5.0)),
        provenance={"prior": {"presence": 0.5}},
    )


def enter(store: Store, number: int, inclusion: Inclusion | None, *, known: bool) -> None:
    truth = {}
    if inclusion is not None and known:
        truth = {name: getattr(inclusion, name) for name in ("diameter_mm", "depth_mm", "young_kpa")}
    target = store.add_target(number=number, truth=truth)
    frame = TactileImage(grey=levels(number), force_n=1.0, name=f"t{number}.png", mm_per_pixel=(0.1, 0.1))
    calibration = sample_calibration()
    press = store.add_press(
        target, frame, taken=WHEN + timedelta(seconds=number), probe="tsis-2011", calibration=calibration
    )
    store.add_estimate(
        target,
        found(number, inclusion),
        kind="inclusion",
        presses=[press],
        probe="tsis-2011",
        calibration=calibration,
        options={},
        environment=environment(),
    )


@pytest.fixture(scope="module")
def phantoms(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("phantoms") / "records"
    with open_store(folder) as store:
        for number, inclusion in TRUTH.items():
            enter(store, number, inclusion, known=True)
        for number, young_kpa in UNKNOWN.items():
            inclusion = Inclusion(diameter_mm=8.0, depth_mm=5.0, young_kpa=young_kpa)
            enter(store, number, inclusion, known=False)
        store.add_target(
            number=21, name="never pressed", truth={"diameter_mm": 5.0, "depth_mm": 5.0, "young_kpa": 50.0}
        )
    return folder


def training(phantoms: Path, *more: str) -> tuple[str | Path, ...]:
    return ("detect", "train", "mine.json", "--young-kpa", "60", "--none", "1-4,5, 6", "--store", phantoms, *more)


def test_it_is_trained_and_applied_as_in_python(run_tsis: RunTsis, phantoms: Path, tmp_path: Path) -> None:
    finished = run_tsis(*training(phantoms, "--folds", "3", "--validate", "3", "--json"))
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    assert document["targets_by_class"] == dict.fromkeys(NAMES, 6)
    assert np.trace(document["validation"]["confusion"]) >= 16, "classes that lie far apart"
    assert sum("is left out" in note for note in document["notes"]) == 3
    split = ClassSplit(young_kpa=60)
    readings = [target_evidence(found(number, inclusion)) for number, inclusion in TRUTH.items()]
    expected = train_classifier(
        TrainingSet.of(readings, list(TRUTH.values()), split), split, ClassifierSettings(folds=3)
    )
    stored = read_classifier(tmp_path / "mine.json")
    np.testing.assert_allclose(stored.training.features, expected.training.features)
    applied = run_tsis("detect", "apply", "mine.json", "19", "20", "--store", phantoms, "--json", "--out", "reported")
    assert applied.code == 0, applied.err
    targets = json.loads(applied.out)["targets"]
    for reported, (number, young_kpa) in zip(targets, UNKNOWN.items(), strict=True):
        inclusion = Inclusion(diameter_mm=8.0, depth_mm=5.0, young_kpa=young_kpa)
        python = expected.classify(target_evidence(found(number, inclusion)))
        assert reported["probabilities"] == pytest.approx(dict(python.probabilities))
        assert reported["likeliest"] == NAMES[2 if young_kpa > 60 else 1]
    assert (tmp_path / "reported" / "result.json").exists()
    printed = run_tsis("detect", "apply", "mine.json", "1", "--store", phantoms).out
    assert "Research use only" in printed
    assert "must be a new name" in run_tsis(*training(phantoms)).err


OTHER_CODES = {"nowhere": 1}  # of messages that are no wrong input


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--none", "1-x"], "--none must be numbers of targets, as 4,9-20"),
        (["--none", "9-2"], "--none must be ranges that ascend"),
        (["--none", "77"], "there is no target 77"),
        (["--none", "8"], "target 8 has one"),
        (["--none", "1"], "the class 'none' must have at least 5 targets"),
        (["--young-kpa", "-5"], "young_kpa must lie in"),
        (["--folds", "1"], "folds must"),
        (["--store", "nowhere"], "nowhere"),
    ],
)
def test_a_training_that_cannot_be_is_refused(
    run_tsis: RunTsis, phantoms: Path, tmp_path: Path, more: list[str], message: str
) -> None:
    finished = run_tsis(*training(phantoms, *more))
    assert finished.code == next((code for text, code in OTHER_CODES.items() if text in message), 2)
    assert message in finished.err
    assert finished.err.count("\n") == 1
    assert not (tmp_path / "mine.json").exists()


def test_a_split_and_a_target_must_be_there(run_tsis: RunTsis, phantoms: Path, tmp_path: Path) -> None:
    assert "a split needs at least one of" in run_tsis("detect", "train", "mine.json", "--store", phantoms).err
    assert run_tsis(*training(phantoms, "--validate", "0")).code == 0
    apply = ("detect", "apply", "mine.json", "--store", phantoms)
    for number, message in (("21", "target 21: it has no estimate of an inclusion"), ("55", "55")):
        finished = run_tsis(*apply, number)
        assert finished.code == 2
        assert message in finished.err
    whole = (tmp_path / "mine.json").read_text()
    for text in (whole[:-40], whole.replace('"targets":[[', '"targets":[[1.5,', 1), '{"format": "tsis networks"}', "{"):
        (tmp_path / "mine.json").write_text(text)
        finished = run_tsis(*apply, "1")
        assert finished.code == 2
        assert finished.err.startswith("Error: 'mine.json'")
        assert finished.err.count("\n") == 1
