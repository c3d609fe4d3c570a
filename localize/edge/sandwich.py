"""What every fit of an edge answers: where it stands, and a covariance that its residuals show."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.solve import STEP, inverse
from conespot.scene.scene import Scene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class EdgeFit(ABC):
    """A fit whose residuals along the outlines err together."""

    estimate: Estimate
    #: of the pose and the free quantities `[P, P]`, priors included, if all bins or strips erred by themselves
    information: Array
    prior: Array  #: the priors' whitened rows `[Q, P]`
    step: Array  #: the last `[P]`
    covered: float  #: share of the outlines that was looked at
    knowns: Knowns  #: by which it was fitted

    @property
    @abstractmethod
    def misfit(self) -> float:
        """Rms of the residuals, outliers cut, over what the model expects."""

    @property
    def likelihood(self) -> float | None:
        """Log-likelihood of the bins, one in the mean; None for a fit that counts no bins."""
        return None

    @abstractmethod
    def scatter(self) -> Array:
        """Covariance of the gradient `[P, P]` as the residuals show it, priors included."""

    @abstractmethod
    def suspicions(self, nominal: Scene) -> dict[str, float]:
        """Scores of beam and wall where the fit stands, over their sigmas: see `model.suspicion`."""

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the pose and the free quantities `[P, P]`: a sandwich of the two."""
        bread = inverse(self.information)
        return np.asarray(bread @ self.scatter() @ bread)

    @property
    def settled(self) -> bool:
        """Whether the last step was short."""
        return float(self.step @ np.linalg.solve(self.covariance, self.step)) < STEP.settled_sigmas**2

    @property
    def correlation(self) -> float:
        """How much larger the covariance is than if all erred by themselves."""
        return float(np.trace(self.covariance @ self.information)) / len(self.information)
