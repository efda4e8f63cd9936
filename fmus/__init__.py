"""One folder per FMU: what it is, its parameters, its scores, its own C if it has any, and the FMU itself."""

from __future__ import annotations

from fmus.registry import NAMES, NETWORKS, build, folder, model_identifier, network, path, rebuild

__all__ = ["NAMES", "NETWORKS", "build", "folder", "model_identifier", "network", "path", "rebuild"]
