"""What a sweep has to do: every run with the hash of all that its result depends on, in canonical order."""

from __future__ import annotations

import hashlib
import itertools
import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cosimulation.fmu_driver import StartValue
from cosimulation.sweep.settings import ModelSettings, ParameterSettings, SignalSettings, SweepSettings
from identification.data_set import DataSet
from identification.excitation import operating_point_inputs, random_stream, whole_range_inputs

FORMAT = "llmn sweep 1"


@dataclass(frozen=True)
class Model:
    """An FMU as a worker needs it.

    Attributes:
        settings: Start values, names of signals.
        file: Name of the file, for messages.
        archive: The file; its bytes where workers may see no file of ours.
        sha256: Of the archive.
        inputs: Our names of the inputs that signals drive.
        outputs: Our names of its Real outputs.
        watched: Whether it has a Boolean `in_range`.
    """

    settings: ModelSettings
    file: str
    archive: Path | bytes
    sha256: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    watched: bool

    def theirs(self, names: Sequence[str]) -> tuple[str, ...]:
        """Return what the FMU calls our signals."""
        return tuple(self.settings.names.get(name, name) for name in names)


@dataclass(frozen=True)
class Signal:
    """Inputs of runs: the recipe, and the record where it is a file."""

    settings: SignalSettings
    record: DataSet | None

    def data(self, seed: int | None) -> DataSet:
        """Return the inputs of a seed, or the record; the same seed differs from signal to signal."""
        if self.record is not None:
            return self.record
        chosen, stream = self.settings, (zlib.crc32(self.settings.name.encode()),)
        duration, number = chosen.duration or 0.0, seed or 0
        if chosen.kind == "operating_point":
            height = chosen.height or 0.0
            return operating_point_inputs(height, number, stream, duration, chosen.excitation, chosen.name)
        limits = (chosen.low, chosen.high)
        return whole_range_inputs(number, stream, duration, *limits, chosen.excitation, chosen.name)

    def rows(self) -> int:
        """Return the number of samples."""
        if self.record is not None:
            return len(self.record)
        return round((self.settings.duration or 0.0) / self.settings.excitation.sample_time)

    def identity(self) -> dict[str, Any]:
        """Return everything its inputs depend on but the seed."""
        if self.record is not None:
            return {"name": self.settings.name, "content": self.record.content_hash}
        told = self.settings.model_dump(mode="json", exclude={"file"})
        return told if self.settings.kind == "whole_range" else {**told, "low": None, "high": None}


@dataclass(frozen=True)
class Run:
    """One run of a sweep.

    Attributes:
        key: SHA-256 (hex) of all that the result depends on.
        model: Place in the bench's models.
        signal: Place in the bench's signals.
        seed: Of the inputs; None for a record.
        parameters: Varied start values of the model, in the order of the settings.
        shared: Those of them that are set in the reference as well.
        outputs: Our names of the outputs that are scored.
    """

    key: str
    model: int
    signal: int
    seed: int | None
    parameters: Mapping[str, StartValue]
    shared: Mapping[str, StartValue]
    outputs: tuple[str, ...]


@dataclass(frozen=True)
class Bench:
    """Everything that runs have in common; workers are given it once."""

    models: tuple[Model, ...]
    signals: tuple[Signal, ...]
    reference: Model | None

    def scored(self, model: Model, signal: Signal, wanted: Sequence[str]) -> tuple[str, ...]:
        """Return our names of the outputs that a run is scored by, none where nothing is there to compare."""
        if self.reference is not None:
            known: Sequence[str] = self.reference.outputs
        else:
            known = signal.record.names if signal.record is not None else ()
        return tuple(name for name in model.outputs if name in known and name in (wanted or known))


def _identity(model: Model) -> dict[str, Any]:
    told = model.settings.model_dump(mode="json", exclude={"fmu", "name", "reuse"})
    return {**told, "sha256": model.sha256}


def combinations(
    parameters: Sequence[ParameterSettings], samples: int, sample_seed: int
) -> list[dict[str, StartValue]]:
    """Return every combination of values: the grid's product, each with all samples.

    A draw depends on the seed, its number and the parameter's name alone, so that more samples or more
    parameters leave the earlier draws as they are.
    """
    grid = [item for item in parameters if not item.sampled]
    ranged = [item for item in parameters if item.sampled]
    draws = [
        {item.name: _draw(item, sample_seed, number) for item in ranged}
        for number in range(samples if ranged else 1)
    ]
    found = []
    for values in itertools.product(*(item.values or () for item in grid)):
        fixed = dict(zip((item.name for item in grid), values, strict=True))
        for draw in draws:
            both = {**fixed, **draw}
            found.append({item.name: both[item.name] for item in parameters})
    return found


def _draw(item: ParameterSettings, seed: int, number: int) -> float:
    low, high = item.low or 0.0, item.high or 0.0
    share = float(random_stream(seed, number, zlib.crc32(item.name.encode())).uniform())
    value = low * (high / low) ** share if item.scale == "log" else low + (high - low) * share
    return float(f"{value:.12g}")  # powers differ in the last digit from one machine to another


def runs_of(settings: SweepSettings, bench: Bench) -> list[Run]:
    """Return all runs in canonical order: models, signals, parameters, seeds as in the settings."""
    found = []
    for place, model in enumerate(bench.models):
        label = model.settings.label
        ours = [item for item in settings.parameters if item.models is None or label in item.models]
        shared = {item.name for item in ours if item.reference}
        varied = combinations(ours, settings.samples, settings.sample_seed)
        for number, signal in enumerate(bench.signals):
            outputs = bench.scored(model, signal, settings.outputs)
            common = {
                "format": FORMAT,
                "model": {"name": label, **_identity(model)},
                "reference": None if bench.reference is None else _identity(bench.reference),
                "signal": signal.identity(),
                "outputs": outputs,
            }
            seeds = settings.seeds if signal.record is None else (None,)
            for values, seed in itertools.product(varied, seeds):
                both = {name: value for name, value in values.items() if name in shared}
                told = {**common, "seed": seed, "parameters": values, "shared": both}
                text = json.dumps(told, sort_keys=True, allow_nan=False)
                key = hashlib.sha256(text.encode()).hexdigest()
                found.append(Run(key, place, number, seed, values, both, outputs))
    return found


def chunks_of(runs: Sequence[Run], bench: Bench, rows: int, workers: int) -> list[list[Run]]:
    """Return runs in pieces of about so many samples, smaller ones where not every worker would get four.

    Runs that are scored by the same run of the reference follow one another, so that a worker makes it once.
    """
    lengths = [signal.rows() for signal in bench.signals]
    ordered = sorted(
        runs, key=lambda run: (run.signal, run.seed or 0, json.dumps(dict(run.shared), sort_keys=True))
    )
    total = sum(lengths[run.signal] for run in ordered)
    limit = max(1, min(rows, total // (4 * workers)))
    pieces: list[list[Run]] = []
    room = 0
    for run in ordered:
        if room <= 0:
            pieces.append([])
            room = limit
        pieces[-1].append(run)
        room -= lengths[run.signal]
    return pieces
