"""Networks with a trained region, their FMUs loaded, and how tests drive them tick by tick."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import contact_networks
import fmpy
import networks
import numpy as np
from theta_networks import theta_network

from fmi.raw import ERROR, MODEL_EXCHANGE, OK, WARNING, Slave, load
from fmu_builder.compiler import host_platform
from fmu_builder.llmn_fmu import build_llmn
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


def build(name: str, folder: Path) -> Built:
    """The FMU of one of the networks; that of the surrogate with a proof for 6 m/s, which nobody has made."""
    network, proof = NETWORKS[name](), None
    if name == "surrogate":
        move = CERTIFIED * TICK
        proof = StabilityProof(network.model_hash(), CERTIFIED, move, 0.1, "Proved: x.", "Not: y.")
    path = build_llmn(network, folder / f"{name}.fmu", (host_platform(),), proof=proof)
    description = fmpy.read_model_description(str(path))
    references = {v.name: v.valueReference for v in description.modelVariables}
    return Built(network, path, load(path, folder), references, description.guid)
