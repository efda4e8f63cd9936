"""Theta from the frequency response of a black-box model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmu_builder.errors import IdentificationError
from fmus.wbm import native, parameter_sets
from identification.local_model import LocalModel
from identification.surrogate import frequency_response
from identification.surrogate.chain import INPUT_NAMES, OUTPUT_MATRIX, OUTPUT_NAMES, Head
from identification.surrogate.exact import exact_chain9, lower_framework
from identification.surrogate.frequency_response import (
    FrequencyResponseFit,
    FrequencyResponseSettings,
    fit_frequency_response,
    input_spectrum,
    local_response,
    response_weights,
)
from identification.surrogate.structure import STRUCTURES
from tolerances import SURROGATE_RECOVERY

HEAD = Head(m_C=5.609, k_C=10384.8, c_C=32.0, k_E=1e5)
PLANT = np.array([8.0, 14.0, 25343.9, 25.0, 0.3, 1200.0, 30.0])
SETTINGS = FrequencyResponseSettings(random_starts=2)
TS = 1e-3


BASIS = np.random.default_rng(5).normal(size=(6, 6))
ROTATION = np.linalg.qr(BASIS)[0] / np.tile(
    [1.0, 128.0], 3
)  # of states of one size: rounds a million times less


def black_box(
    theta: np.ndarray, head: Head = HEAD, name: str = "chain7", basis: np.ndarray = BASIS
) -> LocalModel:
    """The chain as a model in some other basis, with signals in another order than ours."""
    dynamics = STRUCTURES[name].discretise(theta, head, TS)
    swapped = [2, 0, 3, 1]
    model = LocalModel(
        *(dynamics.A, dynamics.B[:, ::-1], OUTPUT_MATRIX[swapped], np.zeros((4, 2)), TS),
        inputs=INPUT_NAMES[::-1],
        outputs=tuple(OUTPUT_NAMES[index] for index in swapped),
        input_operating_point=np.array([1310.9, 1.5]),
        output_operating_point=np.zeros(4),
    )
    return model.transformed(basis)


def spectrum(frequencies: np.ndarray) -> np.ndarray:
    """First-order noise for the height, holds of about 0.1 s for the torque."""
    height = 1e-8 / (1.0 + (frequencies / 10.0) ** 2)
    torque = 200.0 * np.sinc(0.1 * frequencies) ** 2 + 1.0
    return np.stack([height, torque], axis=-1)


def fit(model: LocalModel, name: str = "chain7", head: Head = HEAD, **changes) -> FrequencyResponseFit:
    settings = SETTINGS.model_copy(update=changes)
    return fit_frequency_response(model, spectrum(settings.frequencies()), STRUCTURES[name], head, settings)


def test_a_known_plant_is_recovered_in_any_basis() -> None:
    found = fit(black_box(PLANT))
    np.testing.assert_allclose(found.theta, PLANT, rtol=SURROGATE_RECOVERY)
    assert found.relative_error < 1e-8  # what a random basis costs in rounding
    assert not found.at_bound
    assert found.start == "closed form" and not found.fallback
    assert found.starts == found.agreed == len(found.costs) == 1


def random_plant(seed: int) -> np.ndarray:
    """A chain8 on the scale of Table 4.3: masses and stiffnesses log-uniform within a factor of three.

    Each damper of the lower framework has a damping ratio of 0.02 to 0.2 with the stiffness and the mass
    beside it.
    """
    generator = np.random.default_rng(seed)
    m_H, m_M, k_L, k_W = np.array([15.5, 35.0, 210.0, 8000.0]) * 3.0 ** generator.uniform(-1.0, 1.0, 4)
    m_H, m_M = min(m_H, 49.0), min(m_M, 49.0)
    upper, lower = generator.uniform(0.02, 0.2, 2)
    c_L, c_W = 2.0 * upper * np.sqrt(k_L * m_H), 2.0 * lower * np.sqrt(k_W * m_M)
    return np.array([m_H, m_M, k_L, c_L, generator.uniform(1.0, 5.0), generator.uniform(-0.5, 0.5), k_W, c_W])


@pytest.mark.parametrize("seed", range(20))
def test_random_plants_are_recovered(seed: int) -> None:
    theta = random_plant(seed)
    found = fit(black_box(theta, name="chain8", basis=ROTATION), "chain8")
    assert found.start == "closed form" and not found.fallback
    scale = np.abs(theta)
    scale[5] = theta[4]  # b_H may be drawn near zero; it stands beside b_M
    assert np.max(np.abs(found.theta - theta) / scale) < SURROGATE_RECOVERY


def test_the_head_is_recovered_when_it_is_free() -> None:
    theta = np.array([*PLANT, 6.5, 9000.0, 45.0])
    model = black_box(theta, name="chain10")
    found = fit(model, "chain10")
    np.testing.assert_allclose(found.theta, theta, rtol=SURROGATE_RECOVERY)
    assert fit(model).relative_error > 1e-2  # the wrong head cannot be made up for by the rest


@pytest.mark.parametrize(("name", "factor", "side"), [("m_H", 0.4, "lower"), ("r_M", 4.0, "upper")])
def test_a_plant_outside_the_bounds_ends_at_them_and_is_flagged(name: str, factor: float, side: str) -> None:
    structure = STRUCTURES["chain7"]
    outside = np.where(np.array(structure.names) == name, factor, 1.0) * PLANT  # m_H 3.2 kg or r_M 1.2 m
    found = fit(black_box(outside))
    lower, upper = np.array([(one.lower, one.upper) for one in structure.parameters]).T
    assert np.all((found.theta >= lower) & (found.theta <= upper))
    assert found.at_bound[name] == side
    assert found.theta[structure.names.index(name)] == getattr(
        structure.parameters[structure.names.index(name)], side
    )
    assert found.relative_error > 1e-3


def test_the_same_seed_gives_the_same_bits_and_another_seed_other_starts() -> None:
    first, again, other = (
        fit(black_box(PLANT), seed=seed, iterations=5, start="random") for seed in (0, 0, 1)
    )
    assert first.costs == again.costs and first.costs != other.costs
    assert list(first.costs) == ["random 1", "random 2"]
    assert first.start == "random" and "not asked for" in first.fallback


def test_more_starts_can_be_given() -> None:
    settings = SETTINGS.model_copy(update={"iterations": 4, "random_starts": 0, "start": "random"})
    found = fit_frequency_response(
        *(black_box(PLANT), spectrum(settings.frequencies()), STRUCTURES["chain7"], HEAD),
        settings,
        {"neighbour": PLANT * 1.01},
    )
    assert found.best_start == found.start == "neighbour" and found.starts == 1


def test_random_starts_are_only_drawn_where_the_closed_form_fails() -> None:
    outside = PLANT * np.array([0.4, 1, 1, 1, 1, 1, 1])  # m_H 3.2 kg, below its bound
    found = fit(black_box(outside))
    assert "bound of m_H" in found.fallback or "relative error" in found.fallback
    forms = [f"closed form {index}" for index in range(2, len(found.costs) - 1)]
    assert list(found.costs) == ["closed form", *forms, "random 1", "random 2"] and forms
    noise = np.random.default_rng(2).normal(size=(6, 6)) * 0.3
    strange = replace(
        black_box(PLANT), A=-0.5 * np.eye(6) + 0.01 * noise
    )  # no continuous-time model behind it
    assert "no chain" in fit(strange).fallback
    assert fit(strange).start == "random"


def of_the_white_box_model(name: str, height: float) -> tuple[Head, np.ndarray]:
    """Head and chain8 of a linearised white-box set, its weak damper to ground left out."""
    chosen = parameter_sets()[name]
    states = ("phi_1", "delta", "xi", "phi_1_dot", "delta_dot", "xi_dot")
    order = [native.STATES.index(state) for state in states]
    model = native.linearise(chosen, [height, 1310.9])
    point = model.C[native.OUTPUTS.index("zeta"), order][:2]
    head = Head(m_C=chosen["mC"], k_C=chosen["k_C"], c_C=chosen["c_C"], k_E=chosen["k_E"])
    framework = lower_framework(model.A[np.ix_(order, order)], model.B[order, 1], point, head.k_C, head.c_C)
    return head, STRUCTURES["chain8"].from_coefficients(exact_chain9(*framework), head)


@pytest.mark.parametrize("height", [0.75, 1.25, 1.75, 2.25])
@pytest.mark.parametrize("name", ["A", "Blow"])
def test_the_fallback_alone_finds_the_global_optimum(name: str, height: float) -> None:
    """A state that alternates, seen by no output: the same response, but nothing continuous behind it."""
    head, theta = of_the_white_box_model(name, height)
    model = black_box(theta, head, "chain8", ROTATION)
    more = np.zeros((7, 7))
    more[:6, :6], more[6, 6] = model.A, -0.5
    blind = replace(
        model, A=more, B=np.vstack([model.B, [0.1, 0.1]]), C=np.hstack([model.C, np.zeros((4, 1))])
    )
    found = fit(blind, "chain8", head, random_starts=10)
    assert "finds no chain" in found.fallback and found.start == "random"
    assert found.starts == 10 and "closed form" not in found.costs
    np.testing.assert_allclose(found.theta, theta, rtol=SURROGATE_RECOVERY, atol=1e-5)
    assert found.fallback in found.account and f"{found.agreed} of 10 starts agree" in found.account


@pytest.mark.parametrize("seed", range(2))
def test_the_fallback_finds_the_best_chain_of_a_bad_local_model(seed: int) -> None:
    """Of a model that is no chain the optimum is not known: many other starts find none better."""
    head, theta = of_the_white_box_model("A", 1.25)
    noise = np.random.default_rng((11, seed)).normal(size=(4, 6))
    model = black_box(theta, head, "chain8", ROTATION)
    bad = replace(model, C=model.C * (1.0 + 0.1 * noise))
    found = fit(bad, "chain8", head, random_starts=10)
    assert found.fallback and found.starts >= 10
    others = fit(bad, "chain8", head, random_starts=20, start="random", seed=5)
    assert found.relative_error <= others.relative_error * (1.0 + SETTINGS.agreement)


def test_a_stable_chain_goes_before_an_unstable_one() -> None:
    structure = STRUCTURES["chain8"]
    falling = np.array([8.0, 14.0, 2500.0, 2.0, 3.3, 0.2, 1200.0, -40.0])
    assert np.linalg.eigvals(structure.continuous(falling, HEAD)[0]).real.max() > 0.0
    resting = falling * [1, 1, 1, 1, 1, 1, 1, -1]
    settings = SETTINGS.model_copy(update={"iterations": 1, "random_starts": 0})
    found = fit_frequency_response(
        *(black_box(falling, name="chain8"), spectrum(settings.frequencies()), structure, HEAD),
        settings,
        {"resting": resting},
    )
    assert "unstable" in found.fallback and found.best_start == "resting"
    assert found.costs["resting"] > found.costs["closed form"]
    assert np.linalg.eigvals(structure.continuous(found.theta, HEAD)[0]).real.max() < 0.0


def test_gradient_and_gauss_newton_matrix_against_differences() -> None:
    frequencies = SETTINGS.frequencies()
    response = local_response(black_box(PLANT), frequencies)
    weights = response_weights(response, spectrum(frequencies), frequencies)
    structure = STRUCTURES["chain7"]
    problem = frequency_response._ResponseProblem(response, weights, structure, HEAD, TS, frequencies)
    search = structure.to_search(PLANT * np.array([1.1, 0.9, 1.2, 0.7, 1.05, 2.0, 0.8]))

    def modelled(x: np.ndarray) -> np.ndarray:
        theta = structure.from_search(x)
        dynamics = structure.discretise(theta, HEAD, TS)
        z = np.exp(2j * np.pi * frequencies * TS)[:, None, None]
        return weights * (np.linalg.inv(z * np.eye(6) - dynamics.A) @ dynamics.B)[:, :4]

    step = 1e-5
    jacobian = np.stack(
        [(modelled(search + step * e) - modelled(search - step * e)).ravel() / (2 * step) for e in np.eye(7)],
        axis=-1,
    )
    residual = (weights * response - modelled(search)).ravel()
    normal = problem.normal_equations(search)
    assert normal.cost == pytest.approx(np.sum(np.abs(residual) ** 2), rel=1e-9)
    assert problem.cost(search) == pytest.approx(normal.cost, rel=1e-12)
    np.testing.assert_allclose(normal.gradient, (jacobian.conj().T @ residual).real, rtol=1e-5)
    gram = (jacobian.conj().T @ jacobian).real
    np.testing.assert_allclose(normal.gram, gram, rtol=0, atol=1e-8 * gram.max())


def test_weights_are_what_an_error_does_to_the_output() -> None:
    frequencies = SETTINGS.frequencies()
    response = local_response(black_box(PLANT), frequencies)
    power = spectrum(frequencies)
    weights = response_weights(response, power, frequencies)
    # All of the response taken as error is all of each output.
    np.testing.assert_allclose(np.sum(np.abs(weights * response) ** 2, axis=(0, 2)), 1.0, rtol=1e-12)
    ratio = weights[40, 2, 1] / weights[40, 2, 0]
    assert ratio == pytest.approx(np.sqrt(power[40, 1] / power[40, 0]), rel=1e-12)


def test_the_spectrum_of_known_noise_is_found_under_a_slow_journey() -> None:
    generator = np.random.default_rng(3)
    noise = generator.normal(scale=[2e-3, 30.0], size=(60_000, 2))
    noise[:, 0] += 0.6 + 0.03 * np.arange(60_000) * TS
    frequencies = np.geomspace(0.5, 40.0, 20)
    found = input_spectrum(noise, TS, frequencies)
    expected = 2.0 * TS * np.array([2e-3, 30.0]) ** 2  # one-sided density of white noise
    np.testing.assert_allclose(np.median(found, axis=0), expected, rtol=0.15)


def test_a_model_without_the_signals_is_refused() -> None:
    model = black_box(PLANT)
    other = LocalModel(
        *(model.A, model.B, model.C, model.D, TS),
        inputs=("M_pa", "height"),
        outputs=("zeta", "xi", "zeta_dot", "speed"),
        input_operating_point=np.zeros(2),
        output_operating_point=np.zeros(4),
    )
    with pytest.raises(IdentificationError, match="xi_dot, eta"):
        local_response(other, SETTINGS.frequencies())


def test_a_response_without_sense_is_refused() -> None:
    settings = SETTINGS.model_copy(update={"random_starts": 0})
    silent = replace(black_box(PLANT), C=np.zeros((4, 6)))
    with np.errstate(all="ignore"), pytest.raises(IdentificationError, match="no start"):
        fit_frequency_response(silent, spectrum(settings.frequencies()), STRUCTURES["chain7"], HEAD, settings)
