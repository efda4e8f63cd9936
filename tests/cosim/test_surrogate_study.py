"""The surrogate study in small: scores, theta beside the truth, modes, local optima, its page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosimulation.linearise import Linearisation
from cosimulation.settings import STUDIES, load_settings, parse_settings
from cosimulation.study import run_study
from cosimulation.study.job import STUDIES as KNOWN
from cosimulation.study.surrogate.physics import exact_theta, frequency_errors
from cosimulation.study.surrogate.theta_sections import agreement_tables
from fmu_builder.errors import SettingsError
from fmus.wbm import native, parameter_sets
from identification.linear import discretised
from identification.scores import FIELDS
from identification.surrogate import STRUCTURES, THESIS, Head
from tolerances import EXACT_CHAIN

SMALL = """
title = "Small"
sets = ["Blow"]
seeds = [3, 4]
duration = 8.0
whole_range_duration = 20.0
processes = 2

[local_optima]
data_seeds = 2
starts = 3

[[tables]]
name = "routes"
title = "Routes & more"
text = "Side by side."
reasons = true

[[configurations]]
name = "eight"
table = "routes"
surrogate = { structure = "chain8", output_error = { iterations = 3 } }
noises = ["none", "1e-5 m, 1e-3 m/s"]
thetas = ["physical", "tuned", "recommended"]
detailed = true

[[configurations]]
name = "thesis"
table = "routes"
noises = ["none"]

[configurations.surrogate]
structure = "chain7"
blending = "matrices"
validity = "gaussian"
offsets = "affine"
output_error = { iterations = 2 }

[[configurations]]
name = "exact"
table = "routes"
models = "linearisation"
surrogate = { structure = "chain9", output_error = { enabled = false } }

[[configurations]]
name = "black box"
table = "routes"
network = { validity = "cubic" }

[[limits]]
label = "reachable"
where = { wbm = "Blow", route = "eight, recommended", noise = "1e-5 m, 1e-3 m/s", signal = "F_p" }
yardstick = { wbm = "Blow", route = "exact", signal = "F_p" }
median = 90.0

[[limits]]
label = "frequencies"
measure = "error of frequency"
where = { wbm = "Blow", route = "eight", which = "recommended", noise = "1e-5 m, 1e-3 m/s" }
worst = 2.0

[[limits]]
label = "searches that miss"
measure = "global optimum missed"
where = {}
total = 0

