"""The committed networks carry a proof of stability, and their FMUs tell when it says nothing."""

from __future__ import annotations

import numpy as np
import pytest
from fmu_runner import opened

import fmus
from identification.stability import proved

RATE = 6.0  # m/s
START = np.array([1.5, 1310.9])


@pytest.mark.parametrize("name", fmus.NETWORKS)
def test_the_shipped_networks_carry_a_proof(name: str) -> None:
    found = proved(fmus.network(name))
    assert found is not None and found.decay > 0.0
    assert found.rate is None or found.rate >= RATE
    assert "FIT" in found.statement and "F_p" in found.statement  # certificate and FIT on one line


def outside_after(name: str, rise: float, unilateral: bool) -> list[bool]:
    """outside_certificate of a shipped FMU while the wire rises by so much per tick, m."""
    flags = []
    with opened(fmus.path(name), START, ready=False) as (slave, references):
        slave.setBoolean([references["unilateral"]], [unilateral])
        slave.exitInitializationMode()
        for k in range(20):
            slave.setReal([0], [START[0] + rise * k])
            slave.doStep(currentCommunicationPoint=k * 1e-3, communicationStepSize=1e-3)
            flags += slave.getBoolean([references["outside_certificate"]])
    return [bool(flag) for flag in flags]


@pytest.mark.parametrize("name", fmus.NETWORKS)
def test_a_wire_that_is_faster_than_the_proof_is_told(name: str) -> None:
    assert not any(outside_after(name, 0.99e-3 * RATE, unilateral=False))
    assert outside_after(name, 1.01e-3 * RATE, unilateral=False)[1:] == [True] * 19


@pytest.mark.parametrize("name", ["surrogate_blow", "n4sid_blow"])
def test_an_open_contact_is_told(name: str) -> None:
    """Off the wire the height follows the states: a loop, for which nothing is proved."""
    flags = outside_after(name, 2e-3, unilateral=True)
    assert not flags[0] and flags[-1] and flags == sorted(flags)
