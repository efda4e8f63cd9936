"""Study: which order a local model needs (thesis Figure 4.20), and what reducing it to six states costs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field

from cosimulation.pantograph import INPUTS, OUTPUTS, SIGNALS
from cosimulation.study.data import Noise, centres, noisy, operating_points, study_data
from cosimulation.study.runner import StudySettings
from fmu_builder.errors import IdentificationError
from fmus.wbm import parameter_sets
from identification.arrays import Array
from identification.data_set import DataSet
from identification.local_model import LocalModel
from identification.scores import records
from identification.subspace import SubspaceSettings, estimate

NAMES = {0.75: "OP25", 1.25: "OP45", 1.75: "OP65", 2.25: "OP85"}
"""The thesis's names of the operating points (section 4.2)."""
FULL, REDUCED = "full order", "reduced"


class OrderSettings(StudySettings):
    """Tables of `order.toml`."""

    orders: tuple[int, ...] = (6, 8, 10, 12, 14, 17, 20, 25, 30, 40, 50)
    reduced_to: int = 6
    stabilisation: Literal["none", "reflect"] = Field(
        "reflect",
        description="of unstable poles at full order; noise-free data leave poles without a meaning",
    )
    least_block_rows: int = Field(50, ge=2, description="of the estimator; higher orders take more")
    noises: tuple[Noise, ...] = ("none",)
    duration: float = Field(42.0, gt=0)


@dataclass(frozen=True)
class OrderTask:
    """One white-box set, one seed, one operating point."""

    fmu: Path
    wbm: str
    seed: int
    height: float
    settings: OrderSettings


def tasks(settings: OrderSettings, fmu: Path) -> list[OrderTask]:
    """Return the independent tasks of the study."""
    return [
        OrderTask(fmu, wbm, seed, height, settings)
        for wbm in settings.sets
        for seed in settings.seeds
        for height in centres(4)
    ]


def run_task(task: OrderTask) -> list[dict[str, Any]]:
    """Return score records of all orders, training and validation set swapped (TV and VT)."""
    settings = task.settings
    experiments = (
        *operating_points([task.height], "train", settings.duration),
        *operating_points([task.height], "validation", settings.duration),
    )
    data, _ = study_data(task.fmu, task.wbm, task.seed, experiments)
    first, second = (item.data for item in data.experiments)
    found: list[dict[str, Any]] = []
    for noise in settings.noises:
        for direction, train, test in (("TV", first, second), ("VT", second, first)):
            stream = int(direction == "VT")
            training = noisy(train, noise, task.seed, stream)
            for order in settings.orders:
                for route, model in _models(training, order, settings).items():
                    labels = {
                        "wbm": task.wbm, "model": "n4sid", "llms": 1, "offsets": "affine", "route": route,
                        "order": order, "data_set": f"{NAMES.get(task.height, task.height)}{direction}",
                        "noise": noise, "seed": task.seed, "split": "test", "recommended": route == REDUCED,
                    }  # fmt: skip
                    found += _scores(task.wbm, model, test, labels)
    return found


def _models(training: DataSet, order: int, settings: OrderSettings) -> dict[str, LocalModel | None]:
    """Return the model of this order and its reduction; None where the data do not give one."""
    block_rows = max(settings.least_block_rows, order + 10)
    whole = SubspaceSettings(order=order, block_rows=block_rows, stabilisation=settings.stabilisation)
    if order <= settings.reduced_to:
        return dict.fromkeys((FULL, REDUCED), _estimated(training, whole))
    less = SubspaceSettings(order=settings.reduced_to, high_order=order, block_rows=block_rows)
    return {FULL: _estimated(training, whole), REDUCED: _estimated(training, less)}


def _estimated(training: DataSet, settings: SubspaceSettings) -> LocalModel | None:
    try:
        return estimate([training], INPUTS, OUTPUTS, settings)
    except IdentificationError:
        return None


def _scores(
    wbm: str, model: LocalModel | None, test: DataSet, labels: dict[str, Any]
) -> list[dict[str, Any]]:
    reference = test.matrix(SIGNALS)
    if model is None:
        simulated = np.full_like(reference, np.nan)
    else:
        simulated = with_forces(wbm, model.simulate(test.matrix(INPUTS)), test.column("eta"))
    return records(reference, simulated, SIGNALS, labels)


def with_forces(wbm: str, outputs: Array, eta: Array) -> Array:
    """Return the columns of `SIGNALS` from those of `OUTPUTS`: F_H and F_p follow from the motion.

    Args:
        wbm: White-box set, whose collector head is known.
        outputs: xi, xi_dot, zeta, zeta_dot, shape (rows, 4).
        eta: Contact height of the same rows [m].
    """
    head = parameter_sets()[wbm]
    xi, xi_dot, zeta, zeta_dot = outputs.T
    crossbar_force = head["k_C"] * (zeta - xi) + head["c_C"] * (zeta_dot - xi_dot)
    return np.column_stack([outputs, crossbar_force, head["k_E"] * (xi - eta)])


def table(
    records_: Sequence[dict[str, Any]], wbm: str, signal: str, route: str, noise: str
) -> dict[str, Any]:
    """Return the median FIT over the seeds: rows data sets, columns orders."""
    chosen = [
        item
        for item in records_
        if (item["wbm"], item["signal"], item["route"], item["noise"]) == (wbm, signal, route, noise)
    ]
    orders = sorted({item["order"] for item in chosen})
    sets = sorted({item["data_set"] for item in chosen})
    cells: list[list[float]] = []
    for name in sets:
        row = []
        for order in orders:
            fits = [
                -np.inf if item["fit"] is None else item["fit"]
                for item in chosen
                if item["data_set"] == name and item["order"] == order
            ]
            row.append(float(np.median(fits)) if fits else float("nan"))
        cells.append(row)
    return {"orders": orders, "data_sets": sets, "cells": cells}
