"""What a worker process keeps and does: FMUs unpacked once, one instance of each, reset from run to run."""

from __future__ import annotations

import json
import tempfile
import threading
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cosimulation.fmu_driver import FloatArray, FmuInstance, StartValue
from cosimulation.fmu_file import OpenFmu, open_fmu
from cosimulation.sweep.plan import Bench, Model, Run
from fmu_builder.errors import LlmnError
from identification.data_set import DataSet
from identification.scores import records

_KEPT = 8
"""Inputs, and runs of the reference, that a worker keeps: those that follow one another share them."""
_FLAG = "in_range"

Row = dict[str, Any]


@dataclass
class Workbench:
    """Runs of one process, one at a time.

    A run that fails is a row like any other; its instance is not used again.
    """

    bench: Bench
    _stack: ExitStack = field(default_factory=ExitStack)
    _fmus: dict[str, OpenFmu] = field(default_factory=dict)
    _instances: dict[str, FmuInstance] = field(default_factory=dict)
    _inputs: dict[Any, DataSet] = field(default_factory=dict)
    _references: dict[Any, FloatArray] = field(default_factory=dict)
    _tried: set[str] = field(default_factory=set)
    _forgetful: set[str] = field(default_factory=set)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def row(self, run: Run) -> Row:
        """Do a run and return its row: key, status, message, in_range, fit and max_error by output."""
        with self._lock:  # threads of one process take turns: not every FMU bears another beside it
            try:
                return {"key": run.key, "status": "ok", "message": "", **self._result(run)}
            except LlmnError as refused:
                return failed_row(run, "failed", self._without_folders(str(refused)))
            except Exception as reason:
                told = f"{type(reason).__name__}: {reason}"
                return failed_row(run, "failed", self._without_folders(told))

    def _without_folders(self, text: str) -> str:
        """Return a message on one line, the same in every process: folders of unpacked FMUs are not."""
        for fmu in self._fmus.values():
            text = text.replace(str(fmu.folder), fmu.path.name)
        return " ".join(text.split())

    def _result(self, run: Run) -> Row:
        model = self.bench.models[run.model]
        data = self._data(run)
        wanted = self._wanted(run, data)
        outputs, flags = self._outputs(model, data, run.parameters, run.outputs)
        scores = records(wanted, outputs, run.outputs, {}) if run.outputs else []
        return {
            "in_range": float(np.mean(flags)) if flags.size else None,
            "fit": {item["signal"]: item["fit"] for item in scores},
            "max_error": {item["signal"]: item["max_error"] for item in scores},
        }

    def _data(self, run: Run) -> DataSet:
        key = (run.signal, run.seed)
        if key not in self._inputs:
            _make_room(self._inputs)
            self._inputs[key] = self.bench.signals[run.signal].data(run.seed)
        return self._inputs[key]

    def _wanted(self, run: Run, data: DataSet) -> FloatArray:
        """Return what a run is compared with, one column per output."""
        reference = self.bench.reference
        if reference is None:
            return data.matrix(run.outputs) if run.outputs else np.empty((len(data), 0))
        key = (run.signal, run.seed, json.dumps(dict(run.shared), sort_keys=True))
        if key not in self._references:
            _make_room(self._references)
            outputs, _ = self._outputs(reference, data, run.shared, reference.outputs)
            self._references[key] = outputs
        return self._references[key][:, [reference.outputs.index(name) for name in run.outputs]]

    def _outputs(
        self, model: Model, data: DataSet, values: Mapping[str, StartValue], names: tuple[str, ...]
    ) -> tuple[FloatArray, FloatArray]:
        """Return the outputs [N, len(names)] of an FMU and its flag [N, 1], or [N, 0] where it has none.

        Whether a reset instance does what a new one does is tried the first time; where not, none is reused.
        """
        wary = not model.settings.reuse or model.sha256 in self._forgetful
        reused = not wary and self._reset(model)
        found = self._driven(model, data, values, names)
        if reused and model.sha256 not in self._tried:
            self._drop(model)
            anew = self._driven(model, data, values, names)
            same = all(np.array_equal(one, other) for one, other in zip(found, anew, strict=True))
            (self._tried if same else self._forgetful).add(model.sha256)
            found = anew
        if wary or model.sha256 in self._forgetful:
            self._drop(model)
        return found

    def _driven(
        self, model: Model, data: DataSet, values: Mapping[str, StartValue], names: tuple[str, ...]
    ) -> tuple[FloatArray, FloatArray]:
        """Return what the instance at hand gives, or a new one where there is none."""
        if model.sha256 not in self._instances:
            self._instances[model.sha256] = FmuInstance(self._fmu(model), "sweep")
        instance = self._instances[model.sha256]
        inputs = tuple(name for name in model.inputs if name in data.names)
        try:
            outputs = instance.run(
                data.matrix(inputs),
                model.theirs(inputs),
                model.theirs(names),
                data.sample_time,
                {**model.settings.start_values, **values},
                flags=(_FLAG,) if model.watched else (),
            )
        except BaseException:
            self._drop(model)
            raise
        return outputs, np.asarray(instance.flags != 0, dtype=np.float64)

    def _reset(self, model: Model) -> bool:
        """Reset the instance of an FMU; models of one archive share it. Return whether there is one now."""
        known = self._instances.get(model.sha256)
        if known is None:
            return False
        try:
            known.reset()
        except LlmnError:  # it cannot be reset: a new one can do what it cannot
            self._drop(model)
            return False
        return True

    def _drop(self, model: Model) -> None:
        known = self._instances.pop(model.sha256, None)
        if known is not None:
            known.close()

    def _fmu(self, model: Model) -> OpenFmu:
        if model.sha256 not in self._fmus:
            archive = model.archive
            if isinstance(archive, bytes):
                folder = Path(self._stack.enter_context(tempfile.TemporaryDirectory(prefix="llmn-sweep-")))
                (folder / model.file).write_bytes(archive)
                archive = folder / model.file
            self._fmus[model.sha256] = self._stack.enter_context(open_fmu(archive))
        return self._fmus[model.sha256]

    def close(self) -> None:
        """Free the instances and delete what was unpacked."""
        for instance in self._instances.values():
            instance.close()
        self._instances.clear()
        self._stack.close()


def _make_room(kept: dict[Any, Any]) -> None:
    while len(kept) >= _KEPT:
        kept.pop(next(iter(kept)))


def failed_row(run: Run, status: str, message: str) -> Row:
    """Return the row of a run that has no result."""
    return {
        "key": run.key, "status": status, "message": message, "in_range": None, "fit": {}, "max_error": {},
    }  # fmt: skip
