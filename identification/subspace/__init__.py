"""Local linear models from data by subspace identification, and their alignment to one set of coordinates."""

from identification.subspace.alignment import aligned
from identification.subspace.estimator import SubspaceSettings, estimate

__all__ = ["SubspaceSettings", "aligned", "estimate"]
