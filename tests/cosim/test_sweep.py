"""`llmn sweep`: its plan, its results against runs made one by one, what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

import fmus
from cosim import sweeps
from cosim.whole_path import PLATFORMS
from cosimulation.cli import app
from cosimulation.fmu_driver import running_fmu
from cosimulation.fmu_file import open_fmu
from cosimulation.sweep import SweepSettings, run_sweep
from cosimulation.sweep.bench import open_bench
from cosimulation.sweep.plan import Run, chunks_of, combinations, runs_of
from cosimulation.sweep.settings import ParameterSettings
from fmu_builder.errors import OutputError, SettingsError
from identification.data_set import DataSet
from identification.scores import fit_percent, max_error

WHOLE = """
processes = 2
seeds = [3, 1]
samples = 2
outputs = ["F_p", "zeta"]
chunk_rows = 2000

[reference]
start_values = { preset = "Blow" }

[[models]]
name = "small"

[[models]]
name = "itself"
start_values = { preset = "Blow" }

[[signals]]
name = "middle"
kind = "operating_point"
height = 1.4
duration = 0.3

[[signals]]
name = "ramp"
kind = "whole_range"
low = 0.9
duration = 0.5
excitation = { torque_amplitude = 20.0 }

[[parameters]]
name = "k_E"
low = 5e4
high = 2e5
scale = "log"
models = ["small"]
reference = true

