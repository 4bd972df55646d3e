"""Shape of the lit part of a press: two-means threshold, ellipse and outline, (6.11), (6.12) and (6.13)."""

from tsis.inclusion.shape._outline import ObjectShape, object_shape
from tsis.inclusion.shape._threshold import TwoMeans, two_means

__all__ = ["ObjectShape", "TwoMeans", "object_shape", "two_means"]
