"""Points and their smooth deformations, made by sines: no method here has a model that holds them exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest


@dataclass(frozen=True)
class Warped:
    """Points, where each of them went, and the target: those places shuffled."""

    source: np.ndarray
    truth: np.ndarray
    order: np.ndarray

    @property
    def target(self) -> np.ndarray:
        return np.asarray(self.truth[self.order])

    def goes(self, points: np.ndarray) -> np.ndarray:
        """The deformation itself."""
        return np.asarray(points + 0.08 * np.sin(1.7 * points[:, ::-1] + np.arange(points.shape[1])))

    def right(self, matches: np.ndarray) -> float:
        """Share of the source points that are matched with their own places."""
        return float(np.mean(np.where(matches >= 0, self.order[matches], -1) == np.arange(len(self.source))))

    def rms(self, moved: np.ndarray) -> float:
        return float(np.sqrt(np.mean(np.sum((moved - self.truth) ** 2, axis=1))))


@pytest.fixture(params=[2, 3], ids=["plane", "space"])
def warped(request: pytest.FixtureRequest) -> Warped:
    """Some 80 points, not two of them close together, of unit root-mean-square radius."""
    rng = np.random.default_rng(7)
    grid = np.stack(np.meshgrid(*[np.arange(-12.0, 13.0)] * request.param), axis=-1).reshape(-1, request.param)
    scattered = grid + rng.uniform(-0.35, 0.35, grid.shape)
    reach = {2: 5.2, 3: 2.75}[request.param]
    source = scattered[np.linalg.norm(scattered * np.linspace(1, 1.4, request.param), axis=1) < reach]
    source -= source.mean(axis=0)
    source /= np.sqrt(np.mean(np.sum(source**2, axis=1)))
    pair = Warped(source, source, np.argsort(rng.random(len(source))))
    return Warped(source, pair.goes(source), pair.order)
