"""Drives an FMU through fmpy by the row rule: set the inputs, read the outputs, step."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import fmpy
import numpy as np
from fmpy import calloc, free
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from numpy.typing import NDArray

Array = NDArray[np.float64]

QUIET = fmi2CallbackFunctions()
"""Callbacks that hear nothing and never go away: fmpy's own keep a dead logger once another one was used."""
QUIET.logger = fmi2CallbackLoggerTYPE(lambda *_: None)
QUIET.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
QUIET.freeMemory = fmi2CallbackFreeMemoryTYPE(free)


@contextmanager
def opened(path: Path, inputs: Array, ready: bool = True) -> Iterator[tuple[FMU2Slave, dict[str, int]]]:
    """An FMU with these inputs, and the value references of its variables.

    It stands in step mode, or in initialisation mode when it is not `ready`.
    """
    description = fmpy.read_model_description(str(path))
    controls = [v.valueReference for v in description.modelVariables if v.causality == "input"]
    unpacked = fmpy.extract(str(path))
    slave = FMU2Slave(
        guid=description.guid,
        unzipDirectory=unpacked,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="test",
    )
    try:
        slave.instantiate(callbacks=QUIET)
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.setReal(controls, inputs.tolist())
        if ready:
            slave.exitInitializationMode()
        yield slave, {variable.name: variable.valueReference for variable in description.modelVariables}
        slave.freeInstance()
    finally:
        shutil.rmtree(unpacked, ignore_errors=True)


def run_fmu(path: Path, inputs: Array, names: Sequence[str], sample_time: float) -> Array:
    """Outputs [N, len(names)]; row k is read after the inputs of row k were set and before the step."""
    rows = []
    boolean = [name == "in_range" for name in names]
    with opened(path, inputs[0]) as (slave, references):
        wanted = [references[name] for name in names]
        for k, row in enumerate(inputs):
            slave.setReal(list(range(len(row))), row.tolist())
            rows.append(slave.getBoolean(wanted) if all(boolean) else slave.getReal(wanted))
            slave.doStep(currentCommunicationPoint=k * sample_time, communicationStepSize=sample_time)
    return np.array(rows)
