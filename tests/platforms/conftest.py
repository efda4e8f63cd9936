from __future__ import annotations

import zipfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import pytest
from local_networks import FORCE, local_models
from theta_networks import theta_network

from fmu_builder.compiler import TARGETS, host_platform
from fmu_builder.llmn_fmu import build_llmn
from fmu_builder.parameter_set import ParameterSet, TrainedRegion
from fmus.wbm import build_wbm
from fmus.wbm.variables import DEFAULT_INNER_STEP
from identification.n4sid import network
from identification.network import NetworkSettings
from platforms import machines
from platforms.machines import RUNNABLE, Machine
from platforms.scenarios import Fmu, all_of

NAMES = ("wbm", "surrogate", "n4sid", "n4sid_parameter")


def _n4sid(blending: Literal["output", "parameter"]) -> ParameterSet:
    settings = NetworkSettings(
        blending=blending,
        validity="cubic_warp",
        warp=(0.1, -0.05),
        nodes=21,
        offsets="scheduled_equilibrium",
    )
    return network(f"n4sid_{blending}", local_models((1.0, 1.1, 1.25, 1.4)), settings, (FORCE,))


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Fmu]:
    """Small FMUs of every kind, for the platforms that run here."""
    folder = tmp_path_factory.mktemp("fmus")
    here = tuple(name for name in RUNNABLE if machines.command_of(name) is not None) or (host_platform(),)
    wbm = build_wbm(folder / "wbm.fmu", here)
    region = TrainedRegion(rate=0.9, derived_outputs={"F_p": (20.0, 200.0)})
    trained = theta_network("chain8", 21, gain=0.2).replaced(trained_region=region)
    surrogate = build_llmn(trained, folder / "surrogate.fmu", here)
    plain = {
        name: _n4sid(blending) for name, blending in (("n4sid", "output"), ("n4sid_parameter", "parameter"))
    }
    changed = (("k_E", 8e4), ("theta_m_H_1", 9.5), ("theta_k_L_3", 21000.0))
    found = {"wbm": Fmu(wbm, DEFAULT_INNER_STEP), "surrogate": Fmu(surrogate, 1e-3, changed)}
    for name, one in plain.items():
        found[name] = Fmu(build_llmn(one, folder / f"{name}.fmu", here), 1e-3)
    for fmu in found.values():
        with zipfile.ZipFile(fmu.path) as archive:
            archive.extractall(fmu.path.with_suffix(""))
    return found


@dataclass
class Machines:
    """The machines of this session, each made when it is asked for, and what they printed."""

    folder: Path
    fmus: dict[str, Fmu]
    stack: ExitStack
    made: dict[str, Machine] = field(default_factory=dict)
    printed: dict[tuple[str, str], dict[str, list[str]]] = field(default_factory=dict)

    def machine(self, platform: str) -> Machine:
        if not self.made:
            chosen = [one for one in RUNNABLE if machines.command_of(one) is not None]
            environments = {one: self.stack.enter_context(machines.environment_of(one)) for one in chosen}
            with ThreadPoolExecutor() as pool:
                made = pool.map(lambda one: Machine(one, self.folder, environments[one]), chosen)
                self.made = dict(zip(chosen, made, strict=True))
        machines.require(platform in self.made, machines.NEEDS[platform])
        return self.made[platform]

    def library(self, platform: str, name: str) -> str:
        fmu = self.fmus[name]
        folder = fmu.path.with_suffix("") / "binaries" / platform
        return self.machine(platform).path(folder / f"{fmu.identifier}{TARGETS[platform].suffix}")

    def lines(self, platform: str, name: str) -> dict[str, list[str]]:
        """What every scenario of an FMU prints; one process for all."""
        if (platform, name) not in self.printed:
            commands = [f"load {self.library(platform, name)}"]
            for scenario, own in all_of(self.fmus[name]).items():
                commands += [f"note scenario:{scenario}", *own]
            found: dict[str, list[str]] = {}
            for line in self.machine(platform).run(commands):
                if line.startswith("scenario:"):
                    found[line.removeprefix("scenario:")] = current = []
                else:
                    current.append(line)
            self.printed[platform, name] = found
        return self.printed[platform, name]


@pytest.fixture(scope="session")
def all_machines(fmus: dict[str, Fmu], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Machines]:
    with ExitStack() as stack:
        yield Machines(tmp_path_factory.mktemp("drivers"), fmus, stack)
