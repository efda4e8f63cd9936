"""The networks that ship beside the white-box FMU they were identified from, all as FMUs."""

from __future__ import annotations

import functools
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import fmus
from cosimulation.fmu_driver import StartValue, running_fmu
from cosimulation.fmu_file import OpenFmu, open_fmu
from cosimulation.pantograph import INPUTS, SIGNALS
from fmu_builder.errors import SettingsError
from identification.arrays import Array

SAMPLE_TIME = 0.001
"""Of the networks, and so of every run [s]."""
WHITE_BOX = "white-box"
"""Takes the place of a network's name in records of the reference itself."""
Record = dict[str, Any]


@dataclass(frozen=True)
class NetworkRun:
    """One run of a network.

    Attributes:
        outputs: [N, 6], the signals of a pantograph.
        in_range: [N], what the FMU says of the inputs of the tick before; row 0 of those at the start.
    """

    outputs: Array
    in_range: npt.NDArray[np.bool_]

    @property
    def force(self) -> Array:
        """Contact force [N], shape (N,)."""
        return self.outputs[:, SIGNALS.index("F_p")]


class SideBySide:
    """A white-box set and the networks identified from it; made by `side_by_side`.

    Attributes:
        wbm: The set.
        networks: Name to FMU.
    """

    def __init__(self, wbm: str, white_box: OpenFmu, networks: dict[str, OpenFmu]) -> None:
        self.wbm = wbm
        self.networks = networks
        self._white_box = white_box

    def reference(
        self,
        inputs: Array,
        start_values: Mapping[str, StartValue] | None = None,
        outputs: Sequence[str] = SIGNALS,
    ) -> Array:
        """Return what the white-box model gives, [N, len(outputs)].

        Args:
            inputs: [N, 2], height of the wire [m] and torque [N.m].
            start_values: Its options.
            outputs: Variables to read.

        Raises:
            FmuError: It refuses, for example a height out of its reach.
        """
        with running_fmu(self._white_box, "reference") as instance:
            start = {"preset": self.wbm, **(start_values or {})}
            return instance.run(inputs, INPUTS, outputs, SAMPLE_TIME, start)

    def network(
        self, name: str, inputs: Array, start_values: Mapping[str, StartValue] | None = None
    ) -> NetworkRun:
        """Return what a network gives; arguments as of `reference`.

        Raises:
            FmuError: It refuses, or an output is not finite.
        """
        with running_fmu(self.networks[name], name) as instance:
            outputs = instance.run(inputs, INPUTS, SIGNALS, SAMPLE_TIME, start_values, flags=("in_range",))
            return NetworkRun(outputs, instance.flags[:, 0].astype(np.bool_))


@contextmanager
def side_by_side(wbm: str, white_box: Path) -> Iterator[SideBySide]:
    """Open the white-box FMU and the networks of a set for as long as the block lasts.

    Args:
        wbm: White-box set.
        white_box: The FMU of the white-box model.

    Raises:
        SettingsError: No network comes with the project for this set.
        FmuError: An FMU cannot be opened.
    """
    names = networks_of(wbm)
    if not names:
        mend = f"Choose of {', '.join(sorted(set(fmus.NETWORKS.values())))}"
        raise SettingsError.of(f"sets, {wbm!r}", "no network that ships was identified from it", mend)
    with ExitStack() as stack:
        reference = stack.enter_context(open_fmu(white_box))
        networks = {name: stack.enter_context(open_fmu(fmus.path(name))) for name in names}
        yield SideBySide(wbm, reference, networks)


def networks_of(wbm: str) -> tuple[str, ...]:
    """Return the names of the networks that were identified from a white-box set."""
    return tuple(name for name, source in fmus.NETWORKS.items() if source == wbm)


@functools.cache
def _known(network: str) -> Record:
    """Return what score records say of a network; of anything else its name."""
    if network not in fmus.NETWORKS:
        return {"model": network}
    known = fmus.network(network)
    return {"model": known.kind, "llms": len(known.local_models), "blending": known.blending}


def model_of(network: str) -> str:
    """Return the kind of a network, which is its model in score records; of anything else its name."""
    return str(_known(network)["model"])


def network_labels(wbm: str, network: str, situation: str, seed: int) -> Record:
    """Return the labels of a score record of a network in a situation."""
    fixed = {"wbm": wbm, "data_set": situation, "noise": "none", "seed": seed, "split": "test"}
    return {**_known(network), **fixed, "recommended": True}


class NetworkFits:
    """FIT of the networks that ship, looked up by situation; the base of what a page needs of a study.

    Args:
        sets: White-box sets.
        scores: Score records.
    """

    def __init__(self, sets: tuple[str, ...], scores: Sequence[Record]) -> None:
        self.sets = sets
        self._fits: dict[tuple[str, str, str, str], list[float]] = defaultdict(list)
        for item in scores:
            fit = -np.inf if item["fit"] is None else item["fit"]
            self._fits[item["wbm"], item["model"], item["data_set"], item["signal"]].append(fit)

    def networks(self, wbm: str) -> tuple[str, ...]:
        """Return the networks of a white-box set."""
        return networks_of(wbm)

    def fits(self, wbm: str, network: str, situation: str, signal: str = "F_p") -> list[float]:
        """Return the FIT of a signal [%], one per seed."""
        return self._fits[wbm, model_of(network), situation, signal]

    def smallest_fit(self, wbm: str, situation: str, signal: str = "F_p") -> float:
        """Return the smallest FIT of a signal over networks and seeds [%], NaN where there is none."""
        every = [fit for name in self.networks(wbm) for fit in self.fits(wbm, name, situation, signal)]
        return min(every, default=float("nan"))


def median(values: Sequence[float]) -> float:
    """Return the median, NaN of nothing."""
    return float(np.median(values)) if values else float("nan")


def measured(name: str, value: float, unit: str, labels: Record) -> Record:
    """Return a finding that limits may be set on; what is not finite is None."""
    number = float(value)
    return {"measure": name, **labels, "value": number if np.isfinite(number) else None, "unit": unit}