[[parameters]]
name = "unilateral"
values = [true, false]
models = ["small"]
"""


@pytest.fixture(scope="module")
def surrogate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fmus.build("surrogate_blow", tmp_path_factory.mktemp("sweep") / "small one.fmu", PLATFORMS)


def whole(surrogate: Path, white_box: Path, folder: Path) -> SweepSettings:
    text = WHOLE.replace("[reference]", f'[reference]\nfmu = "{white_box}"')
    text = text.replace('name = "small"', f'name = "small"\nfmu = "{surrogate}"')
    text = text.replace('name = "itself"', f'name = "itself"\nfmu = "{white_box}"')
    return sweeps.settings(text, output=folder)


def one_by_one(settings: SweepSettings) -> list[tuple[float, float, float | None]]:
    """FIT and largest error of F_p and share in range, every run in a new instance of its own."""
    settings, bench = open_bench(settings)
    found = []
    for run in runs_of(settings, bench):
        data = bench.signals[run.signal].data(run.seed)
        results = []
        for model, values in ((bench.reference, run.shared), (bench.models[run.model], run.parameters)):
            assert model is not None and isinstance(model.archive, Path)
            with open_fmu(model.archive) as fmu, running_fmu(fmu) as instance:
                start = {**model.settings.start_values, **values}
                flags = ("in_range",) if model.watched else ()
                names = ("eta", "M_pa")
                outputs = instance.run(data.matrix(names), names, ("F_p",), 0.001, start, flags=flags)
                results.append(outputs[:, 0])
                share = float(instance.flags.mean()) if flags else None
        found.append((fit_percent(*results), max_error(*results), share))
    return found


def test_a_sweep_has_the_bits_of_runs_made_one_by_one(
    surrogate: Path, white_box: Path, tmp_path: Path
) -> None:
    settings = whole(surrogate, white_box, tmp_path / "sweep")
    result = run_sweep(settings)
    rows = sweeps.table(tmp_path / "sweep")
    assert len(rows) == 2 * 2 * (2 * 2) + 2 * 2  # signals x seeds x (samples x values), and without any
    assert [(row["fit.F_p"], row["max_error.F_p"], row["in_range"]) for row in rows] == one_by_one(settings)
    assert result.passed and {row["status"] for row in rows} == {"ok"}
    perfect = [row for row in rows if row["model"] == "itself"]
    assert {row["fit.F_p"] for row in perfect} == {100.0} and perfect[0]["parameter.k_E"] is None
    assert [row["seed"] for row in rows[:2]] == [3, 1] and len({row["parameter.k_E"] for row in rows}) == 3
    again = run_sweep(settings.model_copy(update={"processes": 1, "output": tmp_path / "serial"}))
    assert again.results.read_bytes() == result.results.read_bytes()


def test_what_is_recorded_is_not_run_again(tmp_path: Path, vendor: Path) -> None:
    first = sweeps.vendor_settings(vendor, tmp_path / "sweep")
    run_sweep(first)
    more = first.model_copy(update={"seeds": (1, 2, 5)})
    result = run_sweep(more)
    assert (result.recorded, len(result.rows)) == (4, 6)
    assert sorted(sweeps.recorded(tmp_path / "sweep")) == sorted(run.key for run in result.runs)
    whole = run_sweep(more.model_copy(update={"output": tmp_path / "at once"}))
    assert whole.results.read_bytes() == result.results.read_bytes()
    assert run_sweep(more).recorded == 6


def keys(settings: SweepSettings) -> list[str]:
    return [run.key for run in runs_of(*open_bench(settings))]


def test_a_task_is_known_by_all_that_its_result_depends_on(vendor: Path, tmp_path: Path) -> None:
    known = set(keys(sweeps.vendor_settings(vendor, tmp_path)))
    assert len(known) == 4
    same: list[dict[str, object]] = [
        {"output": tmp_path / "other"},
        {"processes": 2},
        {"chunk_rows": 1},
        {"parameters": [{"name": "gain", "values": [1.0, 2]}]},
        {"models": [{"fmu": str(vendor), "reuse": False}]},
    ]
    for change in same:
        assert set(keys(sweeps.vendor_settings(vendor, tmp_path, **change))) == known, change
    other: list[dict[str, object]] = [
        {"seeds": [3, 4]},
        {"parameters": [{"name": "gain", "values": [3, 4]}]},
        {"parameters": [{"name": "gain", "values": [1, 2], "reference": True}]},
        {"models": [{"fmu": str(vendor), "name": "another"}]},
        {"models": [{"fmu": str(vendor), "start_values": {"deed": 0}}]},
        {"reference": {"fmu": str(vendor), "start_values": {"deed": 0}}},
        {"signals": [{"name": "one", "kind": "operating_point", "height": 1.0, "duration": 0.06}]},
        {"signals": [{"name": "two", "kind": "operating_point", "height": 1.0, "duration": 0.05}]},
    ]
    for change in other:
        assert not set(keys(sweeps.vendor_settings(vendor, tmp_path, **change))) & known, change


def test_more_samples_leave_the_earlier_draws_as_they_are() -> None:
    drawn = [
        ParameterSettings(name="a", low=1e-3, high=10.0, scale="log"),
        ParameterSettings(name="b", low=-1.0, high=0.0),
    ]
    few, many = combinations(drawn, 3, 7), combinations(drawn, 200, 7)
    assert many[:3] == few and combinations(drawn, 3, 8) != few
    assert [one["a"] for one in combinations(drawn[:1], 200, 7)] == [one["a"] for one in many]
    values = np.array([[float(one["a"]), float(one["b"])] for one in many])
    assert (values[:, 0] > 1e-3).all() and (values[:, 0] < 10.0).all()
    assert abs(np.log10(values[:, 0]).mean() + 1.0) < 0.25  # the middle of -3 .. 1, four standard errors
    assert abs(values[:, 1].mean() + 0.5) < 0.09
    fixed = ParameterSettings(name="c", values=("x", "y"))
    assert [one["c"] for one in combinations([fixed, *drawn], 2, 7)] == ["x", "x", "y", "y"]


def test_chunks_hold_every_run_once_and_keep_those_of_one_reference_together(
    vendor: Path, tmp_path: Path
) -> None:
    settings, bench = open_bench(sweeps.vendor_settings(vendor, tmp_path, seeds=list(range(10))))
    runs = runs_of(settings, bench)
    for rows, workers in ((1, 1), (130, 2), (10**9, 1), (10**9, 3)):
        pieces = chunks_of(runs, bench, rows, workers)
        flat: list[Run] = [run for piece in pieces for run in piece]
        assert sorted(run.key for run in flat) == sorted(run.key for run in runs)
        assert [run.seed for run in flat] == sorted(seed for run in runs if (seed := run.seed) is not None)
        assert all(sum(50 for _ in piece[:-1]) < rows for piece in pieces)
        assert len(pieces) >= 2 * workers


def test_a_recorded_file_is_run_once_and_scored_by_what_it_holds(vendor: Path, tmp_path: Path) -> None:
    time = np.arange(60) * 0.001
    rows = np.column_stack([1.0 + 0.1 * np.sin(40.0 * time), 7.0 * time, 0.001 * time])
    record = DataSet("trial", 0.001, ("wire", "M_pa", "height"), ("m", "N.m", "m"), rows)
    record.save(tmp_path / "trial.npz")
    given = {
        "models": [{"fmu": str(vendor), "names": {"wire": "eta", "height": "y"}}],
        "signals": [{"name": "trial", "file": str(tmp_path / "trial.npz")}],
        "reference": None,
    }
    settings = sweeps.vendor_settings(vendor, tmp_path / "sweep", **given)
    run_sweep(settings)
    found = sweeps.table(tmp_path / "sweep")
    assert [(row["seed"], row["parameter.gain"]) for row in found] == [(None, 1.0), (None, 2.0)]
    y, expected = 0.0, []
    for eta, torque, _ in rows:
        expected.append(y)
        y += 0.001 * 2.0 * (eta + 1e-3 * torque - y)
    assert found[1]["max_error.height"] == max_error(rows[:, 2], np.array(expected))
    assert found[1]["in_range"] == 20 / 60


def test_everything_wrong_is_said_at_once(vendor: Path, tmp_path: Path) -> None:
    DataSet("r", 0.01, ("eta", "z"), ("N", "m"), np.zeros((5, 2))).save(tmp_path / "r.npz")
    model = {"fmu": str(vendor), "start_values": {"gian": 1.0}, "names": {"a": "nothing"}}
    settings = sweeps.vendor_settings(
        vendor,
        tmp_path / "sweep",
        models=[model, {"fmu": "missing.fmu"}, {"fmu": str(vendor), "name": "right"}],
        signals=[
            {"name": "r", "file": str(tmp_path / "r.npz")},
            {"name": "gone", "file": str(tmp_path / "gone.csv")},
        ],
        parameters=[
            {"name": "gain", "values": ["much"]},
            {"name": "y", "values": [1.0]},
            {"name": "none", "low": 0.0, "high": 1.0, "models": ["right"]},
        ],
        outputs=["F_p"],
    )
    with pytest.raises(SettingsError) as caught:
        run_sweep(settings)
    said = str(caught.value)
    for part in ("gian", "'nothing'", "missing.fmu", "gone.csv", "'much'", "'output'", "variable 'none'"):
        assert part in said, part
    assert "no column 'M_pa'" in said and "'eta' in 'N'" in said
    assert not (tmp_path / "sweep").exists()


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"seeds": [1, 1]}, "seeds"),
        ({"samples": 3}, "samples needs"),
        ({"models": [{"fmu": "a.fmu"}, {"fmu": "b/a.fmu"}]}, "models: the name 'a'"),
        ({"parameters": [{"name": "gain"}]}, "either values or low and high"),
        ({"parameters": [{"name": "gain", "low": -1.0, "high": 1.0, "scale": "log"}]}, "above 0"),
        ({"parameters": [{"name": "gain", "values": [1, 1]}]}, "more than once"),
        ({"parameters": [{"name": "gain", "values": [1], "models": ["b"]}]}, "not there"),
        ({"signals": [{"name": "s", "kind": "whole_range"}]}, "a duration goes with a kind"),
        ({"signals": [{"name": "s", "kind": "whole_range", "duration": 1e-4}]}, "below one sample"),
        ({"signals": [{"name": "s"}]}, "either a file or a kind"),
        ({"colour": "red"}, "there is no such key"),
    ],
)
def test_settings_that_contradict_themselves_are_refused(
    change: dict[str, object], part: str, tmp_path: Path
) -> None:
    with pytest.raises(SettingsError, match=part):
        sweeps.vendor_settings(Path("v.fmu"), tmp_path, **change)


def test_outputs_that_cannot_be_scored_are_refused(vendor: Path, tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="'z'"):
        run_sweep(sweeps.vendor_settings(vendor, tmp_path / "sweep", outputs=["y", "z"]))
    with pytest.raises(SettingsError, match="'y'"):
        run_sweep(sweeps.vendor_settings(vendor, tmp_path / "sweep", outputs=["y"], reference=None))


def test_a_folder_of_somebody_else_is_left_alone(vendor: Path, tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(OutputError, match="no sweep wrote"):
        run_sweep(sweeps.vendor_settings(vendor, tmp_path))
    assert [item.name for item in tmp_path.iterdir()] == ["thesis.txt"]
    with pytest.raises(OutputError):
        run_sweep(sweeps.vendor_settings(vendor, tmp_path / "thesis.txt"))


def test_the_command_prints_a_table_or_json(vendor: Path, tmp_path: Path) -> None:
    file = tmp_path / "sweep.toml"
    file.write_text(
        f"""
        output = "{tmp_path / "sweep"}"
        models = [{{ fmu = "{vendor}", start_values = {{ deed = 4 }} }}, {{ fmu = "{vendor}", name = "b" }}]
        signals = [{{ name = "one", kind = "whole_range", duration = 0.05 }}]
        """,
        encoding="utf-8",
    )
    told = CliRunner().invoke(app, ["sweep", str(file), "--json", "--processes", "1"])
    assert told.exit_code == 1
    assert json.loads(told.stdout) == {
        "results": str(tmp_path / "sweep" / "results.parquet"), "runs": 2, "recorded_before": 0,
        "ok": 1, "failed": 1, "crashed": 0, "timeout": 0, "passed": False,
    }  # fmt: skip
    shown = CliRunner().invoke(app, ["sweep", str(file)])
    assert shown.exit_code == 1 and "reported error while stepping at t = 0.019 s" in shown.stdout
    assert "2 runs (1 ok, 1 failed), 2 recorded before" in shown.stdout
    assert pq.read_table(tmp_path / "sweep" / "results.parquet")["in_range"].to_pylist() == [None, 0.4]
