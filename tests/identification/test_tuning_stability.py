"""State coordinates that move with the height do so only as far as stability can be proved."""

from __future__ import annotations

import certified_networks as networks
import numpy as np
import pytest
import scipy.linalg

from fmu_builder.kernel import simulate
from fmu_builder.parameter_set import ParameterSet
from identification.choice import Choice
from identification.data_set import DataSet
from identification.network import NetworkSettings
from identification.stability import seems_provable
from identification.tuning import _DECAY_LEFT, TuningSettings, _steadied, _Tuned

TICK = 0.01
STRETCH = np.array([[0.25, 0.125], [0.0, -0.25]])


def made(one: _Tuned) -> ParameterSet:
    """A lightly damped oscillator whose state is stretched along the height: at rest the same everywhere."""
    omega = 20.0
    A = scipy.linalg.expm(TICK * np.array([[-0.2, omega], [-omega, -0.3]]))
    places = np.linspace(-1.0, 1.0, 5)
    generator = np.zeros((2, 2)) if one.generator is None else one.generator
    moved = [scipy.linalg.expm(s * generator) @ A @ scipy.linalg.expm(-s * generator) for s in places]
    return networks.blend(moved, (1.5 + places).tolist(), TICK)


def tuned() -> _Tuned:
    choices = (Choice("warp", 0.0, "other"), Choice("coordinates", "tuned", "36 numbers"))
    return _Tuned(NetworkSettings(), STRETCH, choices, 1.0)


def training(speed: float) -> list[DataSet]:
    """The height goes up and down at one speed [m/s]."""
    steps = speed * TICK * np.where(np.arange(400) // 40 % 2, -1.0, 1.0)
    rows = np.column_stack([1.0 + np.cumsum(steps), np.sin(np.arange(400) / 7.0)])
    values = np.hstack([rows, simulate(made(tuned()), rows)])
    return [DataSet("trial", TICK, ("s", "load", "y"), ("m", "N", "m"), values)]


def kept(speed: float, stable_beyond: float) -> tuple[float, _Tuned]:
    """Share of the motion that is kept, and the outcome."""
    found = _steadied(tuned(), made, training(speed), TuningSettings(stable_beyond=stable_beyond))
    assert found.generator is not None
    share = float(found.generator[0, 0] / STRETCH[0, 0])
    np.testing.assert_array_equal(found.generator, share * STRETCH)  # sixteenths: exact
    return share, found


def test_motion_that_leaves_stability_provable_is_kept_as_it_is() -> None:
    share, found = kept(0.01, 2.0)
    assert share == 1.0 and found.choices == tuned().choices


def test_too_much_motion_is_cut_and_the_reason_told() -> None:
    share, found = kept(0.5, 4.0)
    assert 0.0 < share < 1.0
    assert not seems_provable(made(tuned()), 2.0, _DECAY_LEFT)
    assert seems_provable(made(found), 2.0, _DECAY_LEFT)
    assert found.choices[0] == tuned().choices[0]
    reason = found.choices[1].reason
    assert reason.startswith(f"36 numbers; {share:.3g} of that motion, with ") and reason.endswith(
        "up to 2 per s"
    )


def test_faster_movement_leaves_less_of_it() -> None:
    assert kept(0.5, 4.0)[0] > kept(0.5, 8.0)[0]


@pytest.mark.parametrize("stable_beyond", [0.0, 1e4])
def test_nobody_asks_or_nothing_helps(stable_beyond: float) -> None:
    """A rate that crosses cells cannot be proved with coordinates at rest either: they are not to blame."""
    assert kept(0.5, stable_beyond)[0] == 1.0
