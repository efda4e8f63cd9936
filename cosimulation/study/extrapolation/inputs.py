"""What the wire and the drive do, by cause; and where a network says it was trained."""

from __future__ import annotations

import functools

import numpy as np

import fmus
from cosimulation.pantograph import INPUTS, TORQUE
from cosimulation.study.extrapolation.settings import Cause, CauseName, ExtrapolationSettings
from cosimulation.study.side_by_side import SAMPLE_TIME
from identification.arrays import Array
from identification.excitation import ACCEPTANCE, operating_point_inputs, whole_range_inputs

UNITS: dict[CauseName, str] = {
    "height": "m",
    "speed": "m/s",
    "noise": "1",
    "frequency": "Hz",
    "torque": "N.m",
}
_STREAM = 800


def inputs_of(cause: Cause, value: float, settings: ExtrapolationSettings, seed: int) -> Array:
    """Return the inputs of one run, [N, 2]: height of the wire [m] and torque [N.m].

    The acceptance recipe rides on everything but a sine. height and torque: the operating point is there.
    speed: the wire goes up and down in a sine between the ends of the travel, this fast in the middle. noise:
    whole range, the wire's noise times this. frequency: a sine of the wire alone, at this frequency.

    Args:
        cause: What is varied.
        value: To this, in the cause's unit.
        settings: The study's.
        seed: Of the draw, which is the same for all values.
    """
    if cause.name == "frequency":
        return _sine(value, cause.duration, settings)
    recipe, stream = ACCEPTANCE, (_STREAM,)
    if cause.name == "noise":
        recipe = recipe.model_copy(update={"noise_rms": recipe.noise_rms * value})
        return whole_range_inputs(seed, stream, cause.duration, settings=recipe).values
    if cause.name == "torque":
        recipe = recipe.model_copy(update={"torque": value})
    height = value if cause.name == "height" else settings.height
    rows = operating_point_inputs(height, seed, stream, cause.duration, recipe).values
    if cause.name == "speed":
        return rows + np.column_stack([_travel(value, len(rows), settings), np.zeros(len(rows))])
    return rows


def _sine(frequency: float, duration: float, settings: ExtrapolationSettings) -> Array:
    time = SAMPLE_TIME * np.arange(round(duration / SAMPLE_TIME))
    wire = settings.height + settings.sine_amplitude * np.sin(2.0 * np.pi * frequency * time)
    return np.column_stack([wire, np.full(len(time), TORQUE)])


def _travel(speed: float, count: int, settings: ExtrapolationSettings) -> Array:
    """Return the height above `settings.height` of a wire that goes up and down, fastest in the middle."""
    low, high = settings.travel
    half = 0.5 * (high - low)
    phase = SAMPLE_TIME * np.arange(count) * speed / half
    return np.asarray(low + half * (1.0 - np.cos(phase)) - settings.height)


@functools.cache
def trained_region(network: str, cause: Cause) -> tuple[float, float] | None:
    """Return where a network was trained, in the unit of the cause; None where nobody knows.

    Heights and torques are the limits of the inputs, frequencies the trained region of the parameter set if
    it has one; else what the settings say.
    """
    known = fmus.network(network)
    if cause.name in ("height", "torque"):
        signal = known.inputs[INPUTS.index("eta" if cause.name == "height" else "M_pa")]
        return signal.minimum, signal.maximum
    region = known.trained_region
    if cause.name == "frequency" and region is not None and "eta" in region.frequency_bands:
        return region.frequency_bands["eta"]
    return cause.trained


@functools.cache
def input_limits(network: str) -> Array:
    """Return smallest and largest trained value of every input, [2, 2]."""
    known = fmus.network(network).inputs
    chosen = [next(item for item in known if item.name == name) for name in INPUTS]
    return np.array([[item.minimum for item in chosen], [item.maximum for item in chosen]])
