"""Ways to common state coordinates, compared."""

from __future__ import annotations

import numpy as np
import pytest
from linear_plants import asymmetric, three_mass

from fmu_builder.errors import IdentificationError
from identification.arrays import Array
from identification.excitation import random_stream
from identification.local_model import LocalModel
from identification.subspace.alignment import Alignment, in_common_coordinates, modal_aligned
from tolerances import ALIGNMENT

SCALE = np.array([0.0024, 0.05, 0.002, 0.05])
FREQUENCIES = np.array([1.0, 3.3, 12.0, 22.0])


def family(transforms: list[Array]) -> list[LocalModel]:
    plants = [three_mass(scale) for scale in (0.7, 1.0, 1.3)]
    return [plant.transformed(T) for plant, T in zip(plants, transforms, strict=True)]


def random_bases(seed: int) -> list[Array]:
    random = random_stream(seed)
    return [np.linalg.qr(random.standard_normal((6, 6)))[0] for _ in range(3)]


def response_of_the_blend(models: list[LocalModel], shares: list[float]) -> Array:
    blend = [np.tensordot(shares, [getattr(model, name) for model in models], 1) for name in "ABCD"]
    rest = np.zeros(2), np.zeros(4)
    return np.abs(
        LocalModel(*blend, 0.001, models[0].inputs, models[0].outputs, *rest).frequency_response(FREQUENCIES)
    )


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("method", ["observability", "modal"])
def test_an_alignment_undoes_the_coordinates_the_models_came_in(method: Alignment, seed: int) -> None:
    shares = [0.3, 0.5, 0.2]
    expected = response_of_the_blend(in_common_coordinates(family([np.eye(6)] * 3), method, SCALE), shares)
    found = in_common_coordinates(family(random_bases(seed)), method, SCALE)
    assert np.abs(response_of_the_blend(found, shares) / expected - 1.0).max() < 1e4 * ALIGNMENT
    raw = in_common_coordinates(family(random_bases(seed)), "none", SCALE)
    assert np.abs(response_of_the_blend(raw, shares) / expected - 1.0).max() > 0.1


@pytest.mark.parametrize("method", ["observability", "modal", "none"])
def test_an_alignment_changes_coordinates_only(method: Alignment) -> None:
    models = family(random_bases(5))
    for model, same in zip(models, in_common_coordinates(models, method, SCALE), strict=True):
        expected = model.frequency_response(FREQUENCIES)
        assert np.abs(same.frequency_response(FREQUENCIES) - expected).max() < 1e-9 * np.abs(expected).max()
        np.testing.assert_array_equal(same.input_operating_point, model.input_operating_point)
    assert in_common_coordinates(models, "none", SCALE) == models


def test_modal_form_holds_the_modes_in_order_of_frequency() -> None:
    for model in modal_aligned(family(random_bases(6)), SCALE):
        blocks = model.A.reshape(3, 2, 3, 2).transpose(0, 2, 1, 3)
        expected = np.sort(np.abs(np.angle(model.poles)))[::2]
        found = []
        for i, k in np.ndindex(3, 3):
            if i != k:
                assert np.abs(blocks[i, k]).max() < 1e-9
            else:
                (a, b), (c, d) = blocks[i, i]
                assert a == pytest.approx(d, abs=1e-9) and b == pytest.approx(-c, abs=1e-9)
                found.append(abs(np.arctan2(b, a)))
        assert found == pytest.approx(expected.tolist(), abs=1e-9)


def test_modal_form_of_equal_models_with_other_signs_and_scales_is_equal() -> None:
    """The same plant in three bases becomes the same matrices: phase, sign and scale are matched."""
    models = [three_mass().transformed(T) for T in random_bases(8)]
    first, *rest = modal_aligned(models, SCALE, reference=0)
    for other in rest:
        for name in "ABC":
            size = np.abs(getattr(first, name)).max()
            assert np.abs(getattr(other, name) - getattr(first, name)).max() < 1e-7 * size
    plant = asymmetric()  # with a real pole
    T = random_stream(1).standard_normal((5, 5))
    one, two = modal_aligned([plant, plant.transformed(T)], np.ones(2), reference=0)
    assert np.abs(one.C - two.C).max() < 1e-9 * np.abs(one.C).max()


def test_modes_that_do_not_correspond_are_refused() -> None:
    plant = three_mass()
    overdamped = LocalModel(
        np.diag([0.9, 0.8, 0.7, 0.95, 0.85, 0.75]), plant.B, plant.C, plant.D, 0.001, plant.inputs,
        plant.outputs, plant.input_operating_point, plant.output_operating_point,
    )  # fmt: skip
    with pytest.raises(IdentificationError, match="complex pairs"):
        modal_aligned([plant, overdamped, plant], SCALE, reference=0)
    with pytest.raises(IdentificationError, match="5 states"):
        modal_aligned([plant, asymmetric()], SCALE, reference=0)
