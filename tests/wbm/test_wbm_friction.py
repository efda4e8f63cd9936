"""Dry friction in the joints: hysteresis, rest, the passage through it, and the step it asks for."""

from __future__ import annotations

import numpy as np
import pytest
from dry_joints import DRY
from reference import lagrangian
from reference.motion import motion

import tolerances
from fmu_builder.errors import FmuError
from fmus.wbm import PhysicalParameters, native, operating_point, parameter_sets

F_P, ZETA = native.OUTPUTS.index("F_p"), native.OUTPUTS.index("zeta")
STATE_COLUMNS = [native.OUTPUTS.index(name) for name in native.STATES]
TORQUE = operating_point()["M_pa"]
START = (1.5, TORQUE)
SAMPLE_TIME = 1e-3
JOINTS = ("friction_base", "friction_knee", "friction_rod_end", "friction_rod_foot", "friction_bend")


def lift(parameters: PhysicalParameters, height: float) -> float:
    """z1 = dzeta/dphi1 at rest, m/rad, from the independent kinematics."""
    state = native.equilibrium(parameters, (height, TORQUE))
    step = np.array([1e-5, 0.0, 0.0, 0.0, 0.0, 0.0])
    sides = [
        lagrangian.outputs()(state + s * step, (height, TORQUE), parameters.vector())[ZETA] for s in (1, -1)
    ]
    return (sides[0] - sides[1]) / 2e-5


def hysteresis(parameters: PhysicalParameters) -> float:
    """F_p on a falling less F_p on a rising wire between 1.3 m and 1.6 m, N; less what held inputs add."""
    speed = 0.072
    rise = np.arange(0.8, 2.0, speed * SAMPLE_TIME)
    wire = np.concatenate([rise, rise[::-1]])
    rows = native.simulate(parameters, np.column_stack([wire, np.full(wire.size, TORQUE)]), SAMPLE_TIME)
    rising, falling = rows[: rise.size, F_P], rows[rise.size :, F_P][::-1]
    middle = (rise > 1.3) & (rise < 1.6)
    return float((falling - rising)[middle].mean()) - parameters["k_E"] * speed * SAMPLE_TIME


@pytest.mark.parametrize("name", tuple(parameter_sets()))
@pytest.mark.parametrize("coulomb", [20.0, 50.0])
def test_hysteresis_over_a_slow_ramp_is_twice_the_torque_over_the_lift(name: str, coulomb: float) -> None:
    parameters = parameter_sets()[name]
    expected = 2.0 * coulomb / np.mean([lift(parameters, height) for height in np.linspace(1.3, 1.6, 7)])
    found = hysteresis(parameters.changed(friction_base=coulomb))
    assert abs(found - expected) <= tolerances.HYSTERESIS * expected
    assert abs(hysteresis(parameters)) <= tolerances.HYSTERESIS_WITHOUT * expected


def test_stribeck_adds_to_it_on_a_wire_slower_than_its_rate() -> None:
    """At 0.02 rad/s of the arm and w_s = 0.1 rad/s nearly all of T_s is left."""
    parameters = parameter_sets()["Blow"].changed(friction_base=20.0)
    raised = parameters.changed(friction_stribeck_ratio=1.5, friction_stribeck_rate=0.1)
    rate = 0.072 / np.mean([lift(parameters, height) for height in np.linspace(1.3, 1.6, 7)])
    expected = 1.0 + 0.5 * np.exp(-((rate / 0.1) ** 2))
    assert abs(hysteresis(raised) / hysteresis(parameters) - expected) <= tolerances.HYSTERESIS * expected


def test_rest_does_not_know_of_friction() -> None:
    for name, parameters in parameter_sets().items():
        for height in (0.6, 1.5, 2.4):
            rest = native.equilibrium(parameters, (height, TORQUE))
            assert native.equilibrium(parameters.changed(**DRY), (height, TORQUE)).tolist() == rest.tolist()
            rows = native.simulate(
                parameters.changed(**DRY), np.tile((height, TORQUE), (200, 1)), SAMPLE_TIME
            )
            assert np.abs(rows[:, STATE_COLUMNS] - rest).max() <= tolerances.SETTLED, name


@pytest.mark.parametrize("unilateral", [0.0, 1.0])
@pytest.mark.parametrize("name", ["A", "Blow"])
def test_motion_with_friction_agrees_with_lagrange_and_another_integrator(
    name: str, unilateral: float
) -> None:
    parameters = parameter_sets()[name].changed(unilateral=unilateral, **DRY)
    start, inputs = native.equilibrium(parameters, START), (1.515, 1260.0)
    expected = motion(start, inputs, parameters.vector(), np.arange(251) * SAMPLE_TIME)
    found = native.simulate(parameters, np.tile(inputs, (251, 1)), SAMPLE_TIME, 5e-5, start)[:, STATE_COLUMNS]
    gap = np.abs(found - expected).max(axis=0) / np.ptp(expected, axis=0)
    assert gap.max() <= tolerances.WBM_BOUNCE


@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize("name", ["A", "Blow"])
def test_longest_step_is_that_of_the_linearised_friction(name: str, joint: str) -> None:
    """Just above the step of the message a run is refused; below, the fastest decay at rest stays stable."""
    parameters = parameter_sets()[name].changed(**{joint: 300.0})
    with pytest.raises(
        FmuError, match=r"row 0: inner_step = 0\.01 s is too long for this friction"
    ) as refused:
        native.simulate(parameters, np.tile(START, (2, 1)), 0.01, 0.01)
    longest = float(str(refused.value).split("at most ")[1].split(" s")[0])
    for height in np.linspace(0.5, 2.5, 9):
        rest = native.equilibrium(parameters, (height, TORQUE))
        with_friction = native.linearise(parameters, (height, TORQUE), rest).A
        without = native.linearise(parameter_sets()[name], (height, TORQUE), rest).A
        fastest = -np.linalg.eigvals(with_friction - without).real.min()
        assert fastest * longest <= tolerances.FRICTION_STEP
    native.simulate(parameters, np.tile(START, (3, 1)), longest, longest)
    with pytest.raises(FmuError, match="choose a shorter inner_step or a larger friction_slip_rate"):
        native.simulate(parameters, np.tile(START, (3, 1)), 1.001 * longest, 1.001 * longest)


def test_a_torque_below_coulombs_lets_the_arm_creep_and_not_swing() -> None:
    """tanh holds nothing: the rate is v_s atanh(M / T_c), and less once the wire takes its part."""
    step, coulomb, duration = 10.0, 30.0, 0.3
    base = parameter_sets()["Blow"]
    start, angle = native.equilibrium(base, START), native.OUTPUTS.index("phi_1")
    inputs = np.tile((1.5, TORQUE + step), (round(duration / SAMPLE_TIME) + 1, 1))
    free, dry = (
        float(np.ptp(native.simulate(chosen, inputs, SAMPLE_TIME, state=start)[:, angle]))
        for chosen in (base, base.changed(friction_base=coulomb))
    )
    creep = base["friction_slip_rate"] * np.arctanh(step / coulomb) * duration
    assert 0.5 * creep < dry < creep
    assert free > 3.0 * creep
