"""The same bits on every platform that can run here, at every communication step."""

from __future__ import annotations

import pytest

from platforms.conftest import NAMES, Machines
from platforms.machines import RUNNABLE, number
from platforms.scenarios import STEPS, all_of, continued, ticks

OTHERS = tuple(name for name in RUNNABLE if name != "linux64")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("platform", OTHERS)
def test_same_bits_as_on_linux64(all_machines: Machines, platform: str, name: str) -> None:
    expected = all_machines.lines("linux64", name)
    found = all_machines.lines(platform, name)
    assert list(found) == list(all_of(all_machines.fmus[name]))
    for scenario, lines in expected.items():
        assert found[scenario] == lines, scenario


@pytest.mark.parametrize("name", NAMES)
def test_scenarios_run_without_a_complaint_and_move_every_output(all_machines: Machines, name: str) -> None:
    for scenario, lines in all_machines.lines("linux64", name).items():
        rows = [list(map(number, line.split())) for line in lines if line.count(" ") > 1]
        refused = [line for line in lines if line.startswith(("status", "failed"))]
        assert refused == [], (scenario, refused)
        assert len(rows) > 5
        first = 0 if not scenario.startswith("held") else 2
        for column in list(zip(*rows, strict=True))[first:]:
            assert max(column) > min(column), scenario


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("platform", RUNNABLE)
def test_same_bits_after_the_same_ticks_at_every_step(
    all_machines: Machines, platform: str, name: str
) -> None:
    fmu, lines = all_machines.fmus[name], all_machines.lines(platform, name)
    known: dict[int, str] = {}
    for milliseconds in STEPS:
        rows = lines[f"held-{milliseconds:.4g}ms"][1:]
        counts = ticks(fmu, milliseconds * 1e-3)
        assert len(rows) == len(counts)
        for count, row in zip(counts, rows, strict=True):
            assert known.setdefault(count, row) == row, (milliseconds, count)
    assert len(known) > 100


def test_changed_parameters_change_the_bits(all_machines: Machines) -> None:
    lines = all_machines.lines("linux64", "surrogate")
    changed = [line for line in lines["parameters"] if not line.startswith("status")]
    assert all(one != other for one, other in zip(changed, lines["moving-1ms"], strict=True))


@pytest.mark.parametrize("name", ("wbm", "surrogate"))
@pytest.mark.parametrize("platform", OTHERS)
def test_a_state_saved_elsewhere_goes_on_with_the_same_bits(
    all_machines: Machines, platform: str, name: str
) -> None:
    scenario = "parameters" if name == "surrogate" else "moving-1ms"
    saved = all_machines.lines("linux64", name)[scenario][-2]
    results = []
    for one in ("linux64", platform):
        commands = [f"load {all_machines.library(one, name)}", *continued(all_machines.fmus[name], saved)]
        results.append(all_machines.machine(one).run(commands))
    assert results[0] == results[1]
    assert len(results[0]) == 22