[[limits]]
label = "theta out of reach"
measure = "error of theta"
where = { wbm = "Blow", route = "eight", which = "physical", noise = "none", parameter = "m_M" }
median = 0.0
"""


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("surrogate")
    (folder / "small.toml").write_text(SMALL, encoding="utf-8")
    result = run_study("surrogate", folder / "out", folder / "small.toml")
    assert [verdict.passed for verdict in result.verdicts] == [True, True, True, False]
    return folder / "out"


def read(folder: Path, name: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads((folder / name).read_text(encoding="utf-8"))
    return found


def test_scores_are_of_the_theta_they_name(small: Path) -> None:
    scores = read(small, "scores.json")
    assert all(tuple(item) == FIELDS for item in scores)
    fits = {
        (item["route"], item["seed"], item["noise"]): item["fit"]
        for item in scores
        if item["signal"] == "F_p" and item["split"] == "test"
    }
    reasons = [item for item in read(small, "findings.json") if item.get("reason") == "eight"]
    assert len(reasons) == 4
    for item in reasons:
        key = (item["seed"], item["noise"])
        assert fits["eight, recommended", *key] == fits[f"eight, {item['recommended']}", *key]
        assert fits["eight, physical", *key] != fits["eight, tuned", *key]
    models = {item["route"]: item["model"] for item in scores}
    assert models["exact"] == "linearisation" and models["black box"] == "n4sid"
    assert {item["recommended"] for item in scores if item["model"] == "linearisation"} == {False}


def test_theta_stands_beside_the_truth_with_its_standard_error(small: Path) -> None:
    thetas = [item for item in read(small, "findings.json") if "theta" in item]
    assert len(thetas) == 2 * 2 * 2 * 4 * 8  # thetas, seeds, noises, local models, parameters
    for item in thetas:
        assert (item["error"] is not None) == (item["noise"] != "none") or item["bound"]
    close = [item for item in thetas if item["theta"] == "physical" and item["parameter"] == "m_H"]
    assert all(item["value"] == pytest.approx(item["exact"], rel=0.02) for item in close)
    assert {item["found"] for item in close} == {"frequency response from the closed form"}


def test_every_search_is_compared_with_random_starts(small: Path) -> None:
    runs = [item for item in read(small, "findings.json") if "optima" in item]
    assert len(runs) == 2 * 4 and all(len(item["random"]) == 3 for item in runs)
    assert all(item["error"] <= min(item["random"]) * 1.001 for item in runs)


def test_the_page_shows_everything(small: Path) -> None:
    page = (small / "report.html").read_text(encoding="utf-8")
    for word in (
        "Routes &amp; more",
        "eight, recommended, 4 LLM",
        '<tr class="yardstick"><th>exact, 4 LLM',
        "parameters at a bound",
        "thesis, Table 4.3",
        "exact, linearised white-box model",
        "in brackets the scatter",
        "OP25",
        "mode L",
        "delta_M_dot",
        "at the global optimum",
        "0 of 8",
        ">pass<",
        ">FAIL<",
    ):
        assert word in page, word
    assert page.count("<svg") == 4  # theta, poles, spectra, local optima
    assert "<script" not in page and "http://" not in page.replace("http://www.w3.org", "")


def test_the_thesis_route_of_the_study_is_that_of_the_code() -> None:
    settings: Any = load_settings(KNOWN["surrogate"].settings, STUDIES / "surrogate.toml")
    routes = {one.name: one.surrogate for one in settings.configurations}
    assert routes["chain7, thesis's route"] == THESIS
    assert routes["chain7, thesis's route on all rows"] == THESIS.model_copy(update={"training_rows": None})


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"table": "none such"}, "no table none such"),
        ({"network": {}}, "either surrogate or network"),
        ({"surrogate": None}, "either surrogate or network"),
        ({"models": "linearisation", "detailed": True}, "only identified surrogates"),
        ({"llms": [4, 4]}, "the same model twice: one, A, 4"),
    ],
)
def test_settings_that_contradict_themselves_are_refused(changes: dict[str, Any], said: str) -> None:
    one = {"name": "one", "table": "t", "surrogate": {}, **changes}
    whole = {"title": "x", "tables": [{"name": "t", "title": "T", "text": ""}], "configurations": [one]}
    with pytest.raises(SettingsError, match=said):
        parse_settings(KNOWN["surrogate"].settings, whole, "test")


def linearisation(name: str, height: float) -> Linearisation:
    """The white-box model's own linearisation, states in another order than the chain's."""
    point = np.array([height, 1310.9])
    found = native.linearise(parameter_sets()[name], point)
    outputs = native.OUTPUTS[:4]
    rest = native.simulate(parameter_sets()[name], point[None])[0, :4]
    return Linearisation(
        *(found.A, found.B, found.C[:4], found.D[:4], native.STATES, native.INPUTS, outputs, point, rest)
    )


def test_the_exact_theta_has_the_poles_of_the_linearisation() -> None:
    chosen = parameter_sets()["A"]
    head = Head(m_C=chosen["mC"], k_C=chosen["k_C"], c_C=chosen["c_C"], k_E=chosen["k_E"])
    found = linearisation("A", 1.75)
    chain = STRUCTURES["chain9"]
    A, _ = chain.continuous(chain.from_coefficients(exact_theta(found, head), head), head)
    own, wanted = np.linalg.eigvals(A), np.linalg.eigvals(found.A)
    assert max(np.abs(own - pole).min() / np.abs(pole) for pole in wanted) < EXACT_CHAIN


def test_frequencies_are_compared_mode_by_mode() -> None:
    found = linearisation("Blow", 0.75)
    model = discretised(
        (found.A, found.B, found.C, found.D), 1e-3, found.inputs, found.outputs,
        found.input_operating_point, found.output_operating_point,
    )  # fmt: skip
    records = frequency_errors([model], [found], {"seed": 1})
    assert [item["mode"] for item in records] == ["L", "M", "H"]
    assert {item["point"] for item in records} == {"OP25"}
    assert max(item["value"] for item in records) < 1e-6
    other = frequency_errors([model], [linearisation("Blow", 1.25)], {"seed": 1})
    assert max(item["value"] for item in other) > 1.0


def test_standard_errors_stand_over_the_scatter() -> None:
    values = {0.75: (1.0, 2.0, 3.0, 6.0), 2.25: (4.0, 4.0, 8.0, 8.0)}
    errors = {0.75: (1.0, 2.0, 4.0, 3.0), 2.25: (0.5, None, 1.5, 1.0)}
    items = [
        {"theta": "tuned", "parameter": "m_H", "height": height, "value": value, "error": error}
        for height in values
        for value, error in zip(values[height], errors[height], strict=True)
    ]
    items += [one | {"theta": "physical", "error": None} for one in items]
    (table,) = agreement_tables("A", "1e-5 m, 1e-3 m/s", items)
    (row,) = table.rows
    low, high = 1.0 / np.std(values[2.25], ddof=1), 2.5 / np.std(values[0.75], ddof=1)
    assert row.head == "tuned theta" and table.columns == ["m_H"]
    assert float(row.cells[0].value) == pytest.approx(0.5 * (low + high))
    assert row.cells[0].small == f"{low:.2f} .. {high:.2f}"
    assert agreement_tables("A", "none", [one for one in items if one["value"] in (1.0, 2.0)]) == []
