"""What whole-range training data decide: validity functions, deviation gain, state coordinates, blending."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from fmu_builder.errors import CertificateError
from fmu_builder.parameter_set import DerivedOutput, ParameterSet, Partition, warp_rises
from identification.arrays import Array
from identification.choice import Choice
from identification.data_set import DataSet
from identification.n4sid import LocalModels, network
from identification.network import NetworkSettings
from identification.objective import Candidate, Objective, transformed
from identification.stability import seems_provable
from identification.subspace import balancing_transform
from identification.surrogate.least_squares import Minimum, NormalEquations, minimise
from identification.warning import IdentificationWarning, poor_fits, stray_data

_STEP = 1e-4
"""Of the one-sided differences, in coordinates of order one: far above rounding, far below what matters."""
_LARGEST_COORDINATE = 5.0
_DECAY_LEFT = 0.1
"""Of the slowest decay at rest: what fast movement may leave of it."""
_SHARE_STEP = 1.0 / 16.0
_TIE = 1e-6
"""Relative difference of training errors below which rounding would choose; the first blending wins."""
_K_SIGMA_START = 0.5
_NEUTRAL: dict[str, Any] = {"k_sigma": _K_SIGMA_START, "warp": (0.0, 0.0), "deviation_gain": 0.0}
_DEFAULTS: dict[str, Any] = {
    "k_sigma": 1.0 / 3.0, "deviation_gain": 0.0, "coordinates": "aligned", "blending": "parameter",
}  # fmt: skip


class TuningSettings(BaseModel):
    """How the open choices are made."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    signals: tuple[str, ...] | None = Field(
        default=None, description="outputs and derived outputs whose errors count; default all that move"
    )
    iterations: int = Field(default=8, ge=1, description="most steps of a search")
    tolerance: float = Field(default=0.01, gt=0.0, description="relative gain that ends a search")
    stable_beyond: float = Field(
        default=3.0,
        ge=0.0,
        description="state coordinates move with the scheduling variable only as far as stability can be"
        " proved up to so many times its fastest movement in the training data; 0: as the errors want it",
    )
    largest_order: int = Field(
        default=8, ge=0, description="up to which state coordinates are tuned: order^2 numbers"
    )


class TunedNetwork(NamedTuple):
    """A network without open choices.

    Attributes:
        parameter_set: The network.
        choices: What was chosen, in the order of choosing.
        settings: The settings with every choice filled in.
        local: The local models in the state coordinates that were chosen; with `settings` they give the
            network again.
        warnings: What whole-range training data say against the network.
    """

    parameter_set: ParameterSet
    choices: tuple[Choice, ...]
    settings: NetworkSettings
    local: LocalModels
    warnings: tuple[IdentificationWarning, ...] = ()


@dataclass(frozen=True)
class _Tuned:
    """The outcome for one blending."""

    settings: NetworkSettings
    generator: Array | None
    choices: tuple[Choice, ...]
    percent: float


