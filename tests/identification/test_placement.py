"""Centres where the local models differ most."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_plants import three_mass, three_mass_data

from fmu_builder.errors import IdentificationError
from identification.n4sid import N4sidSettings, identify
from identification.placement import placed, response_distances
from identification.validity import equidistant_centres

GRID = np.linspace(0.5, 2.5, 21)


def test_even_change_gives_equidistant_centres() -> None:
    for weight in (0.0, 0.4, 1.0):
        found = placed(GRID, np.full(20, 0.3), 4, (0.5, 2.5), weight)
        assert found == pytest.approx(equidistant_centres(4, 0.5, 2.5))


def test_equal_cells_of_a_known_arc_length() -> None:
    """Change proportional to x^2: s = x^3, so the centres are the cube roots of the middles."""
    grid = np.linspace(0.0, 1.0, 2001)
    found = placed(grid, np.diff(grid**3), 3, (0.0, 1.0), weight=1.0)
    assert found == pytest.approx(np.cbrt([1 / 6, 0.5, 5 / 6]), abs=1e-6)
    half = placed(grid, np.diff(grid**3), 3, (0.0, 1.0), weight=0.5)
    assert 0.5 * (half + half**3) == pytest.approx([1 / 6, 0.5, 5 / 6], abs=1e-6)


def test_a_coarse_pass_that_does_not_reach_the_ends_goes_on_there() -> None:
    found = placed(np.array([1.0, 2.0]), np.array([0.7]), 2, (0.0, 4.0), weight=1.0)
    assert found == pytest.approx([1.0, 3.0])
    found = placed(np.array([1.0, 2.0, 3.0]), np.array([0.0, 1.0]), 2, (0.5, 3.5), weight=1.0)
    assert (found >= 2.0).all() and (np.diff(found) > 0.0).all()


def test_distances_are_the_size_of_the_output_difference() -> None:
    soft, stiff = three_mass(0.8), three_mass(1.2)
    frequencies, inputs, outputs = (
        np.array([2.0, 11.0]),
        np.array([0.001, 40.0]),
        np.array([0.01, 1.0, 0.02, 2.0]),
    )
    found = response_distances([soft, stiff, stiff], frequencies, inputs, outputs)
    total = 0.0
    for f, m, p in np.ndindex(2, 2, 4):
        one, two = (model.frequency_response(frequencies[[f]])[0, p, m] for model in (soft, stiff))
        total += abs((one - two) * inputs[m] / outputs[p]) ** 2
    assert found == pytest.approx([np.sqrt(total / 16), 0.0])
    by_frequency = response_distances([soft, stiff], frequencies, np.tile(inputs, (2, 1)), outputs)
    assert by_frequency == pytest.approx(found[:1])
    other = soft.transformed(np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]))
    assert response_distances([soft, other], frequencies, inputs, outputs)[0] < 1e-9


def test_what_cannot_be_placed_is_refused() -> None:
    cases = [
        (GRID, np.ones(5), 4, 0.5),
        (GRID[::-1], np.ones(20), 4, 0.5),
        (GRID + 1.0, np.ones(20), 4, 0.5),
        (np.where(np.arange(21) == 5, np.nan, GRID), np.ones(20), 4, 0.5),
        (GRID, np.zeros(20), 4, 0.5),
        (GRID, np.full(20, np.nan), 4, 0.5),
        (GRID, np.ones(20), 0, 0.5),
        (GRID, np.ones(20), 4, 1.5),
    ]
    for positions, distances, count, weight in cases:
        with pytest.raises(IdentificationError, match="placement"):
            placed(positions, distances, count, (0.5, 2.5), weight)


def test_identification_at_placed_centres() -> None:
    centres = (0.8, 1.5, 2.3)
    data = [three_mass_data(3, centre, 3.0) for centre in centres]
    local = identify(data, N4sidSettings(centres=centres))
    assert local.centres.tolist() == list(centres) and len(local.models) == 3
    with pytest.raises(IdentificationError, match="ascend within the range"):
        identify(data, N4sidSettings(centres=(0.8, 2.3, 1.5)))
    off = replace(data[1], values=data[1].values + np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.0]))
    with pytest.raises(IdentificationError, match=r"nearest centre is 1\.5"):
        identify([data[0], off, data[2]], N4sidSettings(centres=centres))
