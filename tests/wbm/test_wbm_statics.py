"""Static map, crossbar drift and poles against the figures of the reference."""

from __future__ import annotations

import numpy as np
import pytest

import tolerances
from fmu_builder.errors import LlmnError
from fmus.wbm import native, operating_point, parameter_sets

TORQUE = operating_point()["M_pa"]
HEIGHTS = np.linspace(0.5, 2.5, 41)
F_P = native.OUTPUTS.index("F_p")
NAMES = tuple(parameter_sets())

STATIC_FORCE = {"A": (67.0, 69.8), "A60": (67.0, 69.8), "B": (63.8, 66.3), "Blow": (69.6, 79.5)}
DRIFT = {"A": 0.104, "A60": 0.104, "B": 0.087, "Blow": 0.069}
SLOPE = {"A": (0.262, 0.283), "A60": (0.262, 0.283), "B": (0.226, 0.252), "Blow": (0.231, 0.270)}
CRITICAL_TORQUE = {"A": (1055, 1067), "A60": (1055, 1067), "B": (1017, 1051), "Blow": (1010, 1033)}
DAMPING = {
    "A": (0.070, 0.031, 0.035),
    "A60": (0.088, 0.045, 0.075),
    "B": (0.097, 0.185, 0.088),
    "Blow": (0.030, 0.047, 0.025),
}
# height: for z_L, z_M, z_H the pole of the model sampled at 1 kHz, |s|/2pi in Hz, damping ratio
POLES_OF_A = {
    0.75: [
        (0.998445 + 0.020220j, 3.230, 0.0666),
        (0.993840 + 0.082215j, 13.144, 0.0335),
        (0.982057 + 0.147481j, 23.750, 0.0466),
    ],
    1.25: [
        (0.998406 + 0.020420j, 3.262, 0.0676),
        (0.994236 + 0.078978j, 12.623, 0.0332),
        (0.983997 + 0.142829j, 22.959, 0.0396),
    ],
    1.75: [
        (0.998315 + 0.020898j, 3.339, 0.0700),
        (0.994964 + 0.073588j, 11.756, 0.0314),
        (0.986232 + 0.137163j, 22.004, 0.0310),
    ],
    2.25: [
        (0.998081 + 0.022187j, 3.547, 0.0751),
        (0.995885 + 0.066948j, 10.687, 0.0278),
        (0.987973 + 0.132354j, 21.201, 0.0241),
    ],
}


def rest(name: str, height: float, torque: float = TORQUE) -> np.ndarray:
    """The eleven outputs at rest."""
    return native.simulate(parameter_sets()[name], [[height, torque]])[0]


def modes(name: str, height: float) -> np.ndarray:
    """The three continuous poles with positive imaginary part, slowest first."""
    poles = np.linalg.eigvals(native.linearise(parameter_sets()[name], (height, TORQUE)).A)
    assert (poles.real < 0.0).all()
    return np.array(sorted(poles[poles.imag > 0.0], key=abs))


@pytest.mark.parametrize("name", NAMES)
def test_static_contact_force_hardly_depends_on_height(name: str) -> None:
    force = np.array([rest(name, height)[F_P] for height in HEIGHTS])
    low, high = STATIC_FORCE[name]
    assert abs(force.min() - low) < tolerances.STATIC_FORCE
    assert abs(force.max() - high) < tolerances.STATIC_FORCE


@pytest.mark.parametrize("name", NAMES)
def test_crossbar_drift_is_symmetric_and_of_known_size(name: str) -> None:
    drift = np.array([rest(name, height)[native.OUTPUTS.index("crossbar_drift")] for height in HEIGHTS])
    assert abs(drift.max() - DRIFT[name]) < tolerances.DRIFT
    assert abs(drift.min() + DRIFT[name]) < tolerances.DRIFT


