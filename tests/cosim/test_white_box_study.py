"""The white-box study: its figures against the native model, the reference tables and analytic paths."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reference import resonances as reference

from cosimulation.fmu_file import OpenFmu, open_fmu
from cosimulation.pantograph import TORQUE
from cosimulation.settings import STUDIES, load_settings
from cosimulation.study import run_study
from cosimulation.study.runner import StudyResult
from cosimulation.study.white_box.poles import linearised_over, mode_paths, step_ratio
from cosimulation.study.white_box.resonances import resonance_records, step_resonances
from cosimulation.study.white_box.settings import BANDS, StaticSettings, StepSettings, WhiteBoxSettings
from cosimulation.study.white_box.static import gain, lift, static_map
from cosimulation.study.white_box.table_2_1 import STATISTICS
from fmus.wbm import native, parameter_sets
from tolerances import RESONANCE_DIGITS, STATIC_FORCE, SURFACE, WBM_STATIC_GAIN

RANGE = (0.5, 2.5)
QUICK = """
title = "Small"
sets = ["Blow"]
seeds = [3, 4]
linearisations = 21
processes = {processes}
steps = {{ count = 3, samples = 4096 }}
static = {{ heights = 5, torques = 3 }}

[height]
count = 2
durations = [3.0, 8.0]
noises = ["none", "1e-5 m, 1e-3 m/s"]

[[height.routes]]
name = "both"
subspace = {{ order = 6, block_rows = 30 }}

[[height.routes]]
name = "torque"
inputs = ["M_pa"]
subspace = {{ order = 7, block_rows = 40, stabilisation = "reflect" }}

[[limits]]
label = "within reach"
measure = "height error"
where = {{ wbm = "Blow", route = "both", noise = "none", duration = 8.0, modes = "L, M, H" }}
worst = 0.01

