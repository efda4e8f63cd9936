"""Everything fmpy's simulate_fmu can be told, and what an importer may do that most do not."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest

import tolerances
from fmi.raw import ERROR, OK, Slave, load

FMUS = ("wbm", "surrogate", "n4sid")
SIGNALS = {"wbm": ("eta", "F_p", "xi"), "surrogate": ("eta", "F_p", "xi"), "n4sid": ("u_1", "force", "y_1")}
SAME = {
    "no stop time": {"set_stop_time": False},
    "tolerance": {"relative_tolerance": 1e-7},
    "event mode": {"use_event_mode": True},
    "early return": {"early_return_allowed": True},
    "callback after every step": {"step_finished": lambda _time, _recorder: True},
    "logging": {"debug_logging": True},
    "visible": {"visible": True},
    "time limit": {"timeout": 60.0},
    "start values of everything": {"apply_default_start_values": True},
}
"""Options that change nothing in what comes out."""


def simulate(fmus: Mapping[str, Path], name: str, **options: Any) -> tuple[np.ndarray, list[tuple[int, str]]]:
    """Last rows of three signals, and what was said as (status, text), with an input that moves."""
    said: list[tuple[int, str]] = []
    moving, *outputs = SIGNALS[name]
    begin, end = options.pop("start_time", 0.0), options.pop("stop_time", 0.1)
    # Jumps lie between the ticks, where fmpy steps too: a rounding error of its time changes nothing.
    time = begin + 0.001 * np.arange(101) - 0.0005
    height = 1.45 + 0.02 * np.sin(0.3 * np.arange(101))
    signals = np.rec.fromarrays([np.repeat(time, 2)[1:], np.repeat(height, 2)[:-1]], names=["time", moving])
    result = fmpy.simulate_fmu(
        str(fmus[name]),
        start_time=begin,
        stop_time=end,
        output_interval=0.001,
        input=signals,
        logger=lambda _env, _name, status, _category, text: said.append((status, text.decode())),
        **options,
    )
    return np.column_stack([result[one] for one in outputs]), said


@pytest.mark.parametrize("option", SAME)
def test_options_that_change_nothing_change_nothing(option: str, fmus: Mapping[str, Path]) -> None:
    for name in FMUS:
        plain, _ = simulate(fmus, name)
        found, said = simulate(fmus, name, **SAME[option])
        assert found.shape == plain.shape == (201, 2) and np.ptp(plain[:, 1]) > 0.0
        assert np.abs(found - plain).max() == tolerances.BITS
        assert all(status == OK for status, _ in said), said


@pytest.mark.parametrize("begin", [-3.0, 4096.0])
def test_a_run_may_start_at_any_time(begin: float, fmus: Mapping[str, Path]) -> None:
    for name in FMUS:
        plain, _ = simulate(fmus, name)
        found, _ = simulate(fmus, name, start_time=begin, stop_time=begin + 0.1)
        gap = np.abs(found - plain).max(axis=0)
        assert (gap <= tolerances.IMPORTER_INTERPOLATION * np.abs(plain).max(axis=0)).all()


@pytest.mark.parametrize("solver", ["CVode", "Euler"])
@pytest.mark.parametrize("begin", [0.0, -3.0, 4096.0])
def test_model_exchange_runs_from_any_time(solver: str, begin: float, fmus: Mapping[str, Path]) -> None:
    for name in FMUS:
        times = {"start_time": begin, "stop_time": begin + 0.1}
        found, said = simulate(fmus, name, fmi_type="ModelExchange", solver=solver, **times)
        assert np.isfinite(found).all() and np.ptp(found[:, 1]) > 0.0
        assert all(status == OK for status, _ in said), said


def test_a_thousand_instances_do_not_know_each_other(fmus: Mapping[str, Path], tmp_path: Path) -> None:
    for name in FMUS:
        description = fmpy.read_model_description(str(fmus[name]))
        reference = {v.name: v.valueReference for v in description.modelVariables}
        library = load(fmus[name], tmp_path / name)
        many = [Slave(library, description.guid) for _ in range(1000)]
        heights = np.linspace(0.9, 2.1, 1000)
        for slave, height in zip(many, heights, strict=True):
            slave.start(**{f"v{reference[SIGNALS[name][0]]}": float(height)})
        assert all(slave.step(0.0, 0.004) == OK for slave in many)
        shown = [slave.get([reference[SIGNALS[name][0]], reference[SIGNALS[name][2]]]) for slave in many]
        assert [row[0] for row in shown if row] == heights.tolist()
        assert len({row[1] for row in shown if row}) > 900
        for slave in many:
            slave.free()


@pytest.mark.parametrize("begin", [-1e6, 1e6])
def test_a_million_seconds_from_zero_the_ticks_are_the_same(
    begin: float, fmus: Mapping[str, Path], tmp_path: Path
) -> None:
    """Call by call; a master's time is off by a ten millionth of a tick there."""
    number = ctypes.c_double
    for name in FMUS:
        description = fmpy.read_model_description(str(fmus[name]))
        reference = {v.name: v.valueReference for v in description.modelVariables}
        library, moving = load(fmus[name], tmp_path / name), reference[SIGNALS[name][0]]
        rows = []
        for start in (0.0, begin):
            slave = Slave(library, description.guid)
            assert slave.SetupExperiment(0, number(0.0), number(start), 1, number(start + 0.2)) == OK
            assert slave.EnterInitializationMode() == OK and slave.ExitInitializationMode() == OK
            for k in range(200):
                assert slave.set([moving], [1.4 + 0.0001 * k]) == OK
                assert slave.step(start + k * 0.001, 0.001) == OK
            rows.append(slave.get([reference[one] for one in SIGNALS[name]]))
            slave.free()
        assert rows[0] == rows[1]


def test_an_experiment_may_end_where_it_starts_and_not_before(
    fmus: Mapping[str, Path], tmp_path: Path
) -> None:
    description = fmpy.read_model_description(str(fmus["wbm"]))
    slave = Slave(load(fmus["wbm"], tmp_path), description.guid)
    number = ctypes.c_double
    assert slave.SetupExperiment(1, number(-1.0), number(2.0), 1, number(2.0)) == OK
    assert slave.SetupExperiment(0, number(0.0), number(2.0), 1, number(1.999)) == ERROR
    assert slave.last_error() == "fmi2SetupExperiment: the stop time must not be before the start time"
    assert slave.SetupExperiment(0, number(0.0), number(2.0), 1, number(float("nan"))) == ERROR
    assert slave.EnterInitializationMode() == OK and slave.ExitInitializationMode() == OK
    assert slave.step(2.0, 0.001) == ERROR
    assert "beyond the stop time 2 s" in slave.last_error()
    slave.free()
