"""The trained region of a network in its FMU: in_range, the one warning, and the three policies."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import contact_networks
import fmpy
import networks
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from theta_networks import theta_network

from fmi.raw import ERROR, MODEL_EXCHANGE, OK, WARNING, Slave, load
from fmu_builder.check import Options, check_fmu
from fmu_builder.compiler import host_platform
from fmu_builder.kernel import specification
from fmu_builder.llmn_fmu import build_llmn, identity, interface, model_card
from fmu_builder.parameter_set import ParameterSet, StabilityProof, TrainedRegion

WARN, CLAMP, REFUSE = 1, 2, 3
TICK = 1e-3
EXCHANGE = (False, True)
CERTIFIED = 6.0


def blended() -> ParameterSet:
    """Three inputs of which the second schedules; D acts at once; the force y_2 - u_1 has limits."""
    network = networks.network(43, "affine", "parameter", "hat", feedthrough=True)
    region = TrainedRegion(rate=50.0, derived_outputs={"sum": (-40.0, 40.0)})
    return network.replaced(trained_region=region)


def touching() -> ParameterSet:
    """Made by hand, its pan-head y_2 may leave the wire u_1; nothing but the rate is known."""
    network = contact_networks.touching(("scheduled_equilibrium", "output", "hat"), 5)
    return network.replaced(trained_region=TrainedRegion(rate=30.0))


def surrogate() -> ParameterSet:
    """As `llmn identify` leaves them: at rest F_p is 66 N and more."""
    region = TrainedRegion(rate=4.0, derived_outputs={"F_p": (20.0, 150.0), "F_H": (-200.0, 200.0)})
    return theta_network().replaced(trained_region=region)


NETWORKS: dict[str, Callable[[], ParameterSet]] = {
    "blended": blended,
    "touching": touching,
    "surrogate": surrogate,
    "unknown": lambda: networks.network(43, "low_pass", "output", "gaussian", feedthrough=True),
}


@dataclass(frozen=True)
class Built:
    """An FMU, loaded, with what it was made of."""

    network: ParameterSet
    path: Path
    library: ctypes.CDLL
    references: dict[str, int]
    guid: str

    def new(self, policy: int = WARN, exchange: bool = False, **start: float) -> Slave:
        """An instance before its start, with its policy and start values set."""
        kind = {"kind": MODEL_EXCHANGE} if exchange else {}
        slave = Slave(self.library, self.guid, **kind)
        assert slave.set_integer(self.references["out_of_range"], policy) == OK
        if start.pop("unilateral", 0.0):
            one = ctypes.c_size_t(1)
            reference = (ctypes.c_uint * 1)(self.references["unilateral"])
            assert slave.SetBoolean(reference, one, (ctypes.c_int * 1)(1)) == OK
        for name, value in start.items():
            assert slave.set([self.references[name]], [value]) == OK
        return slave

    def flag(self, slave: Slave, name: str = "in_range") -> int | None:
        return slave.get_integer(self.references[name], "GetBoolean")

    def read(self, slave: Slave, *names: str) -> list[float] | None:
        return slave.get([self.references[name] for name in names or self.network.output_names])


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Built]:
    made: dict[str, Built] = {}

    def one(name: str) -> Built:
        if name not in made:
            folder, network = tmp_path_factory.mktemp(name), NETWORKS[name]()
            proof = None
            if name == "surrogate":
                move = CERTIFIED * TICK
                proof = StabilityProof(network.model_hash(), CERTIFIED, move, 0.1, "Proved: x.", "Not: y.")
            path = build_llmn(network, folder / f"{name}.fmu", (host_platform(),), proof=proof)
            description = fmpy.read_model_description(str(path))
            references = {v.name: v.valueReference for v in description.modelVariables}
            made[name] = Built(network, path, load(path, folder), references, description.guid)
        return made[name]

    return one


def begin(slave: Slave, exchange: bool = False) -> int:
    """Start at 0 s; the status of leaving initialisation mode."""
    assert slave.SetupExperiment(0, ctypes.c_double(0), ctypes.c_double(0), 0, ctypes.c_double(0)) == OK
    assert slave.EnterInitializationMode() == OK
    status = int(slave.ExitInitializationMode())
    if status == OK and exchange:
        slave.run()
    return status


def advance(slave: Slave, tick: int, inputs: Sequence[float], exchange: bool = False) -> int:
    """One tick with these inputs; in model exchange they are set in the event in which it begins."""
    if not exchange:
        assert slave.set(range(len(inputs)), inputs) == OK
        return int(slave.step(tick * TICK, TICK))
    assert slave.set_time(tick * TICK) == OK
    assert slave.EnterEventMode() == OK
    assert slave.set(range(len(inputs)), inputs) == OK
    assert slave.EnterContinuousTimeMode() == OK
    assert slave.set_time((tick + 1) * TICK) == OK
    assert slave.EnterEventMode() == OK
    status = OK if slave.update() is not None else ERROR
    if status == OK:
        assert slave.EnterContinuousTimeMode() == OK
    return status


def told(slave: Slave) -> list[str]:
    """The warnings, without the name of the function."""
    return [text.split(": ", 1)[1] for status, _, text in slave.log if status == WARNING]


def rows_of(network: ParameterSet, seed: int, count: int = 60) -> np.ndarray:
    """Inputs inside and outside of all limits, in small moves and in jumps."""
    random = np.random.default_rng(seed)
    low, high = (np.array([getattr(one, end) for one in network.inputs]) for end in ("minimum", "maximum"))
    region = network.trained_region
    rate = 10.0 if region is None else region.rate
    size = np.full(low.size, 0.02) * (high - low)
    size[network.scheduling_index] = 0.05 * rate * TICK
    rows = np.array([one.operating_point for one in network.inputs]) + np.cumsum(
        random.uniform(-1.0, 1.0, (count, low.size)) * size, axis=0
    )
    for index in range(low.size):
        places = random.choice(count - 1, 6, replace=False) + 1
        rows[places, index] += random.uniform(-1.0, 1.0, 6) * (high - low)[index]
    return rows


@pytest.mark.parametrize("exchange", EXCHANGE)
@pytest.mark.parametrize("policy", [WARN, CLAMP])
@pytest.mark.parametrize("name", NETWORKS)
def test_outputs_and_in_range_have_the_bits_of_the_specification(
    built: Callable[[str], Built], name: str, policy: int, exchange: bool
) -> None:
    fmu = built(name)
    rows = rows_of(fmu.network, 4)
    oracle = specification.Network(fmu.network, limited=policy == CLAMP)
    oracle.start(rows[0].tolist())
    start = dict(zip(fmu.network.input_names, rows[0].tolist(), strict=True))
    slave = fmu.new(policy, exchange, **start)
    assert begin(slave, exchange) == OK
    flags = []
    for tick, row in enumerate(rows):
        flags.append(oracle.in_range)
        assert fmu.flag(slave) == int(oracle.in_range), tick
        assert advance(slave, tick, row.tolist(), exchange) == OK
        oracle.tick(row.tolist())
        assert fmu.read(slave) == oracle.outputs(row.tolist())
    assert 5 < sum(flags) < len(flags) - 5
    assert len(told(slave)) - sum("stability is proved" in text for text in told(slave)) == 1


@pytest.mark.parametrize("name", NETWORKS)
def test_data_inside_have_the_same_bits_under_every_policy(built: Callable[[str], Built], name: str) -> None:
    """Up and down as fast as in training."""
    fmu = built(name)
    region, network = fmu.network.trained_region, fmu.network
    index = network.scheduling_index
    step = 0.01 if region is None else region.rate * TICK
    middle = [one.operating_point for one in network.inputs]
    runs = []
    for policy in (WARN, CLAMP, REFUSE):
        slave = fmu.new(policy, **dict(zip(network.input_names, middle, strict=True)))
        assert begin(slave) == OK
        values, row = [], list(middle)
        for tick in range(80):
            row[index] += step * (1 if tick % 40 < 20 else -1) * 0.99999
            assert advance(slave, tick, row) == OK
            values.append(fmu.read(slave))
        runs.append(values)
    assert runs[0] == runs[1] == runs[2]


@pytest.mark.parametrize("exchange", EXCHANGE)
def test_the_first_limit_that_is_left_is_logged_once_and_anew_after_a_reset(
    built: Callable[[str], Built], exchange: bool
) -> None:
    fmu = built("surrogate")
    slave = fmu.new(WARN, exchange)
    for _ in range(2):
        assert begin(slave, exchange) == OK
        slave.log.clear()
        assert advance(slave, 0, [1.5, 1310.9], exchange) == OK
        assert (fmu.flag(slave), told(slave)) == (1, [])
        assert advance(slave, 1, [1.5, 1800.0], exchange) == OK
        assert fmu.flag(slave) == 0
        assert advance(slave, 2, [2.9, 1310.9], exchange) == OK
        assert advance(slave, 3, [2.9, 2000.0], exchange) == OK
        texts = [text for text in told(slave) if "stability" not in text]
        what = "M_pa = 1800 is outside [1000, 1700] at t = 0.001 s: the model extrapolates (reported once)"
        assert texts == [what]
        assert slave.Reset() == OK
        assert slave.set_integer(fmu.references["out_of_range"], WARN) == OK


def test_a_value_that_no_tick_uses_leaves_nothing(built: Callable[[str], Built]) -> None:
    fmu = built("surrogate")
    slave = fmu.new(eta=9.0)
    assert slave.set([0], [1.5]) == OK
    assert begin(slave) == OK
    assert slave.set([1], [1e6]) == OK
    assert slave.set([1], [1300.0]) == OK
    assert slave.step(0.0, TICK) == OK
    assert (fmu.flag(slave), told(slave)) == (1, [])


def test_a_height_that_moves_faster_than_in_training(built: Callable[[str], Built]) -> None:
    fmu = built("surrogate")
    slave = fmu.new()
    assert begin(slave) == OK
    assert advance(slave, 0, [1.504, 1310.9]) == OK  # 4 mm, and rounded up
    assert advance(slave, 1, [1.504 + 0.9999 * 4e-3, 1310.9]) == OK
    assert advance(slave, 2, [1.504, 1310.9]) == OK
    faster = fmu.new(eta=1.5)
    assert begin(faster) == OK
    assert advance(faster, 0, [1.495, 1310.9]) == OK
    assert fmu.flag(faster) == 0
    (text,) = told(faster)
    assert text.startswith("the rate of eta = -5 is outside [-4, 4] at t = 0 s: ")
    assert advance(faster, 1, [1.495, 1310.9]) == OK
    assert fmu.flag(faster) in (0, 1)
    assert len(told(faster)) == 1


def test_an_input_held_over_a_long_step_jumps_and_a_slope_does_not(built: Callable[[str], Built]) -> None:
    fmu = built("surrogate")
    jumping, sloping = fmu.new(), fmu.new()
    for slave in (jumping, sloping):
        assert begin(slave) == OK
    for step in range(4):
        height = 1.5 + 0.01 * step
        assert sloping.slope([0], [1.0]) == OK
        for slave in (jumping, sloping):
            assert slave.set([0], [height]) == OK
            assert slave.step(0.01 * step, 0.01) == OK
    assert any("the rate of eta = 10 is outside" in text for text in told(jumping))
    assert not any("the rate of" in text for text in told(sloping))


def test_a_force_that_training_has_not_seen(built: Callable[[str], Built]) -> None:
    """The force at the beginning of the tick, of its inputs: that of a row of data."""
    fmu = built("surrogate")
    slave = fmu.new()
    assert begin(slave) == OK
    (force,) = fmu.read(slave, "F_p") or [0.0]
    assert 20.0 < force < 150.0
    height = 1.5 - (170.0 - force) / 1e5  # the wire comes down by 1 mm, well below the rate
    assert slave.set([0], [height]) == OK
    (pressed,) = fmu.read(slave, "F_p") or [0.0]
    assert pressed == pytest.approx(170.0)
    assert fmu.flag(slave) == 1  # no tick has used it yet
    assert slave.step(0.0, TICK) == OK
    assert fmu.flag(slave) == 0
    assert told(slave) == [
        "F_p = 170 is outside [20, 150] at t = 0 s: the model extrapolates (reported once)"
    ]
    for policy in (CLAMP, REFUSE):
        other = fmu.new(policy)
        assert begin(other) == OK
        assert advance(other, 0, [height, 1310.9]) == OK  # a force is the model's own answer: told, no error
        assert told(other) == told(slave)


def test_the_start_counts(built: Callable[[str], Built]) -> None:
    fmu = built("surrogate")
    slave = fmu.new(eta=2.55)  # within the input's own limits, beyond the range
    assert begin(slave) == OK
    assert fmu.flag(slave) == 0
    what = "eta = 2.55 is outside [0.5, 2.5] at t = 0 s"
    assert told(slave) == [f"{what}: the model extrapolates (reported once)"]
    clamped, inside = fmu.new(CLAMP, eta=2.55), fmu.new(eta=2.5)
    assert begin(clamped) == begin(inside) == OK
    assert fmu.read(clamped) == fmu.read(inside)
    assert (fmu.flag(clamped), fmu.flag(inside)) == (0, 1)
    assert told(clamped) == [f"{what}: the limit acts in its place (reported once)"]
    refused = fmu.new(REFUSE, eta=2.55)
    assert begin(refused) == ERROR
    mend = "keep to what was trained, or set out_of_range to warn or clamp"
    assert refused.last_error() == f"fmi2ExitInitializationMode: {what}: {mend}"
    assert refused.set([0], [1.5]) == OK and refused.ExitInitializationMode() == OK
    later = fmu.new(eta=2.55)
    assert later.SetupExperiment(0, ctypes.c_double(0), ctypes.c_double(7.25), 0, ctypes.c_double(0)) == OK
    assert later.EnterInitializationMode() == OK and later.ExitInitializationMode() == OK
    assert "at t = 7.25 s" in told(later)[0]


def test_clamped_inputs_are_limited_and_the_height_follows_at_the_rate_of_training(
    built: Callable[[str], Built],
) -> None:
    fmu = built("surrogate")
    given, allowed = fmu.new(CLAMP), fmu.new(WARN)
    assert begin(given) == begin(allowed) == OK
    step, height = fmu.network.trained_region.rate * TICK, 1.5  # type: ignore[union-attr]
    for tick in range(40):
        height = height + step if 1.6 - height > step else 1.6
        assert advance(given, tick, [1.6, 9999.0]) == OK
        assert advance(allowed, tick, [height, 1700.0]) == OK
        assert fmu.read(given) == fmu.read(allowed) or tick < 25
        assert fmu.read(given, "xi", "zeta") == fmu.read(allowed, "xi", "zeta")
        assert fmu.flag(given) == 0  # it tells of what was given
        assert fmu.flag(given, "outside_certificate") == 0  # and this of what acts
    (force,) = fmu.read(given, "F_p") or [0.0]
    assert abs(force) < 1e4
    assert given.set([0], [9.0]) == OK
    (jump,) = fmu.read(given, "F_p") or [0.0]
    assert jump == pytest.approx(force - step * 1e5, rel=1e-9)  # k_E (xi - eta as it acts), not 740 kN


@pytest.mark.parametrize("exchange", EXCHANGE)
def test_an_error_says_what_and_leaves_the_states_of_before(
    built: Callable[[str], Built], exchange: bool
) -> None:
    fmu = built("surrogate")
    slave = fmu.new(REFUSE, exchange)
    assert begin(slave, exchange) == OK
    assert advance(slave, 0, [1.501, 1310.9], exchange) == OK
    saved, before = slave.save(), fmu.read(slave, "xi", "xi_dot", "zeta", "zeta_dot")
    assert advance(slave, 1, [1.501, 1700.1], exchange) == ERROR
    call = "fmi2NewDiscreteStates" if exchange else "fmi2DoStep"
    mend = "keep to what was trained, or set out_of_range to warn or clamp"
    assert slave.last_error() == f"{call}: M_pa = 1700.1 is outside [1000, 1700] at t = 0.001 s: {mend}"
    assert fmu.read(slave, "xi", "xi_dot", "zeta", "zeta_dot") == before
    assert slave.SetFMUstate(saved) == OK
    assert advance(slave, 1, [1.6, 1310.9], exchange) == ERROR
    assert f"the rate of eta = 99 is outside [-4, 4] at t = 0.001 s: {mend}" in slave.last_error()
    assert slave.Reset() == OK
    assert begin(slave, exchange) == OK  # out_of_range is warn again
    assert advance(slave, 0, [1.6, 1310.9], exchange) == OK
    assert fmu.flag(slave) == 0


def test_a_saved_state_brings_back_what_was_left_and_where_moves_count_from(
    built: Callable[[str], Built],
) -> None:
    fmu = built("surrogate")
    for policy in (WARN, CLAMP):
        slave = fmu.new(policy)
        assert begin(slave) == OK
        assert advance(slave, 0, [1.52, 1310.9]) == OK
        content = slave.to_bytes(slave.save())
        runs = []
        for other in (slave, fmu.new(WARN)):
            state = other.from_bytes(content)
            assert state is not None and other.SetFMUstate(state) == OK
            values = [(fmu.flag(other), fmu.read(other))]
            for tick, height in enumerate((1.52, 1.522, 1.524), start=1):
                assert advance(other, tick, [height, 1310.9]) == OK
                values.append((fmu.flag(other), fmu.read(other)))
            runs.append(values)
        assert runs[0] == runs[1]
        assert runs[0][0][0] == 0


@pytest.mark.parametrize("name", NETWORKS)
def test_directional_derivatives_under_clamp_are_those_of_differences(
    built: Callable[[str], Built], name: str
) -> None:
    fmu = built(name)
    network, index = fmu.network, fmu.network.scheduling_index
    names = [*network.output_names, *(f"validity_{k}" for k in range(1, 5))]
    unknown = [fmu.references[one] for one in names]
    middle = [one.operating_point for one in network.inputs]
    beyond = [one.maximum + 0.3 for one in network.inputs]
    places = [middle, beyond, [*middle[:index], beyond[index], *middle[index + 1 :]]]

    def derivative(slave: Slave, column: int) -> np.ndarray:
        count, result = ctypes.c_size_t(len(unknown)), (ctypes.c_double * len(unknown))()
        vr, known = (ctypes.c_uint * len(unknown))(*unknown), (ctypes.c_uint * 1)(column)
        one = (ctypes.c_double * 1)(1.0)
        assert slave.GetDirectionalDerivative(vr, count, known, ctypes.c_size_t(1), one, result) == OK
        return np.array(result)

    def differences(read: Callable[[float], list[float] | None], size: float) -> np.ndarray:
        ends = [np.array(read(sign * 1e-6 * size)) for sign in (1.0, -1.0)]
        return np.asarray((ends[0] - ends[1]) / (2e-6 * size))

    for place in places:
        start = fmu.new(CLAMP)
        assert start.SetupExperiment(0, ctypes.c_double(0), ctypes.c_double(0), 0, ctypes.c_double(0)) == OK
        assert start.EnterInitializationMode() == OK
        running = fmu.new(CLAMP)
        assert begin(running) == OK
        assert advance(running, 0, middle) == OK
        for slave in (start, running):
            for column, one in enumerate(network.inputs):

                def read(
                    change: float, slave: Slave = slave, column: int = column, place: list[float] = place
                ) -> list[float] | None:
                    row = list(place)
                    row[column] += change
                    assert slave.set(range(len(row)), row) == OK
                    return slave.get(unknown)

                expected = differences(read, one.maximum - one.minimum)
                read(0.0)
                found = derivative(slave, column)
                scale = np.abs(expected).max() + 1.0
                assert np.abs(found - expected).max() < 2e-4 * scale
                if place[column] > one.maximum:
                    assert not found.any()


def test_limits_come_before_the_contact(built: Callable[[str], Built]) -> None:
    """The pan-head may leave the wire where limits hold it; moves count before the contact."""
    fmu = built("surrogate")
    network = fmu.network
    rows = rows_of(network, 8, 200)
    oracle = specification.Network(network, unilateral=True, limited=True)
    oracle.start(rows[0].tolist())
    start = dict(zip(network.input_names, rows[0].tolist(), strict=True))
    slave = fmu.new(CLAMP, unilateral=1.0, **start)
    assert begin(slave) == OK
    seen = set()
    for tick, row in enumerate(rows):
        assert advance(slave, tick, row.tolist()) == OK
        oracle.tick(row.tolist())
        assert fmu.read(slave) == oracle.outputs(row.tolist())
        assert fmu.flag(slave) == int(oracle.in_range)
        seen.add((oracle.in_range, (fmu.read(slave, "F_p") or [1.0])[0] == 0.0))
    assert len(seen) >= 3  # inside and outside, off the wire and on it


def test_a_flight_that_training_has_not_seen_is_outside(built: Callable[[str], Built]) -> None:
    fmu = built("surrogate")
    slave = fmu.new(unilateral=1.0)
    assert begin(slave) == OK
    flags = []
    for tick in range(6):
        assert advance(slave, tick, [1.5 + 1e-3 * min(tick, 3), 1310.9]) == OK
        flags.append((fmu.flag(slave), (fmu.read(slave, "F_p") or [1.0])[0] > 0.0))
    assert flags[0] == (1, True)
    assert flags[-1] == (0, False)
    assert any("F_p = 0 is outside [20, 150]" in text for text in told(slave))
    assert fmu.flag(slave, "outside_certificate") == 1


def test_policy_is_fixed_and_has_three_items(built: Callable[[str], Built]) -> None:
    fmu = built("surrogate")
    slave = fmu.new()
    reference = fmu.references["out_of_range"]
    assert slave.set_integer(reference, 4) == ERROR
    assert slave.set_integer(reference, 0) == ERROR
    assert slave.set_integer(reference, CLAMP) == OK
    assert slave.get_integer(reference) in (None, CLAMP)
    assert begin(slave) == OK
    assert slave.get_integer(reference) == CLAMP
    assert slave.set_integer(reference, WARN) == ERROR
    description = fmpy.read_model_description(str(fmu.path))
    (variable,) = [v for v in description.modelVariables if v.name == "out_of_range"]
    assert (variable.type, variable.start, variable.variability) == ("Enumeration", "1", "fixed")
    assert [item.name for item in variable.declaredType.items] == ["warn", "clamp", "error"]


@pytest.mark.parametrize("name", NETWORKS)
def test_checkers_find_nothing(built: Callable[[str], Built], name: str) -> None:
    path = built(name).path
    assert validate_fmu(str(path)) == []
    assert list(check_fmu(path, Options()).findings) == []


def test_a_set_without_a_region_watches_its_inputs_only(built: Callable[[str], Built]) -> None:
    fmu = built("unknown")
    assert fmu.network.trained_region is None
    assert identity(fmu.network) == fmu.network.model_hash()
    slave = fmu.new()
    assert begin(slave) == OK
    middle = [one.operating_point for one in fmu.network.inputs]
    for tick, height in enumerate((0.6, 2.4, 0.6)):
        assert advance(slave, tick, [middle[0], height, middle[2]]) == OK
        assert fmu.flag(slave) == 1
    assert told(slave) == []


def test_another_region_is_another_fmu_and_the_card_says_what_it_is() -> None:
    network = surrogate()
    plain, region = network.replaced(trained_region=None), network.trained_region
    assert region is not None
    others = [
        region.model_copy(update={"rate": float(np.nextafter(region.rate, 9.0))}),
        region.model_copy(update={"derived_outputs": {"F_p": (20.0, 151.0)}}),
    ]
    sets = [plain, network, *(network.replaced(trained_region=one) for one in others)]
    assert len({interface(one).guid(identity(one)) for one in sets}) == 4
    assert len({one.model_hash() for one in sets}) == 1
    banded = region.model_copy(update={"frequency_bands": {"eta": (0.2, 104.0)}})
    shown = network.replaced(trained_region=banded)
    card = model_card(shown, interface(shown))
    for part in (
        "eta moved by at most 4 m/s",
        "F_p was in 20 .. 150 N",
        "<td>F_p</td><td>N</td><td>20</td><td></td><td>150</td>",
        "<td>eta</td><td>0.2</td><td>104</td>",
        "out_of_range says what an input outside does",
    ):
        assert part in card
    assert "is not known, nor at which frequencies" in model_card(plain, interface(plain))
