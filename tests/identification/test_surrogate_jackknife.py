"""Standard errors of the physical theta against its scatter over noise, the whole way from data to theta."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification import n4sid, surrogate
from identification.data_set import DataSet
from identification.excitation import operating_point_inputs, whole_range_inputs, with_measurement_noise
from identification.surrogate import Head, SurrogateSettings
from identification.surrogate.chain import OUTPUT_NAMES
from identification.surrogate.frequency_response import FrequencyResponseSettings, fit_frequency_response
from identification.surrogate.jackknife import physical_errors
from identification.surrogate.structure import STRUCTURES
from tolerances import JACKKNIFE

HEAD = Head(m_C=5.609, k_C=10384.8, c_C=32.0, k_E=1e5)
CHAIN = STRUCTURES["chain8"]
PLANT = np.array([8.0, 14.0, 25000.0, 25.0, 3.3, 0.1, 1200.0, 30.0])
INPUTS, UNITS = ("eta", "M_pa"), ("m", "m/s", "m", "m/s", "N", "N")
SIGMA = {"xi": 1e-5, "zeta": 1e-5, "xi_dot": 1e-3, "zeta_dot": 1e-3}
N4SID = n4sid.N4sidSettings(centres=(1.5,), subspace=n4sid.SubspaceSettings(order=6, block_rows=50))
SEEDS = 12


def answered(inputs: DataSet) -> DataSet:
    """What the plant answers, linear over the whole range, from rest."""
    dynamics = CHAIN.discretise(PLANT, HEAD, 1e-3, derivatives=False)
    u = inputs.matrix(INPUTS) - [0.0, 1310.9]
    x = np.linalg.solve(np.eye(6) - dynamics.A, dynamics.B @ u[0])
    rows = np.empty((len(u), 4))
    for k, row in enumerate(u):
        rows[k] = x[:4]
        x = dynamics.A @ x + dynamics.B @ row
    data = inputs.with_columns(OUTPUT_NAMES, UNITS[:4], rows)
    xi, xi_dot, zeta, zeta_dot = rows.T
    head = HEAD.k_C * (zeta - xi) + HEAD.c_C * (zeta_dot - xi_dot)
    forces = np.column_stack([head, HEAD.k_E * (xi - inputs.column("eta"))])
    return data.with_columns(("F_H", "F_p"), UNITS[4:], forces)


def test_standard_errors_of_the_physical_theta_are_its_scatter_over_noise() -> None:
    local = answered(operating_point_inputs(1.5, 1, (1,), duration=36.0))
    training = answered(whole_range_inputs(1, (2,), duration=6.0))
    told, found = [], []
    for seed in range(SEEDS):
        measured = with_measurement_noise(local, SIGMA, seed, (3,))
        wanted = seed < 4
        settings = SurrogateSettings(
            output_error={"enabled": False},  # type: ignore[arg-type]
            standard_errors=wanted,
            validity="hat",
        )
        models = n4sid.identify([measured], N4SID)
        result = surrogate.identify(models, [training], HEAD, settings, (), [measured] if wanted else ())
        found.append(result.physical[0])
        if wanted:
            told.append(result.standard_errors("physical")[0])
    scatter = np.std(found, axis=0, ddof=1)
    assert np.abs(np.log(np.median(told, axis=0) / scatter)).max() < JACKKNIFE
    assert (np.abs(np.array(found) - PLANT) / scatter).max() < 5.0


def test_at_a_bound_there_is_no_standard_error() -> None:
    """m_H of 8 kg that may not be below 9 kg: what every tenth agrees on is the bound, not m_H."""
    local = answered(operating_point_inputs(1.5, 1, (1,), duration=12.0))
    light = n4sid.identify([with_measurement_noise(local, SIGMA, 0, (3,))], N4SID)
    spectrum = np.ones((60, 2))
    settings = FrequencyResponseSettings(random_starts=2)
    bounded = tuple(replace(one, lower=9.0) if one.name == "m_H" else one for one in CHAIN.parameters)
    chain = replace(CHAIN, parameters=bounded)
    theta = fit_frequency_response(light.models[0], spectrum, chain, HEAD, settings)
    errors = physical_errors(light, [local], spectrum, chain, HEAD, settings)[0]
    assert list(theta.at_bound) == ["m_H"]
    assert np.isnan(errors[0]) and (errors[1:] > 0.0).all()
