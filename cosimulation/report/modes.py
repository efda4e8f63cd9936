"""Poles of local models, and which of them are the reference's oscillating modes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

from cosimulation.linearise import Linearisation
from cosimulation.report.views import ModelView, SetView
from fmu_builder.parameter_set import LocalLinearModel
from identification.arrays import Array

Poles = npt.NDArray[np.complex128]

_REAL = 1e-9
"""Imaginary parts below this are rounding."""
_SUBSCRIPTS = ("L", "M", "H")
FURTHEST = 1.5
"""A mode this factor away in frequency is another mode."""


@dataclass(frozen=True)
class Mode:
    """A pole in the upper half of the z plane with its meaning in continuous time.

    Attributes:
        pole: z.
        frequency: |s| / 2 pi with s = log(z) / Ts [Hz].
        damping: -Re(s) / |s|; 1 for a real pole.
    """

    pole: complex
    frequency: float
    damping: float

    @property
    def oscillates(self) -> bool:
        """Whether it is one of a conjugate complex pair."""
        return abs(self.pole.imag) > _REAL


@dataclass(frozen=True)
class OperatingPointModes:
    """Poles at the centre of one local model.

    Attributes:
        height: eta [m].
        reference: Oscillating modes of the linearised reference, by frequency.
        models: By model title: for every reference mode the model's pair that goes with it, or None.
        others: By model title: the poles that go with no mode of the reference.
    """

    height: float
    reference: tuple[Mode, ...]
    models: dict[str, tuple[Mode | None, ...]]
    others: dict[str, tuple[Mode, ...]]


def mode_name(index: int, count: int) -> str:
    """Return the thesis's subscript L, M or H for three modes, else the mode's number."""
    return _SUBSCRIPTS[index] if count == len(_SUBSCRIPTS) else str(index + 1)


def reference_poles(linearisation: Linearisation, sample_time: float) -> Poles:
    """Return the poles of a continuous linear model, held over `sample_time`, in the z plane."""
    return np.exp(np.linalg.eigvals(linearisation.A).astype(np.complex128) * sample_time)


def model_poles(local_model: LocalLinearModel) -> Poles:
    """Return the poles of a local model in the z plane."""
    return np.linalg.eigvals(np.asarray(local_model.A)).astype(np.complex128)


def modes(poles: Poles, sample_time: float) -> tuple[Mode, ...]:
    """Return the poles of the closed upper half plane by frequency."""
    found = []
    for pole in poles:
        if pole.imag < -_REAL:
            continue
        s = np.log(pole) / sample_time
        size = float(abs(s))
        found.append(Mode(complex(pole), size / (2.0 * np.pi), -float(s.real) / size if size else 1.0))
    return tuple(sorted(found, key=lambda mode: (mode.frequency, mode.damping)))


def matched(reference: Sequence[Mode], found: Sequence[Mode]) -> tuple[Mode | None, ...]:
    """Return for every reference mode the found one that goes with it, each used once, or None.

    As many as possible are matched, at the smallest sum of |log(z) - log(z_reference)|; a found mode whose
    frequency is further off than the factor `FURTHEST` goes with none.
    """
    if not reference or not found:
        return (None,) * len(reference)
    distance = np.abs(np.log([[mode.pole for mode in found]]) - np.log([[mode.pole] for mode in reference]))
    ratio = np.array([[one.frequency / mode.frequency for one in found] for mode in reference])
    allowed = np.abs(np.log(ratio)) <= np.log(FURTHEST)
    penalised = np.where(allowed, distance, 1e3 + distance)  # far above any distance between two modes
    chosen: list[Mode | None] = [None] * len(reference)
    for row, column in zip(*linear_sum_assignment(penalised), strict=True):
        chosen[row] = found[column] if allowed[row, column] else None
    return tuple(chosen)


def modes_of_set(view: SetView) -> tuple[OperatingPointModes, ...]:
    """Return the poles at every centre at which the reference was linearised."""
    found = []
    for index, linearisation in enumerate(view.result.linearisations):
        sample_time = view.sample_time
        everything = modes(reference_poles(linearisation, sample_time), sample_time)
        reference = tuple(mode for mode in everything if mode.oscillates)
        pairs: dict[str, tuple[Mode | None, ...]] = {}
        others: dict[str, tuple[Mode, ...]] = {}
        for model in compared(view):
            own = modes(model_poles(model.parameter_set.local_models[index]), sample_time)
            pairs[model.title] = matched(reference, [mode for mode in own if mode.oscillates])
            others[model.title] = tuple(mode for mode in own if mode not in pairs[model.title])
        height = float(linearisation.input_operating_point[linearisation.inputs.index("eta")])
        found.append(OperatingPointModes(height, reference, pairs, others))
    return tuple(found)


def compared(view: SetView) -> tuple[ModelView, ...]:
    """Return one network per kind whose local models stand where the reference was linearised."""
    count = len(view.result.linearisations)
    return tuple(model for model in view.networks if len(model.parameter_set.local_models) == count)


def mode_bands(view: SetView) -> tuple[tuple[float, float], ...]:
    """Return lowest and highest frequency [Hz] of every mode of the linearised reference over the heights."""
    points = modes_of_set(view)
    if not points or len({len(point.reference) for point in points}) != 1:
        return ()
    table: Array = np.array([[mode.frequency for mode in point.reference] for point in points])
    return tuple(zip(table.min(axis=0).tolist(), table.max(axis=0).tolist(), strict=True))
