"""Three classes of targets, beside scikit-learn called directly and the probabilities that made the targets."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.special import expit
from sklearn.calibration import CalibratedClassifierCV
from sklearn.metrics import brier_score_loss, confusion_matrix
from sklearn.metrics import log_loss as sklearn_log_loss
from sklearn.model_selection import StratifiedKFold
from sklearn.pipeline import Pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC

import tsis
from tsis.errors import FileInputError, InputError
from tsis.model.estimate import Estimate
from tsis.model.phantom import Inclusion
from tsis.study.classifier import (
    Classifier,
    ClassifierSettings,
    ClassSplit,
    TargetEvidence,
    TrainingSet,
    cross_validate,
    read_classifier,
    target_evidence,
    train_classifier,
    write_classifier,
)
from tsis.study.proportions import wilson_interval

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray


SPLIT = ClassSplit(young_kpa=80.0)


def _study(
    targets: int, *, error_kpa: float = 12.0, draws: int = 40, seed: int = 1
) -> tuple[list[TargetEvidence], list[Inclusion | None]]:
    """Targets of which a third are empty; moduli are read with a normal error, which the samples state."""
    rng = np.random.default_rng(seed)
    readings, truth = [], []
    for index in range(targets):
        there = index % 3 > 0
        true = rng.uniform((2, 4, 40), (15, 12, 120))
        ratio = rng.normal(4.0 if there else -2.0, 3.0)
        at = true + rng.normal(size=3) * (0.5, 0.5, error_kpa)
        samples = np.maximum(at + rng.normal(size=(draws, 3)) * (0.5, 0.5, error_kpa), 0.5)
        readings.append(TargetEvidence(samples=samples, log_ratio=float(ratio)))
        one = Inclusion(diameter_mm=float(true[0]), depth_mm=float(true[1]), young_kpa=float(true[2]))
        truth.append(one if there else None)
    return readings, truth


STUDY = _study(150)
TRAINING = TrainingSet.of(*STUDY, SPLIT)
FITTED = train_classifier(TRAINING, SPLIT)


def _by_hand(features: NDArray[np.float64], labels: NDArray[np.int64]) -> Any:
    machine = Pipeline([("scale", StandardScaler()), ("svc", SVC(C=1.0, kernel="rbf", gamma=0.25))])
    folds = StratifiedKFold(n_splits=5, shuffle=True, random_state=0)
    return CalibratedClassifierCV(machine, method="sigmoid", cv=folds).fit(features, labels)


def test_probabilities_are_those_of_scikit_learn_called_directly() -> None:
    model = _by_hand(np.array([one.at_mean for one in STUDY[0]]), np.array(SPLIT.labels(STUDY[1])))
    reading = STUDY[0][7]
    found = FITTED.classify(reading)
    features = np.column_stack([reading.samples, np.full(40, np.arcsinh(reading.log_ratio))])
    assert list(found.probabilities.values()) == pytest.approx(model.predict_proba(features).mean(axis=0), abs=1e-12)
    mean = np.append(reading.samples.mean(axis=0), np.arcsinh(reading.log_ratio))
    assert list(found.at_mean.values()) == pytest.approx(model.predict_proba(mean[None])[0], abs=1e-12)
    both = np.array([list(found.probabilities.values()), list(found.at_mean.values())])
    assert found.difference == pytest.approx(np.abs(both[0] - both[1]).max())
    assert found.likeliest == SPLIT.names[int(both[0].argmax())]


def test_validation_is_that_of_a_plain_loop_with_scikit_learns_losses() -> None:
    result: list[tuple[int, int]] = []
    found = cross_validate(*STUDY, SPLIT, folds=4, progress=lambda done, total: result.append((done, total)))
    features, labels = TRAINING.features, np.asarray(TRAINING.labels)
    mean = np.empty((len(labels), 3))
    for kept, out in StratifiedKFold(4, shuffle=True, random_state=0).split(features, labels):
        model = _by_hand(features[kept], labels[kept])
        for index in out:
            mean[index] = model.predict_proba(STUDY[0][index].rows).mean(axis=0)
    assert np.abs(found.probabilities - mean).max() < 1e-12
    assert found.log_loss == pytest.approx(sklearn_log_loss(labels, mean))
    assert found.brier == pytest.approx(brier_score_loss(labels, mean, scale_by_half=False, labels=[0, 1, 2]))
    table = confusion_matrix(labels, mean.argmax(axis=1))
    assert (found.confusion == table).all()
    right = found.proportion(2, 2)
    assert right.interval() == wilson_interval(int(table[2, 2]), int(table[2].sum()))
    assert found.accuracy.successes == np.trace(table)
    assert result == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_no_target_is_judged_by_a_classifier_that_knew_it() -> None:
    readings, truth = STUDY
    rng = np.random.default_rng(3)
    shuffled = [truth[index] for index in rng.permutation(len(truth))]  # which nothing tells
    found = cross_validate(readings, shuffled, SPLIT, ClassifierSettings(penalty=100.0, width=5.0))
    shares = np.bincount(SPLIT.labels(shuffled)) / len(shuffled)
    assert found.log_loss > -np.sum(shares * np.log(shares)) - 0.02  # that of who always says the shares
    assert found.accuracy.value < shares.max() + 0.1


def test_an_uncertain_modulus_makes_an_uncertain_class() -> None:
    sharp = np.tile([8.0, 6.0, 110.0], (50, 1))
    wide = sharp.copy()
    wide[:, 2] = np.linspace(45.0, 175.0, 50)  # of the same mean
    known, unknown = (FITTED.classify(TargetEvidence(samples=one, log_ratio=9.0)) for one in (sharp, wide))
    stiff = SPLIT.names[2]
    assert known.probabilities[stiff] == pytest.approx(known.at_mean[stiff])
    assert known.difference < 1e-12
    assert unknown.at_mean[stiff] == pytest.approx(known.at_mean[stiff])
    assert unknown.probabilities[stiff] < known.probabilities[stiff] - 0.1
    assert unknown.difference > 0.1


def test_sigmoid_and_isotonic_probabilities_come_true() -> None:
    readings, truth = _study(600, draws=4, seed=5)
    for calibration in ("sigmoid", "isotonic"):
        found = cross_validate(readings, truth, SPLIT, ClassifierSettings(calibration=calibration))
        empty = found.probabilities[:, 0]
        there = found.labels == 0
        for low, high in ((0.0, 0.2), (0.2, 0.8), (0.8, 1.0)):
            within = (empty >= low) & (empty <= high)
            error = np.sqrt(max(empty[within].mean() * (1 - empty[within].mean()), 0.01) / within.sum())
            assert there[within].mean() == pytest.approx(empty[within].mean(), abs=4 * error)
        # the ratio alone parts empty targets from others; it was drawn, so the best loss is known
        ratio = np.array([one.log_ratio for one in readings])
        best = expit(((ratio - 4) ** 2 - (ratio + 2) ** 2) / 18 + np.log(0.5))
        right = np.mean((best > 0.5) == there)
        assert np.mean((empty > 0.5) == there) > right - 0.05


def test_a_target_on_a_limit_is_not_beyond_it_and_depths_count_from_the_skin() -> None:
    split = ClassSplit(young_kpa=60.0, diameter_mm=5.0, depth_mm=8.0)
    inside = Inclusion(diameter_mm=5.1, depth_mm=7.9, young_kpa=60.1)
    assert split.label(inside) == 2
    for changed in ({"diameter_mm": 5.0}, {"depth_mm": 8.0}, {"young_kpa": 60.0}):
        assert split.label(replace(inside, **changed)) == 1  # type: ignore[arg-type]
    assert split.label(None) == 0
    assert split.names[2] == "stiffer than 60 kPa and larger than 5 mm and shallower than 8 mm"


def test_an_estimates_samples_are_taken_evenly() -> None:
    rng = np.random.default_rng(2)
    columns = rng.uniform(1, 10, (3, 1000))
    made = Estimate(
        samples=dict(zip(tsis.inclusion.prior.PARAMETERS, columns, strict=True)),
        prior_sd=dict.fromkeys(tsis.inclusion.prior.PARAMETERS, 1.0),
        presence=0.9,
        provenance={"prior": {"presence": 0.5}},
    )
    found = target_evidence(made, draws=10)
    assert found.log_ratio == pytest.approx(np.log(9.0))
    assert (found.samples == columns.T[[round(one) for one in np.linspace(0, 999, 10)]]).all()
    assert len(target_evidence(made, draws=5000).samples) == 1000
    with pytest.raises(InputError, match="it has none of diameter_mm, young_kpa"):
        target_evidence(Estimate(samples={"depth_mm": np.ones(1)}, prior_sd={"depth_mm": 1.0}, presence=0.5), prior=0.5)


def test_a_file_gives_the_same_classifier_back(tmp_path: Path) -> None:
    path = write_classifier(FITTED, tmp_path / "classes.json")
    back = read_classifier(path)
    assert back.notes == ()
    assert (back.split, back.settings) == (FITTED.split, FITTED.settings)
    grid = np.random.default_rng(1).uniform((1, 4, 40, -10), (15, 12, 120, 10), (50, 4))
    assert (back.probabilities(grid) == FITTED.probabilities(grid)).all()
    assert path.read_bytes() == write_classifier(back, tmp_path / "again.json").read_bytes()
    assert b"Research use only" in path.read_bytes()


def _rewritten(path: Path, **changed: Any) -> Path:
    """The file with other content and the hash that belongs to it."""
    from tsis.study.classifier import _serialised, classifier_sha256

    content = json.loads(path.read_bytes())
    content.pop("sha256")
    content |= changed
    path.write_bytes(_serialised(content | {"sha256": classifier_sha256(content)}))
    return path


def test_another_version_whose_probabilities_differ_is_said_and_the_same_one_is_refused(tmp_path: Path) -> None:
    path = write_classifier(FITTED, tmp_path / "classes.json")
    content = json.loads(path.read_bytes())
    other = [[row[1], row[0], row[2]] for row in content["probabilities"]]
    with pytest.raises(FileInputError, match="though the same versions made it"):
        read_classifier(_rewritten(path, probabilities=other))
    older = content["made_with"] | {"scikit-learn": "1.6.0"}
    back = read_classifier(_rewritten(path, made_with=older))
    assert "scikit-learn 1.6.0 then" in back.notes[0]
    assert isinstance(back, Classifier)
    assert read_classifier(_rewritten(path, probabilities=content["probabilities"])).notes == ()  # another, but alike


def _hostile(content: dict[str, Any]) -> list[tuple[dict[str, Any], str]]:
    few = [[1.0, 4.0, 40.0, 0.0, 0]] * 3
    return [
        ({"format": "a pickle"}, "must be a 'tsis classifier'"),
        ({"extra": 1}, "'extra' is missing or unknown"),
        ({"made_with": {"scikit-learn": "1"}}, "must name the versions"),
        ({"made_with": "\x1b[2J" * 1000}, "must name the versions"),
        ({"split": {}}, "at least one of"),
        ({"split": {"colour": 1}}, "something unknown"),
        ({"split": [1]}, "something unknown"),
        ({"settings": {"penalty": 1e9}}, "penalty must lie"),
        ({"settings": {"calibration": "__import__('os')"}}, "calibration must be one of"),
        ({"targets": few}, "must have at least 5 targets"),
        ({"targets": [[1.0] * 5] * 5001}, "1 to 5000 rows"),
        ({"targets": "many"}, "1 to 5000 rows"),
        ({"targets": [[1.0, 4.0, 40.0, 0.0, 7]] * 9}, "class must lie in"),
        ({"targets": [["1", 4.0, 40.0, 0.0, 1]] * 9}, "must be an array of numbers"),
        ({"targets": [[-1.0, 4.0, 40.0, 0.0, 1]] * 9}, "must be positive sizes"),
        ({"probabilities": content["probabilities"][:2]}, "8 rows of 3"),
        ({"probabilities": [["a"]]}, "must be an array of numbers"),
    ]


def test_hostile_files_are_one_sentence(tmp_path: Path) -> None:
    path = write_classifier(FITTED, tmp_path / "classes.json")
    whole = path.read_bytes()
    for changed, said in _hostile(json.loads(whole)):
        path.write_bytes(whole)
        with pytest.raises(FileInputError, match=said) as raised:
            read_classifier(_rewritten(path, **changed))
        assert "\n" not in str(raised.value)
        assert len(str(raised.value)) < 500
        assert str(raised.value).isprintable()
    for content, said in (
        (whole.replace(b"0", b"1", 1), "does not match its own hash"),
        (whole[: len(whole) // 2], "must be a readable JSON file"),
        (b"\x80\x04\x95", "must be a readable JSON file"),
        (b"{" + b" " * (3 * 2**20) + b"}", "at most"),
        (b'{"a":' * 3000, "must be"),
        (b'{"format":"tsis classifier","version":1}', "is missing or unknown"),
    ):
        path.write_bytes(content)
        with pytest.raises(FileInputError, match=said):
            read_classifier(path)
    with pytest.raises(FileInputError, match="does not exist"):
        read_classifier(tmp_path / "none.json")
    with pytest.raises(FileInputError, match="must be writable"):
        write_classifier(FITTED, tmp_path / "no folder" / "classes.json")


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: ClassSplit(), "at least one of"),
        (lambda: ClassSplit(young_kpa=float("nan")), "young_kpa must"),
        (lambda: SPLIT.label("lump"), "inclusion must be a Inclusion"),  # type: ignore[arg-type]
        (lambda: TargetEvidence(samples=np.ones((3, 2)), log_ratio=0.0), "samples must hold"),
        (lambda: TargetEvidence(samples=np.zeros((3, 3)), log_ratio=0.0), "samples must hold"),
        (lambda: TargetEvidence(samples=np.ones((3, 3)), log_ratio=float("nan")), "log_ratio must"),
        (lambda: ClassifierSettings(folds=1), "folds must lie"),
        (lambda: TrainingSet.of([], [], SPLIT), "equally many"),
        (lambda: TrainingSet.of(STUDY[0][:3], STUDY[1][:2], SPLIT), "got 3 and 2"),
        (
            lambda: train_classifier(TrainingSet.of(STUDY[0][:6], STUDY[1][:6], SPLIT), SPLIT),
            "must have at least 5 targets",
        ),
        (lambda: cross_validate(STUDY[0][:15], STUDY[1][:15], SPLIT), "must have at least 7 targets"),
        (lambda: cross_validate(STUDY[0], [None] * 150, SPLIT), "'softer than 80 kPa' must have at least"),
    ],
)
def test_bad_input_is_one_sentence(call: Any, said: str) -> None:
    with pytest.raises(InputError, match=said):
        call()
