"""What the report is made of, without a result: modes, spectra, envelopes, colours, numbers."""

from __future__ import annotations

import networks
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosimulation.report.bands import model_tables
from cosimulation.report.figures.drawing import envelope
from cosimulation.report.figures.spectra import amplitude_density
from cosimulation.report.modes import Mode, matched, modes
from cosimulation.report.tables import colour_of, number, significant
from cosimulation.scoring import marked_recommended
from fmu_builder.parameter_set import ResidualBands
from identification.scores import FIELDS
from tolerances import SPECTRUM_POWER

SAMPLE_TIME = 0.001


def pole(frequency: float, damping: float) -> complex:
    size = 2.0 * np.pi * frequency
    s = complex(-damping * size, size * np.sqrt(1.0 - damping**2))
    return complex(np.exp(s * SAMPLE_TIME))


def test_modes_are_found_and_matched() -> None:
    reference = modes(np.array([pole(3.2, 0.07), pole(12.0, 0.03), pole(23.0, 0.04)]), SAMPLE_TIME)
    assert [round(mode.frequency, 9) for mode in reference] == [3.2, 12.0, 23.0]
    assert [round(mode.damping, 9) for mode in reference] == [0.07, 0.03, 0.04]
    own = np.array([pole(21.0, 0.04), 0.98, pole(12.4, 0.1), 0.77], dtype=complex)
    found = [mode for mode in modes(own, SAMPLE_TIME) if mode.oscillates]
    assert matched(reference, found) == (None, found[0], found[1])
    assert len([mode for mode in modes(own, SAMPLE_TIME) if not mode.oscillates]) == 2
    assert matched(reference, []) == (None, None, None)
    crowd = [Mode(pole(f, 0.03), f, 0.03) for f in (11.0, 12.1, 22.0)]
    assert matched(reference, crowd) == (None, crowd[1], crowd[2])


def test_a_spectrum_keeps_the_power_of_a_sine() -> None:
    time = np.arange(60_000) * SAMPLE_TIME
    frequency, density = amplitude_density(0.7 + 3.0 * np.sin(2.0 * np.pi * 12.2 * time), SAMPLE_TIME)
    power = float(np.sum(density**2) * (frequency[1] - frequency[0]))
    assert abs(power / 4.5 - 1.0) < SPECTRUM_POWER
    assert abs(frequency[np.argmax(density)] - 12.2) <= frequency[1] - frequency[0]


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=300), st.integers(1, 50))
def test_an_envelope_loses_no_peak(values: list[float], columns: int) -> None:
    series = np.array(values)
    first, low, high = envelope(series, columns)
    assert len(first) == len(low) == len(high) <= columns
    assert low.min() == series.min() and high.max() == series.max()
    stretch = np.searchsorted(first, np.arange(len(series)), side="right") - 1
    assert np.all(low[stretch] <= series) and np.all(series <= high[stretch])


def test_colours_go_from_red_over_yellow_to_green() -> None:
    red, yellow, green = (tuple(bytes.fromhex(colour_of(fit)[1:])) for fit in (0.0, 50.0, 100.0))
    assert red[0] > red[1] and red[0] > red[2]
    assert min(yellow[:2]) > yellow[2]
    assert green[1] > green[0] and green[1] > green[2]
    assert colour_of(-40.0) == colour_of(0.0) and colour_of(-np.inf) == colour_of(0.0)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.001, "0.0010"), (315849.2, "315849"), (5.0, "5.000"), (0.0, "0"), (2.48e-5, "2.48e\N{MINUS SIGN}5")],
)
def test_numbers_read_well(value: float, text: str) -> None:
    assert significant(value) == text


def test_zero_has_no_sign() -> None:
    texts = [number(value, digits) for value, digits in ((-0.04, 1), (-0.4, 0), (-0.6, 0))]
    assert texts == ["0.0", "0", "\N{MINUS SIGN}1"]


def test_of_several_validation_records_the_mean_recommends() -> None:
    """One configuration is best on a single record, the other on average; test data have no say."""
    fits = {
        "hat": {"one": 99.0, "two": 80.0, "test": 99.9},
        "cubic": {"one": 95.0, "two": 94.0, "test": 10.0},
    }
    found = [
        {**dict.fromkeys(FIELDS), "signal": "F_p", "validity": validity, "data_set": name, "fit": fit,
         "split": "test" if name == "test" else "validation"}
        for validity, row in fits.items()
        for name, fit in row.items()
    ]  # fmt: skip
    marked = marked_recommended(found)
    assert {item["validity"] for item in marked if item["recommended"]} == {"cubic"}
    assert len([item for item in marked if item["recommended"]]) == 3


@pytest.mark.parametrize(
    ("first", "said"),
    [
        (None, "in the mean over a band. Only the heights 1 to 2.5 tell it."),
        (0.9, "in the mean over a band."),
    ],
)
def test_a_sentence_on_the_specified_frequency_holds_where_the_data_tell(
    first: float | None, said: str
) -> None:
    network = networks.network(1, "scheduled_equilibrium", "parameter", "hat")
    sizes = ((0.5, 0.25), (0.25, 4.0))
    bands = ResidualBands(
        model_hash=network.model_hash(), output=network.output_names[0], positions=(0.5, 1.0, 2.5),
        frequencies=(0.0, 15.0, 500.0), coverage=0.95, rms=sizes, bound=sizes, total=(0.75, 5.0),
        amplitude=((first, None), (0.5, 0.875)), phase=((first, None), (-0.0625, 0.0)),
        seconds=(40.0, 39.0), held_out=("first",),
    )  # fmt: skip
    (table,) = model_tables(network.replaced(residual_bands=(bands,)))
    assert table.summary.startswith("Up to 15 Hz the amplitude is 0.500 to") and table.summary.endswith(said)