def tuned_network(
    name: str,
    local: LocalModels,
    training: Sequence[DataSet],
    settings: NetworkSettings,
    derived_outputs: Sequence[DerivedOutput] = (),
    tuning: TuningSettings | None = None,
    **rest: Any,
) -> TunedNetwork:
    """Return the network with every open choice of its settings made on whole-range training data.

    "tuned" numbers are found by damped Gauss-Newton steps on the simulated output, computed by the kernel
    that the FMU runs; the search starts from a network that needs no tuning and never ends above its cost.
    The "best" blending is the one with the lower cost, each with its own numbers.

    Args:
        name: C identifier; the FMU's default model identifier.
        local: The local models.
        training: Whole-range training data; nothing else is looked at. May be empty: then the choices fall
            back on defaults, and say so.
        settings: What is left open and what is given.
        derived_outputs: Outputs computed from inputs and outputs.
        tuning: Signals that count and limits of the search.
        rest: Further fields of the parameter set.

    Raises:
        DataError: Columns are missing.
        IdentificationError: A signal that does not exist.
        ParameterSetError: Not a valid parameter set; every problem is named.
    """
    chosen = tuning or TuningSettings()
    settings, kept = _without_large_searches(settings, local, chosen)
    if not training:
        fixed, choices = _without_data(settings)
        parameter_set = network(name, local, fixed, derived_outputs, **rest)
        return TunedNetwork(parameter_set, (*kept, *choices), fixed, local)
    if not settings.open_choices:
        parameter_set = network(name, local, settings, derived_outputs, **rest)
        warnings = _warnings(parameter_set, training, chosen)
        return TunedNetwork(parameter_set, kept, settings, local, warnings)
    local = local.trained_on(training)
    found = []
    for blending in ("parameter", "output") if settings.blending == "best" else (settings.blending,):
        without = {"deviation_gain": 0.0} if blending == "output" else {}
        trial = settings.model_copy(update={"blending": blending, **without})
        # only where it matters, so that a blending has the same bits whether or not it was compared
        models = _in_balanced_coordinates(local) if "coordinates" in trial.open_choices else local
        example = network(name, models, _start(trial), derived_outputs)
        found.append(_tuned(trial, example, Objective(example, training, chosen.signals), chosen))
    best = found[0]
    for one in found[1:]:
        if one.percent < (1.0 - _TIE) * best.percent:
            best = one
    if best.generator is not None:

        def made(one: _Tuned) -> ParameterSet:
            return network(name, _in_tuned_coordinates(local, one), one.settings, derived_outputs)

        best = _steadied(best, made, training, chosen)
    choices = (*kept, *best.choices)
    if settings.blending == "best":
        costs = ", ".join(f"{one.settings.blending} {one.percent:.4g} %" for one in found)
        why = "no larger" if best is found[0] else "smaller"
        choices = (*choices, Choice("blending", best.settings.blending, f"{why} training error ({costs})"))
    final = _in_tuned_coordinates(local, best)
    parameter_set = network(name, final, best.settings, derived_outputs, **rest)
    warnings = _warnings(parameter_set, training, chosen)
    return TunedNetwork(parameter_set, choices, best.settings, final, warnings)


def _warnings(
    parameter_set: ParameterSet, training: Sequence[DataSet], tuning: TuningSettings
) -> tuple[IdentificationWarning, ...]:
    """Return what whole-range training data say against a network."""
    partition = parameter_set.partition
    fits = Objective(parameter_set, training, tuning.signals).fits(Candidate(partition))
    mend = "Give more local models, another validity or blending, or data that cover what the network is for"
    return (
        *stray_data(training, partition.scheduling, partition.range),
        *poor_fits("network on whole-range data, ", fits, mend),
    )


