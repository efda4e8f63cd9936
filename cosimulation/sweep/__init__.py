"""Many runs over models, signals, parameters and seeds, on this machine or a Dask cluster."""

from __future__ import annotations

from cosimulation.sweep.job import SweepResult, run_sweep
from cosimulation.sweep.settings import SweepSettings

__all__ = ["SweepResult", "SweepSettings", "run_sweep"]