[[limits]]
label = "out of reach"
measure = "away from Table 2.1"
where = {{ wbm = "Blow", band = "f_H" }}
worst = 0.001
"""


@pytest.fixture(scope="module")
def fmu(white_box: Path) -> Any:
    with open_fmu(white_box) as opened:
        yield opened


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> tuple[StudyResult, StudyResult]:
    folder = tmp_path_factory.mktemp("white box")
    found = []
    for processes in (1, 2):
        settings = folder / f"{processes}.toml"
        settings.write_text(QUICK.format(processes=processes))
        found.append(run_study("white_box", folder / f"run {processes}", settings))
    return found[0], found[1]


@pytest.mark.parametrize("name", ["A", "Blow"])
def test_the_fmu_has_the_resonances_of_the_reference_tables(fmu: OpenFmu, name: str) -> None:
    found = step_resonances(fmu, name, StepSettings())
    assert np.allclose(found.heights, reference.HEIGHTS)
    assert BANDS == reference.BANDS
    cells = {
        (one["band"], one["signal"], one["statistic"]): one["value"]
        for one in resonance_records(found, {})
        if one["measure"] == "resonance"
    }
    for (band, signal), expected in reference.EXPECTED[name].items():
        computed = [cells[band, signal, statistic] for statistic in STATISTICS[:4]]
        assert np.abs(np.subtract(computed, expected)).max() < RESONANCE_DIGITS, (band, signal)
    bins = found.frequencies / (1.0 / 16.384)
    assert np.allclose(bins, np.arange(bins.size)) and found.frequencies[-1] <= 30.0
    rest = native.equilibrium(parameter_sets()[name], (0.7, TORQUE))
    stepped = native.simulate(parameter_sets()[name], np.tile((0.8, TORQUE), (16384, 1)), state=rest)
    for signal, surface in found.surfaces.items():
        exact = np.abs(np.fft.rfft(stepped[:, native.OUTPUTS.index(signal)]))[: bins.size]
        assert np.abs(surface[2] - exact / exact[1:].max()).max() < SURFACE


def test_away_from_the_thesis_is_the_difference_to_the_published_table(fmu: OpenFmu) -> None:
    records = list(resonance_records(step_resonances(fmu, "A", StepSettings()), {"wbm": "A"}))
    away = {
        (one["band"], one["signal"], one["statistic"]): one["value"]
        for one in records
        if one["measure"] == "away from Table 2.1"
    }
    # the prototype's lowest f_H of F_H, 20.630, and the thesis's, 19.592
    assert away["f_H", "F_H", "min"] == pytest.approx(20.630 - 19.592, abs=RESONANCE_DIGITS)
    assert max(away.values()) == away["f_H", "F_H", "min"]
    assert ("f_H", "F_p", "min") not in away and ("f_L", "xi_dot", "mode") not in away
    extra = {(o["band"], o["signal"]): o["value"] for o in records if o["measure"].startswith("peaks")}
    assert extra["f_H", "F_p"] == 20 and extra["f_L", "zeta"] == 0


@pytest.mark.parametrize("name", ["A", "Blow"])
def test_the_static_map_is_that_of_the_native_model(fmu: OpenFmu, name: str) -> None:
    settings = StaticSettings(heights=5, torques=7, torque_span=120.0)
    found = static_map(fmu, name, settings, RANGE)
    k_E, xi = parameter_sets()[name]["k_E"], native.STATES.index("xi")

    def force(height: float, torque: float) -> float:
        return float(k_E * (native.equilibrium(parameter_sets()[name], (height, torque))[xi] - height))

    expected = np.array([[force(h, m) for m in found.torques] for h in found.heights])
    assert np.abs(found.force - expected).max() < 1e-3 * STATIC_FORCE
    assert found.torques[3] == TORQUE and np.array_equal(found.at_operating_point, found.force[:, 3])
    for height, torque in zip(found.heights, found.critical, strict=True):
        assert abs(force(height, torque)) < 1e-3 * STATIC_FORCE
    chord = expected[:, :1] + np.outer(expected[:, -1] - expected[:, 0], np.linspace(0.0, 1.0, 7))
    assert np.allclose(found.from_line, np.abs(expected - chord).max(axis=1), atol=1e-3 * STATIC_FORCE)


def test_a_grid_without_the_operating_point_is_refused() -> None:
    with pytest.raises(ValueError, match="none is the operating point"):
        StaticSettings(torques=4)


def test_slope_and_lever_are_those_of_the_equations(fmu: OpenFmu) -> None:
    (point,) = linearised_over(fmu, "A", np.array([2.0]))
    model = native.linearise(parameter_sets()["A"], (2.0, TORQUE))
    z1 = model.C[native.OUTPUTS.index("zeta"), native.STATES.index("phi_1")]
    assert lift(point) == pytest.approx(z1, rel=WBM_STATIC_GAIN)
    k_E, xi = parameter_sets()["A"]["k_E"], native.STATES.index("xi")
    moved = [native.equilibrium(parameter_sets()["A"], (2.0, TORQUE + d))[xi] for d in (-0.5, 0.5)]
    assert gain(point, "F_p", "M_pa") == pytest.approx(k_E * (moved[1] - moved[0]), rel=1e-4)


def test_modes_over_the_height_are_those_of_the_native_linearisations(fmu: OpenFmu) -> None:
    heights = np.linspace(*RANGE, 9)
    found = mode_paths(linearised_over(fmu, "Blow", heights))
    for row, height in enumerate(heights):
        poles = np.linalg.eigvals(native.linearise(parameter_sets()["Blow"], (height, TORQUE)).A)
        upper = np.array(sorted(poles[poles.imag > 0.0], key=abs))
        assert np.allclose(found.poles[row], np.exp(1e-3 * upper), atol=1e-9)
        assert np.allclose(found.table.frequencies[row], np.abs(upper) / (2.0 * np.pi), atol=1e-7)
        assert np.allclose(found.table.dampings[row], -upper.real / np.abs(upper), atol=1e-7)
    assert found.names == ("L", "M", "H")


def test_a_jump_shows_in_the_ratio_of_steps() -> None:
    height = np.linspace(0.0, 1.0, 41)
    smooth = np.exp(1j * height**2)
    assert step_ratio(smooth) == pytest.approx(0.5, abs=0.02)
    assert step_ratio(smooth + (height > 0.6)) > 0.95


def test_sets_without_a_peak_or_a_network_have_a_page_too(tmp_path: Path) -> None:
    """Set B shows no f_M in xi_dot, F_H and F_p, and no network that ships was identified from it."""
    settings = tmp_path / "b.toml"
    text = QUICK.format(processes=1).split("[[limits]]")[0]
    settings.write_text(text.replace('"Blow"', '"B"').replace("[3, 4]", "[3]").replace("[3.0, 8.0]", "[3.0]"))
    result = run_study("white_box", tmp_path / "run", settings)
    found = json.loads((result.folder / "findings.json").read_text(encoding="utf-8"))
    empty = {
        (one["band"], one["signal"])
        for one in found
        if one.get("measure") == "resonance" and not one["steps"]
    }
    assert empty == {(band, signal) for _, band, signal in reference.WITHOUT_PEAK}
    away = [one["value"] for one in found if one.get("measure") == "away from Table 2.1"]
    assert away.count(None) == 4 * len(empty)


def test_one_process_and_two_find_the_same(results: tuple[StudyResult, StudyResult]) -> None:
    for name in ("findings.json", "report.html"):
        one, two = ((item.folder / name).read_text(encoding="utf-8") for item in results)
        assert one == two.replace('"processes": 2', '"processes": 1').replace(
            "&#34;processes&#34;: 2", "&#34;processes&#34;: 1"
        )


def test_the_quick_study_says_what_it_measured(results: tuple[StudyResult, StudyResult]) -> None:
    result = results[0]
    assert [verdict.passed for verdict in result.verdicts] == [True, False]
    found = json.loads((result.folder / "findings.json").read_text(encoding="utf-8"))
    errors = [one for one in found if one.get("measure") == "height error"]
    # seeds x heights x noises x routes x (one choice of modes after 3 s, all seven after 8 s)
    assert len(errors) == 2 * 2 * 2 * 2 * (1 + 7)
    assert len({one["height"] for one in errors}) == 4
    for one in errors:
        assert one["value"] == pytest.approx(abs(one["estimate"] - one["height"]))
    page = (result.folder / "report.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 5
    for title in ("Resonances of step responses", "At rest", "Poles over the operating range"):
        assert f"<h2>{title}</h2>" in page
    assert "19.592" in page  # the thesis stands beside ours
    assert "drawing" not in json.dumps(found)


def test_the_settings_that_come_with_it_are_valid_and_name_what_is_measured(
    results: tuple[StudyResult, StudyResult],
) -> None:
    settings = load_settings(WhiteBoxSettings, STUDIES / "white_box.toml")
    found = json.loads((results[0].folder / "findings.json").read_text(encoding="utf-8"))
    fields = {one["measure"]: set(one) for one in found if "measure" in one}
    routes = {route.name for route in settings.height.routes}
    for limit in settings.limits:
        assert limit.measure is not None and set(limit.where) <= fields[limit.measure]
        assert limit.where["wbm"] in settings.sets
        assert limit.where.get("route", next(iter(routes))) in routes
        assert limit.where.get("noise", "none") in settings.height.noises
        assert limit.where.get("duration", 42.0) in settings.height.durations