def _in_balanced_coordinates(local: LocalModels) -> LocalModels:
    """Return the models in the balanced coordinates of the middle one, whatever they were.

    Their network is the same, but not the steps and bounds of a search over the motion of its coordinates.
    """
    transform = balancing_transform(local.models[len(local.models) // 2], local.output_scale)
    if transform is None:
        return local
    return replace(local, models=tuple(model.transformed(transform) for model in local.models))


def _without_large_searches(
    settings: NetworkSettings, local: LocalModels, tuning: TuningSettings
) -> tuple[NetworkSettings, tuple[Choice, ...]]:
    """Return the settings without the search for state coordinates where it has too many numbers."""
    order = local.models[0].order
    if "coordinates" not in settings.open_choices or order <= tuning.largest_order:
        return settings, ()
    reason = f"order {order} has {order**2} numbers to tune, tuning.largest_order is {tuning.largest_order}"
    return settings.model_copy(update={"coordinates": "aligned"}), (Choice("coordinates", "aligned", reason),)


def _in_tuned_coordinates(local: LocalModels, tuned: _Tuned) -> LocalModels:
    if tuned.generator is None:
        return local
    partition, models = local.partition(tuned.settings), _in_balanced_coordinates(local).models
    return replace(local, models=tuple(transformed(models, partition, tuned.generator)))


def _steadied(
    tuned: _Tuned,
    made: Callable[[_Tuned], ParameterSet],
    training: Sequence[DataSet],
    tuning: TuningSettings,
) -> _Tuned:
    """Return the outcome with state coordinates that move only as far as leaves stability provable.

    A height that swings at twice the frequency of a mode can pump it where the coordinates of a blend turn or
    stretch with the height. Near its minimum the error is a parabola over the share of the motion that is
    kept: a quarter less costs a sixteenth of what the motion gained.
    """
    example, generator = made(tuned), tuned.generator
    heights = [data.column(example.partition.scheduling) for data in training]
    moves = max(float(np.abs(np.diff(one)).max(initial=0.0)) for one in heights)
    rate = tuning.stable_beyond * moves / example.sample_time

    def with_share(share: float) -> _Tuned:
        return tuned if generator is None else replace(tuned, generator=share * generator)

    def steady(share: float) -> bool:
        try:
            return seems_provable(made(with_share(share)), rate, _DECAY_LEFT)
        except CertificateError:  # not stable at rest either, or too many states
            return False

    # where coordinates at rest do not help either, their motion is not to blame
    if rate == 0.0 or steady(1.0) or not steady(0.0):
        return tuned
    low, high = 0.0, 1.0
    while high - low > _SHARE_STEP:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if steady(middle) else (low, middle)
    found = with_share(low)
    result = made(found)
    objective = Objective(result, training, tuning.signals)
    error = objective.percent(objective.cost(Candidate(result.partition)))
    told = f"; {low:.3g} of that motion, with {error:.4g} %, leaves stability provable up to {rate:.3g} per s"
    choices = tuple(
        replace(one, reason=one.reason + told) if one.name == "coordinates" else one for one in tuned.choices
    )
    return replace(found, choices=choices)


def _start(settings: NetworkSettings) -> NetworkSettings:
    """Return the settings with neutral numbers where they are open: a network that needs no tuning."""
    update = {key: _NEUTRAL[key] for key in settings.open_choices if key in _NEUTRAL}
    return settings.model_copy(update=update | {"coordinates": "aligned"})


def _without_data(settings: NetworkSettings) -> tuple[NetworkSettings, tuple[Choice, ...]]:
    """Return what to do without whole-range training data."""
    reason = "no whole-range training data to decide it on"
    update: dict[str, Any] = {}
    choices = []
    for key in settings.open_choices:
        if key == "warp":
            update["validity"] = "cubic"
            choices.append(Choice("validity", "cubic", f"{reason}, so the warp is left out"))
        else:
            update[key] = _DEFAULTS[key]
            choices.append(Choice(key, _rounded(_DEFAULTS[key]), f"{reason}, so the default is taken"))
    return settings.model_copy(update=update), tuple(choices)


class _Coordinates:
    """The open numbers of some settings as one vector of numbers of order one; zero is neutral."""

    def __init__(self, settings: NetworkSettings, example: ParameterSet) -> None:
        self.settings, self.partition = _start(settings), example.partition
        self.states = example.state_count
        self.reach = 0.5 * (self.partition.range[1] - self.partition.range[0])
        self.deviation = _swing(example, self.partition.deviation_output)
        sizes = {"k_sigma": 1, "warp": 2, "deviation_gain": 1, "coordinates": self.states**2}
        asked = tuple(key for key in sizes if key in settings.open_choices)
        self.useless = asked if len(example.local_models) == 1 else ()
        self.names = tuple(key for key in asked if key not in self.useless)
        self.size = sum(sizes[key] for key in self.names)
        self.few = self.size - (self.states**2 if "coordinates" in self.names else 0)

    def at(self, x: Array) -> tuple[NetworkSettings, Candidate] | None:
        """Return settings and candidate at x, None where the warped variable would fall.

        Args:
            x: All coordinates, or the first `few`: all but the motion of the state coordinates.
        """
        update: dict[str, Any] = {}
        generator, rest = None, x.tolist()
        for key in self.names:
            if key == "warp":
                update[key] = (rest.pop(0) / self.reach, rest.pop(0) / self.reach**2)
                if not warp_rises(update[key], self.reach):
                    return None
            elif key == "k_sigma":
                update[key] = _K_SIGMA_START * float(np.exp(rest.pop(0)))
            elif key == "deviation_gain":
                update[key] = rest.pop(0) * self.reach / self.deviation
            elif rest:
                generator = np.array(rest).reshape(self.states, self.states)
        settings = self.settings.model_copy(update=update)
        fields = {key: value for key, value in update.items() if key in Partition.model_fields}
        return settings, Candidate(self.partition.model_copy(update=fields), generator)


def _tuned(
    settings: NetworkSettings, example: ParameterSet, objective: Objective, tuning: TuningSettings
) -> _Tuned:
    """Return the settings with their open numbers tuned and a line for each.

    First the few numbers of the validity functions, then, where they are open, all with the coordinates.
    """
    coordinates = _Coordinates(settings, example)
    x, steps, costs = np.zeros(coordinates.few), 0, []
    for size in sorted({coordinates.few, coordinates.size} - {0}):
        found = _searched(coordinates, objective, np.append(x, np.zeros(size - x.size)), tuning)
        x, steps = found.x, steps + len(found.history) - 1
        costs += [found.history[0].cost, found.cost]
    if not costs:
        costs = [objective.cost(Candidate(example.partition))]
    before, after = costs[0], costs[-1]
    point = coordinates.at(x)
    fixed, candidate = point if point is not None else (coordinates.settings, Candidate(example.partition))
    percent = objective.percent(after)
    reason = (
        f"training error of {', '.join(objective.names)} {objective.percent(before):.4g} %"
        f" -> {percent:.4g} % in {steps} steps"
    )
    alone = "a single local model leaves nothing to blend"
    choices = [Choice(key, _rounded(getattr(fixed, key)), alone) for key in coordinates.useless]
    for key in coordinates.names:
        if key == "coordinates":
            choices.append(Choice(key, "tuned", f"{coordinates.states**2} numbers, {reason}"))
        else:
            origin = f", from {_rounded(_NEUTRAL[key])}"
            choices.append(Choice(key, _rounded(getattr(fixed, key)), reason + origin))
    return _Tuned(fixed, candidate.generator, tuple(choices), percent)


def _searched(
    coordinates: _Coordinates, objective: Objective, start: Array, tuning: TuningSettings
) -> Minimum:
    """Return the minimum found from a start."""
    latest: dict[bytes, Array | None] = {}

    def residuals(x: Array) -> Array | None:
        key = x.tobytes()
        if key not in latest:  # the point of a step is asked for twice: for its cost, then for its gradient
            point = coordinates.at(x)
            latest.clear()
            latest[key] = None if point is None else objective.residuals(point[1])
        return latest[key]

    def cost(x: Array) -> float:
        errors = residuals(x)
        return np.inf if errors is None else float(errors @ errors)

    bounds = np.full(start.size, -_LARGEST_COORDINATE), np.full(start.size, _LARGEST_COORDINATE)
    return minimise(
        cost,
        lambda x: _normal_equations(residuals, x),
        start,
        bounds,
        tuning.iterations,
        tuning.tolerance,
        largest_step=0.5,
    )


def _normal_equations(residuals: Callable[[Array], Array | None], x: Array) -> NormalEquations:
    """Return cost, downhill gradient and Gauss-Newton matrix by one-sided differences."""
    here = residuals(x)
    if here is None:
        return NormalEquations(np.inf, np.zeros(x.size), np.eye(x.size))
    rows = np.zeros((x.size, here.size))
    for index, direction in enumerate(np.eye(x.size)):
        for step in (_STEP, -_STEP):  # the other side where there is no network on this one
            there = residuals(x + step * direction)
            if there is not None:
                rows[index] = (here - there) / step
                break
    gram = rows @ rows.T
    # numbers that change nothing, as between equal models, stay where they are
    gram[np.diag_indices(x.size)] += ~rows.any(axis=1)
    return NormalEquations(float(here @ here), rows @ here, gram)


def _swing(example: ParameterSet, output: str | None) -> float:
    """Return half the range an output had in training, in its unit; 1 where there is none."""
    for signal in example.outputs:
        if signal.name == output:
            return 0.5 * (signal.maximum - signal.minimum) or 1.0
    return 1.0


def _rounded(value: Any) -> Any:
    if isinstance(value, tuple):
        return tuple(_rounded(one) for one in value)
    return float(f"{value:.6g}") if isinstance(value, float) else value
