"""Local linear models from data by subspace identification, and their alignment to one set of coordinates."""

from identification.subspace.alignment import aligned
from identification.subspace.estimator import estimate
from identification.subspace.reduction import balancing_transform, reduced
from identification.subspace.settings import METHODS, SubspaceSettings

__all__ = ["METHODS", "SubspaceSettings", "aligned", "balancing_transform", "estimate", "reduced"]