@pytest.mark.parametrize("name", NAMES)
def test_force_per_torque_and_critical_torque(name: str) -> None:
    """1/z1 at rest, and the torque at which it would take the contact force to zero."""
    lift, critical = [], []
    for height in HEIGHTS:
        model = native.linearise(parameter_sets()[name], (height, TORQUE))
        lift.append(model.C[native.OUTPUTS.index("zeta"), native.STATES.index("phi_1")])
        critical.append(TORQUE - rest(name, height)[F_P] * lift[-1])
    slope = 1.0 / np.array(lift)
    assert abs(slope.min() - SLOPE[name][0]) < tolerances.SLOPE
    assert abs(slope.max() - SLOPE[name][1]) < tolerances.SLOPE
    assert abs(min(critical) - CRITICAL_TORQUE[name][0]) < tolerances.CRITICAL_TORQUE
    assert abs(max(critical) - CRITICAL_TORQUE[name][1]) < tolerances.CRITICAL_TORQUE


def test_contact_force_is_nearly_linear_in_the_torque() -> None:
    """Set A: 0.13 N from the chord over +-150 N.m at mid height; the band at +-75 N.m."""
    torques = TORQUE + np.linspace(-150.0, 150.0, 61)
    force = np.array([rest("A", 1.5, torque)[F_P] for torque in torques])
    chord = np.interp(torques, torques[[0, -1]], force[[0, -1]])
    assert abs(np.abs(force - chord).max() - 0.13) < 0.005
    for change, low, high in ((-75.0, 47.5, 48.6), (75.0, 85.9, 90.9)):
        band = [rest("A", height, TORQUE + change)[F_P] for height in HEIGHTS]
        assert abs(min(band) - low) < tolerances.LAST_DIGIT
        assert abs(max(band) - high) < tolerances.LAST_DIGIT


@pytest.mark.parametrize("height", POLES_OF_A)
def test_poles_of_set_a(height: float) -> None:
    for pole, (sampled, frequency, damping) in zip(modes("A", height), POLES_OF_A[height], strict=True):
        assert abs(np.exp(pole * 1e-3) - sampled) < tolerances.POLE
        assert abs(abs(pole) / (2.0 * np.pi) - frequency) < tolerances.POLE_FREQUENCY
        assert abs(-pole.real / abs(pole) - damping) < tolerances.POLE_DAMPING


@pytest.mark.parametrize("name", NAMES)
def test_three_stable_complex_pairs_with_the_mean_damping(name: str) -> None:
    damping = np.array([[-p.real / abs(p) for p in modes(name, height)] for height in HEIGHTS])
    assert damping.shape == (len(HEIGHTS), 3)
    assert np.abs(damping.mean(axis=0) - DAMPING[name]).max() < tolerances.MEAN_DAMPING


def test_sets_differ_only_where_they_say() -> None:
    sets = parameter_sets()
    assert tuple(sets) == ("A", "A60", "B", "Blow")
    changed = {name for name, value in sets["A"].values().items() if sets["A60"][name] != value}
    assert changed == {"c_C", "c_d"}
    for entry in (entry for chosen in sets.values() for entry in chosen.entries):
        assert entry.unit and entry.description and entry.provenance


def test_changed_refuses_all_unknown_names_at_once() -> None:
    with pytest.raises(LlmnError) as caught:
        parameter_sets()["A"].changed(k_c=1.0, mass=2.0, l1=1.7)
    assert [problem.place for problem in caught.value.problems] == ["k_c", "mass"]


@pytest.mark.parametrize("name", ["A", "Blow"])
def test_held_inputs_bias_the_contact_force_on_a_ramp(name: str) -> None:
    """Right after eta is set on a rising wire, F_p is too low by k_E eta_dot Ts / 2 (it falls with Ts)."""
    speed, duration = 0.072, 4.0
    parameters = parameter_sets()[name]

    def late_mean(sample_time: float) -> float:
        wire = 1.3 + speed * np.arange(round(duration / sample_time)) * sample_time
        rows = native.simulate(parameters, np.column_stack([wire, np.full(wire.size, TORQUE)]), sample_time)
        return float(rows[wire.size // 2 :, F_P].mean())

    bias = late_mean(0.002) - late_mean(0.001)
    expected = -parameters["k_E"] * speed * (0.002 - 0.001) / 2.0
    assert abs(bias - expected) < tolerances.HELD_INPUT_BIAS * abs(expected)
