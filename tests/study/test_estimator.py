"""The classifier within scikit-learn: its checks of estimators, and the probabilities of `train_classifier`."""

from __future__ import annotations

import importlib
import pickle
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PowerTransformer
from sklearn.utils.estimator_checks import check_fit2d_1feature, parametrize_with_checks

from tsis.errors import MissingExtraError
from tsis.study.classifier import ClassifierSettings, ClassSplit, TrainingSet, train_classifier
from tsis.study.estimator import TargetClassifier

if TYPE_CHECKING:
    from collections.abc import Callable


EXPLAINED = {
    "check_fit2d_1feature": "its ten samples have fewer than five of a class, one for each fold, so the fit is refused",
    "check_array_api_input": "scikit-learn skips it unless SCIPY_ARRAY_API is set; the classifier takes NumPy arrays",
}


@parametrize_with_checks(  # type: ignore[untyped-decorator]
    [TargetClassifier()], expected_failed_checks=lambda _: EXPLAINED, xfail_strict=False
)
def test_scikit_learn_accepts_it(estimator: TargetClassifier, check: Callable[[TargetClassifier], None]) -> None:
    check(estimator)


def test_two_folds_pass_the_check_that_five_folds_refuse() -> None:
    check_fit2d_1feature("TargetClassifier", TargetClassifier(folds=2))


def training() -> TrainingSet:
    rng = np.random.default_rng(5)
    labels = np.repeat([0, 1, 2], 40)
    features = rng.normal([10.0, 6.0, 80.0, 0.0], [2.0, 1.0, 10.0, 1.0], size=(120, 4))
    features[:, 3] += 2.0 * (labels > 0)
    features[:, 2] += 25.0 * (labels == 2)
    return TrainingSet(features=features, labels=labels)


@pytest.mark.parametrize("settings", [{}, {"penalty": 3.0, "width": 0.1, "folds": 3, "seed": 7}])
def test_its_probabilities_are_those_of_the_classifier(settings: dict[str, Any]) -> None:
    known = training()
    classifier = train_classifier(known, ClassSplit(young_kpa=80.0), ClassifierSettings(**settings))
    adapter = TargetClassifier(**settings).fit(known.features, known.labels)
    probabilities = adapter.predict_proba(known.features)
    np.testing.assert_array_equal(probabilities, classifier.probabilities(known.features))
    np.testing.assert_array_equal(adapter.predict(known.features), probabilities.argmax(axis=1))
    again = pickle.loads(pickle.dumps(adapter))
    np.testing.assert_array_equal(again.predict_proba(known.features), probabilities)


def test_it_serves_searches_and_pipelines() -> None:
    known = training()
    search = GridSearchCV(TargetClassifier(folds=2), {"penalty": [0.01, 1.0]}, cv=3).fit(known.features, known.labels)
    assert set(search.cv_results_["param_penalty"]) == {0.01, 1.0}
    assert search.best_score_ > 0.75
    scores = cross_val_score(make_pipeline(PowerTransformer(), search.best_estimator_), known.features, known.labels)
    assert scores.mean() > 0.75
    assert clone(search.best_estimator_).get_params() == search.best_estimator_.get_params()


def test_names_of_classes_are_kept() -> None:
    known = training()
    names = np.array(["none", "soft", "stiff"])
    adapter = TargetClassifier().fit(known.features, names[known.labels])
    assert adapter.classes_.tolist() == names.tolist()
    assert set(adapter.predict(known.features)) <= set(names)


@pytest.mark.parametrize(
    ("settings", "says"), [({"penalty": 0.0}, "penalty must lie"), ({"folds": 1}, "folds must lie")]
)
def test_settings_out_of_range_are_refused(settings: dict[str, Any], says: str) -> None:
    known = training()
    with pytest.raises(ValueError, match=says):
        TargetClassifier(**settings).fit(known.features, known.labels)


def test_a_class_with_too_few_samples_is_refused() -> None:
    known = training()
    with pytest.raises(ValueError, match=r"5 samples of each class.*at least 4 of each in 84"):
        TargetClassifier().fit(known.features[:84], known.labels[:84])


def test_without_scikit_learn_one_sentence_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sklearn", None)
    monkeypatch.delitem(sys.modules, "tsis.study.estimator", raising=False)
    with pytest.raises(MissingExtraError, match=r'scikit-learn, which is not installed; .*"tsis\[study\]"$'):
        importlib.import_module("tsis.study.estimator")
