"""What FMUs can do to a sweep: crash, hang, fail, forget; and what people can: kill it at any time."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cosim import sweeps
from cosimulation.fmu_file import open_fmu
from cosimulation.settings import load_settings
from cosimulation.sweep import SweepSettings, run_sweep
from cosimulation.sweep.bench import open_bench
from cosimulation.sweep.local import LocalPool
from cosimulation.sweep.plan import runs_of
from cosimulation.sweep.store import opened_store
from cosimulation.sweep.worker import Row, Workbench
from fmu_builder.errors import DataError, OutputError, SweepError

DEED = sweeps.DEED
ROOT = Path(__file__).resolve().parents[2]


def test_a_bad_fmu_loses_its_own_runs_only(vendor: Path, tmp_path: Path) -> None:
    bad = ["writes_nowhere", "traps", "hangs", "fails"]
    order = ["good", "writes_nowhere", "poisons", "good", "traps", "hangs", "fails", "refuses_reset"]
    names = list(dict.fromkeys(order))
    settings = sweeps.vendor_settings(
        vendor,
        tmp_path / "sweep",
        processes=2,
        time_limit=1.0,
        seeds=[1],
        parameters=[
            {"name": "gain", "values": [1.0, 2.0]},
            {"name": "deed", "values": [DEED[name] for name in names]},
        ],
    )
    result = run_sweep(settings)
    found = {(row["parameter.deed"], row["parameter.gain"]): row for row in sweeps.table(tmp_path / "sweep")}
    statuses = {name: {found[DEED[name], gain]["status"] for gain in (1.0, 2.0)} for name in names}
    expected = {"writes_nowhere": "crashed", "traps": "crashed", "hangs": "timeout", "fails": "failed"}
    assert statuses == {name: {expected.get(name, "ok")} for name in names}
    assert not result.passed and result.counts["crashed"] == 4
    for name in names:
        for gain in (1.0, 2.0):
            row, good = found[DEED[name], gain], found[DEED["good"], gain]
            assert row["fit.y"] == (None if name in bad else good["fit.y"]), name
    assert not (tmp_path / "sweep" / "work").exists()
    assert run_sweep(settings).recorded == len(found)
    before = result.results.read_bytes()
    assert run_sweep(settings, retry=True).recorded == len(found) - 8
    assert result.results.read_bytes() == before


def test_a_crash_is_laid_to_the_run_that_crashes_alone(vendor: Path, tmp_path: Path) -> None:
    """Damage that a run leaves behind ends the process in a later one, which is not to blame."""
    settings = sweeps.vendor_settings(
        vendor,
        tmp_path / "sweep",
        seeds=[1, 2, 3],
        parameters=[{"name": "deed", "values": [DEED["poisons"], DEED["good"]]}],
        reference=None,
    )
    assert run_sweep(settings).passed
    assert len(sweeps.table(tmp_path / "sweep")) == 6


def test_a_worker_that_somebody_ends_costs_nothing(
    vendor: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    heard, ended = LocalPool._heard, []

    def one_ends(pool: LocalPool) -> list[Row]:
        several = [worker for worker in pool._workers if len(worker.pending) > 1]  # no suspect alone
        alive = [worker for worker in several if worker.ready == bool(ended)]
        if len(ended) < 6 and alive:  # the first while it starts, the others at work
            alive[0].process.kill()
            ended.append(alive[0].process.pid)
        return heard(pool)

    settings = sweeps.vendor_settings(vendor, tmp_path / "one", processes=2, seeds=list(range(100)))
    undisturbed = run_sweep(settings.model_copy(update={"output": tmp_path / "other"}))
    monkeypatch.setattr(LocalPool, "_heard", one_ends)
    result = run_sweep(settings)
    assert result.passed and len(ended) == 6
    assert result.results.read_bytes() == undisturbed.results.read_bytes()


def test_workers_that_cannot_start_are_said(
    vendor: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    heard = LocalPool._heard

    def all_end(pool: LocalPool) -> list[Row]:
        for worker in pool._workers:
            worker.process.kill()
            worker.process.join()
        return heard(pool)

    monkeypatch.setattr(LocalPool, "_heard", all_end)
    with pytest.raises(SweepError, match="end before they do anything"):
        run_sweep(sweeps.vendor_settings(vendor, tmp_path))


@pytest.mark.parametrize("deed", ["forgets_reset", "refuses_reset"])
def test_an_fmu_that_cannot_be_reset_gives_what_new_instances_give(
    deed: str, vendor: Path, tmp_path: Path
) -> None:
    model = {"fmu": str(vendor), "start_values": {"deed": DEED[deed]}}
    found = []
    for reuse in (True, False):
        settings = sweeps.vendor_settings(
            vendor, tmp_path, models=[{**model, "reuse": reuse}], reference=None, seeds=[1, 2, 3]
        )
        settings, bench = open_bench(settings.model_copy(update={"reference": settings.models[0]}))
        workbench = Workbench(bench)
        found.append([workbench.row(run) for run in runs_of(settings, bench)])
        workbench.close()
    assert found[0] == found[1]
    assert {row["status"] for row in found[0]} == {"ok"}


def test_an_instance_is_reused(vendor: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = []
    instance = "cosimulation.sweep.worker.FmuInstance"
    with open_fmu(vendor):
        from cosimulation.fmu_driver import FmuInstance

        monkeypatch.setattr(instance, lambda *given: made.append(given) or FmuInstance(*given))
        settings, bench = open_bench(sweeps.vendor_settings(vendor, tmp_path, seeds=list(range(20))))
        workbench = Workbench(bench)
        rows = [workbench.row(run) for run in runs_of(settings, bench)]
        workbench.close()
    assert len(rows) == 40 and len(made) == 2  # one, and one to try whether a reset is as good


def command(folder: Path, vendor: Path, seeds: int) -> list[str]:
    """A sweep of two runs a seed, as a command line."""
    file = folder / "sweep.toml"
    file.write_text(
        f"""
        output = "{folder / "sweep"}"
        processes = 2
        chunk_rows = 5000
        seeds = {list(range(seeds))}
        reference = {{ fmu = "{vendor}" }}
        models = [{{ fmu = "{vendor}" }}]
        signals = [{{ name = "one", kind = "whole_range", duration = 1.0 }}]
        parameters = [{{ name = "gain", values = [1, 2] }}]
        """,
        encoding="utf-8",
    )
    return [sys.executable, "-m", "cosimulation", "sweep", str(file), "--json"]


def started(folder: Path, arguments: list[str]) -> subprocess.Popen[bytes]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        arguments, cwd=folder, env=environment, start_new_session=True, stdout=subprocess.PIPE
    )


def wait_for_parts(process: subprocess.Popen[bytes], folder: Path, more_than: int) -> None:
    """Return when runs have been recorded, or the sweep is at its end."""
    end = time.monotonic() + 60.0
    while process.poll() is None and len(list((folder / "parts").glob("part-*.parquet"))) <= more_than:
        assert time.monotonic() < end
        time.sleep(0.01)


def test_a_sweep_killed_at_any_time_goes_on_and_ends_with_the_same_bytes(
    vendor: Path, tmp_path: Path
) -> None:
    """The long version, 500 runs and 20 kills, is tests/benchmarks/sweep.py."""
    arguments, chance = command(tmp_path, vendor, 800), random.Random(6)  # seconds, also on a fast machine
    folder = tmp_path / "sweep"
    known: set[str] = set()
    for kill in range(2):
        process = started(tmp_path, arguments)
        if kill:
            wait_for_parts(process, folder, len(list((folder / "parts").glob("part-*.parquet"))))
        time.sleep(chance.uniform(0.0, 0.1))
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        now = sweeps.recorded(folder)
        assert known <= set(now) and len(set(now)) == len(now)
        known = set(now)
    assert known and not (folder / "results.parquet").exists()
    settings = load_settings(SweepSettings, tmp_path / "sweep.toml")
    result = run_sweep(settings)
    assert result.recorded == len(known) and result.passed
    assert sorted(sweeps.recorded(folder)) == sorted(row["task"] for row in sweeps.table(folder))
    assert len(sweeps.table(folder)) == 1600 and not (folder / "work").exists()
    assert not list((folder / "parts").glob(".*"))
    whole = run_sweep(settings.model_copy(update={"output": tmp_path / "whole"}))
    assert whole.results.read_bytes() == result.results.read_bytes()


def test_ctrl_c_leaves_what_is_finished_and_no_process(vendor: Path, tmp_path: Path) -> None:
    process = started(tmp_path, command(tmp_path, vendor, 2000))
    wait_for_parts(process, tmp_path / "sweep", 0)
    os.killpg(process.pid, signal.SIGINT)
    process.communicate(timeout=30)
    assert process.returncode == 130
    assert sweeps.recorded(tmp_path / "sweep") and not (tmp_path / "sweep" / "results.parquet").exists()
    assert not (tmp_path / "sweep" / "work").exists()
    end = time.monotonic() + 10.0
    while time.monotonic() < end:  # the last of its processes may take a moment to end
        try:
            os.killpg(process.pid, 0)
        except ProcessLookupError:
            break
        time.sleep(0.05)
    else:
        raise AssertionError("a process of the sweep lives on")


def test_two_sweeps_do_not_write_to_one_folder(vendor: Path, tmp_path: Path) -> None:
    with opened_store(tmp_path), pytest.raises(OutputError, match="in use by another sweep"):
        run_sweep(sweeps.vendor_settings(vendor, tmp_path))
    run_sweep(sweeps.vendor_settings(vendor, tmp_path))


def test_a_damaged_part_is_named(vendor: Path, tmp_path: Path) -> None:
    settings = sweeps.vendor_settings(vendor, tmp_path)
    before = run_sweep(settings).results.read_bytes()
    (part,) = (tmp_path / "parts").glob("part-*.parquet")
    part.write_bytes(part.read_bytes()[:-20])
    with pytest.raises(DataError, match="Delete it; its runs are then done again"):
        run_sweep(settings)
    part.unlink()
    assert run_sweep(settings).results.read_bytes() == before
