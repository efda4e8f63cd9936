"""Without damping nothing is lost: the energy drift is the integrator's and vanishes with its order.

With damping, friction and lost contact, what is stored less the work of drive, wire and gravity never grows.
"""

from __future__ import annotations

import numpy as np
import pytest
from dry_joints import DRY
from reference import lagrangian

import tolerances
from fmus.wbm import native, parameter_sets

STATE_COLUMNS = [native.OUTPUTS.index(name) for name in native.STATES]
INPUTS = (1.45, 1290.0)
DURATION = 0.512


def energies(name: str, inner_step: float, **changes: float) -> np.ndarray:
    """Energy less the drive's work at the start and at the end of a free swing after a step of the wire."""
    parameters = parameter_sets()[name].changed(**changes)
    start = native.equilibrium(parameters, (1.5, 1310.9))
    rows = np.tile(INPUTS, (2, 1))
    path = native.simulate(parameters, rows, DURATION, inner_step, start)
    return np.array([lagrangian.energy()(y[STATE_COLUMNS], INPUTS, parameters.vector())[0] for y in path])


@pytest.mark.parametrize("name", ["A", "Blow"])
def test_energy_drift_vanishes_with_order_four_or_better(name: str) -> None:
    steps = [0.004, 0.002, 0.001]
    drift = [abs(np.diff(energies(name, step, c_C=0.0, c_d=0.0))[0]) for step in steps]
    orders = np.log2(np.array(drift[:-1]) / np.array(drift[1:]))
    assert (orders > tolerances.WBM_LEAST_ORDER).all(), (drift, orders)
    finest = energies(name, 0.00025, c_C=0.0, c_d=0.0)
    assert abs(np.diff(finest)[0]) < tolerances.WBM_ENERGY * abs(finest[0])


@pytest.mark.parametrize("damper", ["c_C", "c_d"])
def test_every_damper_takes_energy_away(damper: str) -> None:
    """The same swing with one damper loses more than a thousand times the undamped drift."""
    undamped = abs(np.diff(energies("A", 0.00025, c_C=0.0, c_d=0.0))[0])
    others = {"c_C": 0.0, "c_d": 0.0} | {damper: 20.0}
    assert np.diff(energies("A", 0.00025, **others))[0] < -1000.0 * undamped


@pytest.mark.parametrize("name", ["A", "Blow"])
def test_integration_has_order_four(name: str) -> None:
    parameters = parameter_sets()[name]
    start = native.equilibrium(parameters, (1.5, 1310.9))
    rows = np.tile(INPUTS, (2, 1))
    ends = [
        native.simulate(parameters, rows, DURATION, h, start)[-1] for h in (0.004, 0.002, 0.001, 0.000125)
    ]
    errors = [np.abs(end[STATE_COLUMNS] - ends[-1][STATE_COLUMNS]).max() for end in ends[:-1]]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert (np.abs(orders - 4.0) < tolerances.WBM_ORDER).all(), (errors, orders)


DISSIPATION = {
    "none": {"c_C": 0.0, "c_d": 0.0},
    "dampers": {},
    "friction": {"c_C": 0.0, "c_d": 0.0, **DRY},
}


def stored_less_work(name: str, dissipation: str, unilateral: float, inner_step: float) -> np.ndarray:
    """What each millisecond adds to the stored energy beyond the work of drive, wire and gravity, J.

    Torque and wire jump every 50 ms and are held in between. The wire works only in its jumps, and both
    energies of a millisecond are taken at its new height; gravity's work is in the potential energy.
    """
    parameters = parameter_sets()[name].changed(unilateral=unilateral, **DISSIPATION[dissipation])
    random = np.random.default_rng(3)
    wire = 1.5 + np.repeat(random.uniform(-0.02, 0.02, 30), 50)
    torque = 1310.9 + np.repeat(random.uniform(-75.0, 75.0, 30), 50)
    inputs = np.column_stack([wire, torque])
    start = native.equilibrium(parameters, (1.5, 1310.9))
    rows = native.simulate(parameters, inputs, 1e-3, inner_step, start)
    contact = rows[:, native.OUTPUTS.index("F_p")] > 0.0
    assert (np.diff(contact) != 0).sum() > 4
    states, energy = rows[:, STATE_COLUMNS], lagrangian.energy()
    pairs = zip(states[:-1], states[1:], inputs[:-1], strict=True)
    values = parameters.vector().tolist()
    return np.array([energy(b, u, values)[0] - energy(a, u, values)[0] for a, b, u in pairs])


@pytest.mark.parametrize("unilateral", [0.0, 1.0])
@pytest.mark.parametrize("dissipation", ["dampers", "friction"])
@pytest.mark.parametrize("name", ["A", "Blow"])
def test_what_is_stored_less_the_work_never_grows(name: str, dissipation: str, unilateral: float) -> None:
    added = stored_less_work(name, dissipation, unilateral, 5e-4)
    assert added.max() < 0.0
    assert added.sum() < -1.0


@pytest.mark.parametrize("name", ["A", "Blow"])
def test_bounces_lose_no_energy_without_dissipation(name: str) -> None:
    """1.5 s mostly off the wire: what is left is the integrator's, of order five."""
    drift = [abs(stored_less_work(name, "none", 1.0, step).sum()) for step in (1e-3, 5e-4, 2.5e-4)]
    orders = np.log2(np.array(drift[:-1]) / np.array(drift[1:]))
    assert (orders > tolerances.WBM_LEAST_ORDER).all(), (drift, orders)
    assert drift[-1] < tolerances.WBM_BOUNCE_ENERGY
