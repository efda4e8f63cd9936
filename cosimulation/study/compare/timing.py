"""Real-time factors: wall time of a co-simulation over the time it covers (thesis Table 4.4)."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from fmpy import simulate_fmu

from cosimulation.fmu_driver import FloatArray, StartValue, converted_start, running_fmu
from cosimulation.fmu_file import OpenFmu, open_fmu
from cosimulation.pantograph import INPUTS, SIGNALS
from identification.data_set import DataSet

Start = Mapping[str, StartValue]


@dataclass(frozen=True)
class RealTimeFactor:
    """What one FMU took for one record.

    Attributes:
        fmu: Its name.
        data_set: Name of the record.
        seconds: Of the fastest run, from initialisation to the last output.
        factor: These seconds over those of the record.
    """

    fmu: str
    data_set: str
    seconds: float
    factor: float


def batch_call(fmu: OpenFmu, data: DataSet, start: Start) -> FloatArray:
    """Return what an FMU gives for a record: one call into the driver's C loop over all its rows."""
    with running_fmu(fmu, "batch") as instance:
        return instance.run(
            data.matrix(INPUTS), INPUTS, _outputs(fmu), data.sample_time, start, rows_at_once=len(data)
        )


def own_loop(fmu: OpenFmu, data: DataSet, start: Start) -> FloatArray:
    """Return the same by fmpy's own loop, a step and an output per row."""
    table = np.zeros(len(data), dtype=[(name, np.float64) for name in ("time", *INPUTS)])
    table["time"] = data.time
    for name in INPUTS:
        table[name] = data.column(name)
    first = {name: float(table[name][0]) for name in INPUTS}
    typed = {name: converted_start(fmu, name, value) for name, value in start.items()}
    result = simulate_fmu(
        str(fmu.folder),
        model_description=fmu.description,
        fmi_type="CoSimulation",
        start_time=0.0,
        stop_time=float(data.time[-1]),
        step_size=data.sample_time,
        output_interval=data.sample_time,
        start_values=typed | first,
        input=table,
        output=_outputs(fmu),
        logger=_silent,
    )
    return np.column_stack([result[name] for name in _outputs(fmu)])


def _outputs(fmu: OpenFmu) -> list[str]:
    """Return the pantograph's signals that an FMU has."""
    known = {item.name for item in fmu.description.modelVariables}
    return [name for name in SIGNALS if name in known]


def _silent(*_: object) -> None:
    """Take what an FMU says of inputs outside its limits: it is no part of what is timed."""


def real_time_factors(
    fmus: Mapping[str, tuple[Path, Start]],
    records: Sequence[DataSet],
    repeats: int,
    way: Callable[[OpenFmu, DataSet, Start], FloatArray] = batch_call,
) -> list[RealTimeFactor]:
    """Time FMUs in one run: all of them in turn, again and again, so that what disturbs one disturbs all.

    Args:
        fmus: Name -> file and start values.
        records: What they are driven by.
        repeats: The fastest of so many runs counts: whatever else the machine does only adds time.
        way: `batch_call` or `own_loop`.

    Returns:
        One per FMU and record.

    Raises:
        FmuError: An FMU cannot be opened or reports an error.
    """
    seconds: dict[tuple[str, str], list[float]] = {}
    with ExitStack() as stack:
        opened = {name: stack.enter_context(open_fmu(path)) for name, (path, _) in fmus.items()}
        for _ in range(repeats):
            for data in records:
                for name, fmu in opened.items():
                    begin = time.perf_counter()
                    way(fmu, data, fmus[name][1])
                    seconds.setdefault((name, data.name), []).append(time.perf_counter() - begin)
    lasted = {data.name: len(data) * data.sample_time for data in records}
    return [
        RealTimeFactor(name, record, min(taken), min(taken) / lasted[record])
        for (name, record), taken in seconds.items()
    ]
