"""Physical parameters changed in the FMU of a surrogate: the bits of a surrogate made of them in Python."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from theta_networks import BASE, HEAD, inputs_of, theta_network, theta_of

import tolerances
from fmi.raw import ERROR, OK, WARNING, Slave, load
from fmu_builder.compiler import host_platform
from fmu_builder.errors import ParameterSetError
from fmu_builder.kernel import CHAINS, Network, simulate, with_parameters
from fmu_builder.llmn_fmu import build_llmn, interface, model_card
from fmu_builder.parameter_set import ParameterSet

OUTPUTS = ("xi", "xi_dot", "zeta", "zeta_dot", "F_H", "F_p")
START = (1.5, 1310.9)
SOFT = 4e4


@dataclass
class Opened:
    """An FMU, its parameter set, and makers of instances."""

    path: Path
    network: ParameterSet
    references: dict[str, int]
    new: Callable[..., Slave]

    def get(self, slave: Slave, *names: str) -> list[float]:
        values = slave.get([self.references[name] for name in names or OUTPUTS])
        assert values is not None, slave.last_error()
        return values

    def set(self, slave: Slave, **values: float) -> int:
        return slave.set([self.references[name] for name in values], list(values.values()))

    def set_theta(self, slave: Slave, theta: np.ndarray) -> int:
        names = [one.name for one in CHAINS[self.network.surrogate.structure]]
        rows = enumerate(theta.tolist(), start=1)
        return self.set(
            slave, **{f"theta_{n}_{k}": v for k, row in rows for n, v in zip(names, row, strict=True)}
        )

    def run(self, slave: Slave, inputs: np.ndarray, first: int = 0) -> np.ndarray:
        rows = []
        for k, row in enumerate(inputs, start=first):
            assert slave.set([0, 1], row.tolist()) == OK
            rows.append(self.get(slave))
            assert slave.step(k * 1e-3, 1e-3) == OK
        return np.array(rows)


def opened(network: ParameterSet, folder: Path) -> Iterator[Opened]:
    path = build_llmn(network, folder / "theta.fmu", (host_platform(),))
    description = fmpy.read_model_description(str(path))
    library, made = load(path, folder), []

    def new(**options: object) -> Slave:
        made.append(Slave(library, description.guid, **options))
        return made[-1]

    yield Opened(path, network, {v.name: v.valueReference for v in description.modelVariables}, new)
    for slave in made:
        slave.free()


@pytest.fixture(scope="module", params=["chain8", "chain10"])
def fmu(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Opened]:
    gain = 0.3 if request.param == "chain10" else 0.0
    network = theta_network(request.param, gain=gain)
    yield from opened(network, tmp_path_factory.mktemp("theta"))


def other_theta(network: ParameterSet) -> np.ndarray:
    return theta_of(network.surrogate.structure, seed=11)


def at_start(slave: Slave, first: np.ndarray) -> Slave:
    return slave.start(v0=float(first[0]), v1=float(first[1]))


def test_theta_and_contact_stiffness_set_before_the_start(fmu: Opened) -> None:
    inputs, theta = inputs_of(300), other_theta(fmu.network)
    changed = with_parameters(fmu.network, theta, SOFT)
    slave = fmu.new()
    assert fmu.set_theta(slave, theta) == OK
    assert fmu.set(slave, k_E=SOFT) == OK
    found = fmu.run(at_start(slave, inputs[0]), inputs)
    expected = simulate(changed, inputs)
    assert np.abs(found - expected).max() == tolerances.BITS
    assert np.abs(expected - simulate(fmu.network, inputs)).max() > 1.0


def test_parameters_left_alone_or_put_back_are_the_tables_as_built(fmu: Opened) -> None:
    inputs = inputs_of(200)
    slave, untouched = fmu.new(), fmu.new()
    assert fmu.set_theta(slave, other_theta(fmu.network)) == OK
    assert fmu.set_theta(slave, theta_of(fmu.network.surrogate.structure)) == OK
    found = fmu.run(at_start(slave, inputs[0]), inputs)
    again = fmu.run(at_start(untouched, inputs[0]), inputs)
    expected = simulate(fmu.network, inputs)
    assert np.abs(found - expected).max() == np.abs(again - expected).max() == tolerances.BITS


def test_nodes_made_of_the_start_values_are_those_that_were_built(fmu: Opened) -> None:
    """One bit more of k_E, and every node is made anew."""
    inputs = inputs_of(100)
    nearly = float(np.nextafter(HEAD["k_E"], 2e5))
    slave = fmu.new()
    assert fmu.set(slave, k_E=nearly) == OK
    found = fmu.run(at_start(slave, inputs[0]), inputs)
    assert (
        np.abs(found - simulate(with_parameters(fmu.network, contact_stiffness=nearly), inputs)).max() == 0.0
    )
    assert np.abs(found - simulate(fmu.network, inputs)).max() <= 1e-8


def test_theta_between_steps_goes_on_from_where_it_is(fmu: Opened) -> None:
    """At one height: the state of the network before, the equations of the network after."""
    inputs = np.column_stack([np.full(120, 1.37), 1310.9 + 90.0 * np.sin(0.2 * np.arange(120))])
    theta = other_theta(fmu.network)
    slave = at_start(fmu.new(), inputs[0])
    fmu.run(slave, inputs[:60])
    before = fmu.get(slave)
    assert fmu.set_theta(slave, theta) == OK
    assert fmu.get(slave) == before
    found = fmu.run(slave, inputs[60:], first=60)
    old, new = Network(fmu.network), Network(with_parameters(fmu.network, theta))
    old.start(inputs[0])
    for row in inputs[:60]:
        old.tick(row)
    new.start(inputs[0])
    new.state[:] = old.state
    for row, shown in zip(inputs[60:], found, strict=True):
        assert shown.tolist() == new.outputs(row).tolist()
        new.tick(row)


def test_contact_stiffness_between_steps_moves_the_force_not_the_head(fmu: Opened) -> None:
    slave = at_start(fmu.new(), np.array(START))
    before = dict(zip(OUTPUTS, fmu.get(slave), strict=True))
    assert fmu.set(slave, k_E=SOFT) == OK
    after = dict(zip(OUTPUTS, fmu.get(slave), strict=True))
    assert after["F_p"] == pytest.approx(before["F_p"] * SOFT / HEAD["k_E"], rel=1e-9)
    for name in OUTPUTS[:5]:
        assert after[name] == before[name]
    assert slave.step(0.0, 1e-3) == OK
    rate = fmu.get(slave, "xi_dot")[0]
    assert 1e-3 < rate < 0.1  # the head is pushed up by more than pushes it down
    assert slave.step(1e-3, 60.0) == OK
    rest = simulate(with_parameters(fmu.network, contact_stiffness=SOFT), [START])[0]
    np.testing.assert_allclose(fmu.get(slave), rest, rtol=1e-6, atol=1e-9)


def test_what_cannot_be_is_refused_and_nothing_changes(fmu: Opened) -> None:
    inputs = inputs_of(60)
    slave, other = (at_start(fmu.new(), inputs[0]) for _ in range(2))
    for one in (slave, other):
        assert fmu.set(one, k_E=SOFT) == OK
        fmu.run(one, inputs[:30])
    assert fmu.set(slave, theta_m_H_2=60.0) == ERROR
    assert "theta_m_H_2 = 60 is outside [" in slave.last_error()
    assert fmu.set(slave, theta_m_M_1=float("nan")) == ERROR
    assert fmu.set(slave, eta=1.9, theta_m_H_1=-8.0) == ERROR
    assert fmu.get(slave, "eta", "k_E") == [inputs[29, 0], SOFT]
    found, expected = (fmu.run(one, inputs[30:], first=30) for one in (slave, other))
    assert found.tolist() == expected.tolist()


@pytest.fixture(scope="module")
def springy(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Opened]:
    """A surrogate whose spring to the wall may pull."""
    yield from opened(theta_network("chain9", uneven=150.0), tmp_path_factory.mktemp("theta"))


def test_an_unstable_node_is_refused_and_nothing_changes(springy: Opened) -> None:
    inputs = inputs_of(60)
    slave, other = (at_start(springy.new(), inputs[0]) for _ in range(2))
    for one in (slave, other):
        assert springy.set(one, theta_c_W_3=50.0) == OK
        springy.run(one, inputs[:30])
    assert springy.set(slave, eta=1.9, theta_k_W_1=-1e7) == ERROR
    assert "at the height 0.5 m is unstable: the values are those before" in slave.last_error()
    assert springy.get(slave, "eta", "theta_k_W_1") == [inputs[29, 0], theta_of("chain9")[0, 6]]
    found, expected = (springy.run(one, inputs[30:], first=30) for one in (slave, other))
    assert found.tolist() == expected.tolist()


def test_a_contact_too_soft_for_the_static_map_is_refused(springy: Opened) -> None:
    slave = at_start(springy.new(), np.array(START))
    before = springy.get(slave)
    assert springy.set(slave, k_E=1e3) == ERROR
    assert "with so soft a contact the wire would have to fall" in slave.last_error()
    assert springy.get(slave) == before and springy.get(slave, "k_E") == [1e5]
    with pytest.raises(ParameterSetError, match="k_E: is so soft"):
        with_parameters(springy.network, contact_stiffness=1e3)


def test_what_was_refused_leaves_no_trace_in_a_saved_state(springy: Opened) -> None:
    slave, other = (at_start(springy.new(), np.array(START)) for _ in range(2))
    assert springy.set(slave, theta_k_W_1=-1e7) == ERROR
    assert springy.get(slave) == springy.get(other)
    refused, untouched = (one.to_bytes(one.save()) for one in (slave, other))
    assert refused == untouched


def test_what_was_refused_does_not_use_up_a_warning_that_is_given_once(springy: Opened) -> None:
    slave = at_start(springy.new(), np.array(START))
    assert springy.set(slave, eta=9.0, theta_k_W_1=-1e7) == ERROR
    assert [status for status, *_ in slave.log] == [ERROR]
    assert slave.step(0.0, 1e-3) == OK
    assert [status for status, *_ in slave.log] == [ERROR]
    assert springy.set(slave, eta=9.0) == OK
    assert slave.step(1e-3, 1e-3) == OK
    assert [status for status, *_ in slave.log] == [ERROR, WARNING]
    assert "eta = 9 is outside" in slave.log[-1][2]
    assert springy.set(slave, eta=9.5) == OK
    assert slave.step(2e-3, 1e-3) == OK
    assert len(slave.log) == 2


def test_before_the_start_the_whole_is_judged(springy: Opened) -> None:
    fmu, slave = springy, springy.new()
    assert fmu.set(slave, theta_k_W_1=-1e7) == OK
    slave.SetupExperiment(0, ctypes.c_double(0), ctypes.c_double(0), 0, ctypes.c_double(0))
    assert slave.EnterInitializationMode() == OK
    assert slave.ExitInitializationMode() == ERROR
    assert "with these physical parameters the model at the height 0.5 m is unstable" in slave.last_error()
    assert fmu.set(slave, theta_k_W_1=theta_of("chain9")[0, 6]) == OK
    assert slave.ExitInitializationMode() == OK
    assert fmu.get(slave) == simulate(fmu.network, [START])[0].tolist()


def test_states_hold_parameters_and_reset_forgets_them(fmu: Opened) -> None:
    inputs, theta = inputs_of(80), other_theta(fmu.network)
    slave, other = (at_start(fmu.new(), inputs[0]) for _ in range(2))
    fmu.run(slave, inputs[:40])
    fmu.set_theta(slave, theta)
    fmu.set(slave, k_E=SOFT)
    state = other.from_bytes(slave.to_bytes(slave.save()))
    assert state is not None and other.SetFMUstate(state) == OK
    assert fmu.get(other, "k_E", "theta_m_H_1") == [SOFT, theta[0, 0]]
    found, expected = (fmu.run(one, inputs[40:], first=40) for one in (other, slave))
    assert found.tolist() == expected.tolist()
    assert slave.Reset() == OK
    again = fmu.run(at_start(slave, inputs[0]), inputs)
    assert np.abs(again - simulate(fmu.network, inputs)).max() == tolerances.BITS


def test_it_is_said_once_that_scores_no_longer_apply(fmu: Opened) -> None:
    slave = at_start(fmu.new(), np.array(START))
    assert fmu.set(slave, k_E=HEAD["k_E"]) == OK and slave.log == []
    assert fmu.set(slave, k_E=SOFT) == OK and fmu.set(slave, k_E=2 * SOFT) == OK
    ((status, category, text),) = slave.log
    assert (status, category) == (WARNING, "logStatusWarning")
    assert text.startswith(
        "fmi2SetReal: physical parameters differ from those identified: the scores, and any"
    )


def test_derivatives_at_the_start_are_those_of_the_changed_network(fmu: Opened) -> None:
    theta = other_theta(fmu.network)
    slave = fmu.new()
    fmu.set_theta(slave, theta)
    fmu.set(slave, k_E=SOFT, eta=1.41, M_pa=1400.0)
    slave.SetupExperiment(0, ctypes.c_double(0), ctypes.c_double(0), 0, ctypes.c_double(0))
    assert slave.EnterInitializationMode() == OK
    kernel = Network(with_parameters(fmu.network, theta, SOFT))
    kernel.start([1.41, 1400.0])
    count = ctypes.c_size_t(6)
    unknown = (ctypes.c_uint * 6)(*(fmu.references[name] for name in OUTPUTS))

    def along(reference: int, seed: float) -> tuple[int, list[float]]:
        result = (ctypes.c_double * 6)()
        known, one = (ctypes.c_uint * 1)(reference), (ctypes.c_double * 1)(seed)
        status = slave.GetDirectionalDerivative(unknown, count, known, ctypes.c_size_t(1), one, result)
        return status, list(result)

    expected = kernel.steady_gain([1.41, 1400.0])[:6]
    for column in range(2):
        assert along(column, 1.0) == (OK, expected[:, column].tolist())
    assert along(fmu.references["theta_k_L_2"], 0.0) == (OK, [0.0] * 6)


def test_parameters_stand_behind_the_outputs_with_units_and_limits(fmu: Opened) -> None:
    assert validate_fmu(str(fmu.path)) == []
    variables = {v.name: v for v in fmpy.read_model_description(str(fmu.path)).modelVariables}
    names = [one.name for one in CHAINS[fmu.network.surrogate.structure]]
    listed = list(variables)[list(variables).index("in_range") + 1 :]
    theta = [f"theta_{name}_{k}" for k in range(1, 5) for name in names]
    assert listed == [
        "k_E",
        *theta,
        "out_of_range",
        "unilateral",
        *(["k_C", "c_C"] if listed[-1] == "c_C" else ["c_C", "k_C"]),
    ]
    mass = variables["theta_m_H_3"]
    assert (mass.causality, mass.variability, mass.initial, mass.unit) == (
        "parameter",
        "tunable",
        "exact",
        "kg",
    )
    assert float(mass.start) == theta_of(fmu.network.surrogate.structure)[2, 0] and float(mass.max) == 50.0
    stiffness = variables["k_E"]
    assert (float(stiffness.min), float(stiffness.start), float(stiffness.max)) == (1e3, 1e5, 1e7)
    head = variables["k_C"]
    assert (head.causality, head.variability, float(head.start)) == ("local", "constant", HEAD["k_C"])
    slave = at_start(fmu.new(), np.array(START))
    assert fmu.get(slave, "k_C") == [HEAD["k_C"]] and fmu.set(slave, k_C=1.0) == ERROR
    card = model_card(fmu.network, interface(fmu.network))
    assert "<td>theta_m_H_3</td><td>tunable</td>" in card and "Scores, and any certificate" in card


def test_without_its_theta_a_surrogate_has_constants_only() -> None:
    network = theta_network().replaced(surrogate=None)
    given = [v.name for v in interface(network).variables if v.causality == "parameter"]
    assert given == ["out_of_range", "unilateral"]
    known = {v.name: v.start for v in interface(network).variables if v.variability == "constant"}
    assert known == {name: HEAD[name] for name in ("k_C", "c_C", "k_E")}
    card = model_card(network, interface(network))
    assert "<td>k_E</td><td>constant</td><td>100000</td>" in card and "Tunable" not in card
    assert BASE["m_H"] == 8.0
