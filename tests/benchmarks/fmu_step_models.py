"""What fmu_step.py steps: networks, committed and made by hand, and a slave that does nothing."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

TESTS = Path(__file__).resolve().parents[1]
sys.path.append(str(TESTS))  # the fixtures below import each other by file name

from local_networks import FORCE, local_models  # noqa: E402
from theta_networks import theta_network  # noqa: E402

import fmus  # noqa: E402
from fmu_builder.compiler import host_platform  # noqa: E402
from fmu_builder.fmi2 import build_fmu  # noqa: E402
from fmu_builder.kernel import tables_of  # noqa: E402
from fmu_builder.llmn_fmu import interface  # noqa: E402
from fmu_builder.parameter_set import ParameterSet, TrainedRegion  # noqa: E402
from identification.n4sid import network  # noqa: E402
from identification.network import NetworkSettings  # noqa: E402

NODES = 81
SCALES = (1.0, 1.1, 1.25, 1.4)


def surrogate(seed: int = 7) -> ParameterSet:
    """Three masses, four local models, theta blended over a node table: what ships."""
    return theta_network("chain8", NODES, seed=seed)


def n4sid(
    blending: Literal["output", "parameter"] = "output", scales: Sequence[float] = SCALES
) -> ParameterSet:
    """Four local models of six states, by default with outputs blended: the dearest blending."""
    settings = NetworkSettings(
        blending=blending,
        validity="cubic_warp",
        warp=(0.1, -0.05),
        nodes=NODES,
        offsets="scheduled_equilibrium",
    )
    return network("n4sid_network", local_models(scales), settings, (FORCE,))


def watched(parameter_set: ParameterSet) -> ParameterSet:
    """Return the network with a trained region that nothing leaves: every tick looks at every limit."""
    spans = {one.name: (-1e9, 1e9) for one in parameter_set.derived_outputs}
    return parameter_set.replaced(trained_region=TrainedRegion(rate=1e6, derived_outputs=spans))


def networks() -> dict[str, ParameterSet]:
    """Return what is measured: the committed networks of set A, and by hand what they do not have."""
    return {
        "surrogate": watched(fmus.network("surrogate")),
        "n4sid": watched(fmus.network("n4sid")),
        "surrogate, by hand": watched(surrogate()),
        "n4sid, output blending": watched(n4sid()),
    }


def build_empty(output: Path) -> Path:
    """Build the slave that does nothing, with the variables of the surrogate."""
    folder = Path(__file__).parent
    shown = interface(surrogate(), "empty_slave")
    unity = folder / "empty_slave.c"
    return build_fmu(shown, "empty", unity, (folder,), {}, output, (host_platform(),))


def multiply_adds(parameter_set: ParameterSet) -> int:
    """Return the multiply-adds that the equations of one tick need, and not one more.

    Counted: x+ = A x + B u and y = C x of every active model (two of a node table; all with output blending),
    their weighted sums, the interpolation of weights, g and static map between two points (one multiply-add
    per number), the rebase of the states, derived outputs. The column of B that a scheduled equilibrium
    replaces is not counted, nor is any division, comparison or address.
    """
    tables = tables_of(parameter_set)
    size = tables.sizes
    n, m, p, local = size["states"], size["inputs"], size["outputs"], size["local_models"]
    by_output = parameter_set.blending == "output"
    equilibrium = parameter_set.offsets.kind == "scheduled_equilibrium"
    active = local if by_output or not size["nodes"] else 2
    driven = m - 1 if equilibrium else m
    models = active * (n * n + n * driven + p * n)
    sums = active * (p if by_output else n + p)
    rebase = (active * n if by_output else active * n + n) if equilibrium else 0
    interpolated = local + (p if size["map_points"] else 0)
    feedthrough = p * m if size["feedthrough"] else 0
    return models + sums + rebase + interpolated + feedthrough + len(tables.arrays["term_coefficients"])


def inside(parameter_sets: Sequence[ParameterSet]) -> tuple[tuple[float, float], ...]:
    """Return per input a range that lies in the trained range of all."""
    lows = zip(*([s.minimum for s in one.inputs] for one in parameter_sets), strict=True)
    highs = zip(*([s.maximum for s in one.inputs] for one in parameter_sets), strict=True)
    return tuple((max(low), min(high)) for low, high in zip(lows, highs, strict=True))
