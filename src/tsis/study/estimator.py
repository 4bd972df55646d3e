"""The classifier as an estimator of scikit-learn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

import numpy as np

from tsis.errors import import_extra
from tsis.study.classifier import ClassifierSettings, calibrated_machine

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


import_extra("sklearn", feature="a classifier for scikit-learn", extra="study")

from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted, validate_data


class TargetClassifier(ClassifierMixin, BaseEstimator):  # type: ignore[misc]
    """`tsis.study.classifier.train_classifier` as an estimator of scikit-learn, for any features and classes.

    Trained on the features and labels of a `TrainingSet`, its probabilities are those of the `Classifier`. It serves
    pipelines, searches of settings and cross-validation of scikit-learn; it needs the extra ``study``.

    Parameters
    ----------
    penalty, width, calibration, folds, seed
        As in `ClassifierSettings`.

    Attributes
    ----------
    classes_
        The classes in ascending order, shape (classes,).
    model_
        The fitted pipeline.
    n_features_in_
        Number of features.

    Examples
    --------
    >>> x = np.linspace(-1.0, 1.0, 40)[:, None]
    >>> TargetClassifier().fit(x, x[:, 0] > 0).predict([[-0.9], [0.9]]).tolist()
    [False, True]
    """

    def __init__(
        self,
        penalty: float = 1.0,
        width: float | None = None,
        calibration: str = "sigmoid",
        folds: int = 5,
        seed: int = 0,
    ) -> None:
        self.penalty = penalty
        self.width = width
        self.calibration = calibration
        self.folds = folds
        self.seed = seed

    def fit(self, X: ArrayLike, y: ArrayLike) -> Self:
        """Fit features of shape (n, features) and labels of shape (n,), with at least ``folds`` of each class.

        Raises `ValueError` when a setting is out of range, the arrays do not fit together, or a class has too few
        samples.
        """
        settings = ClassifierSettings(
            penalty=self.penalty, width=self.width, calibration=self.calibration, folds=self.folds, seed=self.seed
        )
        features, labels = validate_data(self, X, y)
        check_classification_targets(labels)
        self.classes_, numbers = np.unique(labels, return_inverse=True)
        fewest = int(np.bincount(numbers).min())
        if len(self.classes_) < 2 or fewest < settings.folds:
            raise ValueError(
                f"y must have at least 2 classes and {settings.folds} samples of each class, one a fold; got "
                f"{len(self.classes_)} class(es) and at least {fewest} of each in {len(labels)} sample(s)"
            )
        self.model_ = calibrated_machine(settings).fit(features, numbers)
        return self

    def predict_proba(self, X: ArrayLike) -> NDArray[np.float64]:
        """Probability of each class, shape (n, classes)."""
        check_is_fitted(self)
        probabilities: NDArray[np.float64] = self.model_.predict_proba(validate_data(self, X, reset=False))
        return probabilities

    def predict(self, X: ArrayLike) -> NDArray[Any]:
        """The likeliest class of each row, shape (n,)."""
        check_is_fitted(self)
        likeliest: NDArray[Any] = self.classes_[self.predict_proba(X).argmax(axis=1)]
        return likeliest
