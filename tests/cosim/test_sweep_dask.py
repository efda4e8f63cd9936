"""The same sweep on a Dask cluster: a real scheduler and real workers on this machine's loopback."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from cosim import sweeps
from cosimulation.sweep import job, run_sweep
from fmu_builder.errors import SettingsError, SweepError

ROOT = Path(__file__).resolve().parents[2]
PATIENCE = 60.0


@dataclass
class Cluster:
    """A scheduler and two workers, of which one is not started again when it dies."""

    address: str
    mortal: subprocess.Popen[bytes]


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    folder = tmp_path_factory.mktemp("dask")
    place = folder / "scheduler.json"
    environment = {
        **os.environ, "PYTHONPATH": str(ROOT), "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1",
    }  # fmt: skip
    begun: list[subprocess.Popen[bytes]] = []

    def begin(program: str, *arguments: str) -> subprocess.Popen[bytes]:
        line = [
            sys.executable,
            "-m",
            f"distributed.cli.{program}",
            *arguments,
            "--dashboard-address",
            "127.0.0.1:0",
        ]
        with (folder / f"log{len(begun)}.txt").open("wb") as log:
            begun.append(
                subprocess.Popen(line, cwd=folder, env=environment, stdout=log, stderr=subprocess.STDOUT)
            )
        return begun[-1]

    try:
        begin("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(place))
        end = time.monotonic() + PATIENCE
        while not place.is_file():
            assert time.monotonic() < end, (folder / "log0.txt").read_text()
            time.sleep(0.05)
        usual = ("--scheduler-file", str(place), "--nthreads", "1", "--host", "127.0.0.1")
        mortal = begin("dask_worker", *usual, "--no-nanny", "--local-directory", str(folder / "mortal"))
        begin("dask_worker", *usual, "--local-directory", str(folder / "immortal"))
        yield Cluster(json.loads(place.read_text())["address"], mortal)
    finally:
        for process in reversed(begun):  # workers before their scheduler, which they would look for
            process.terminate()
            try:
                process.wait(20.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def kill_when_recorded(process: subprocess.Popen[bytes], folder: Path, seen: list[int]) -> None:
    """Kill a worker once results come; `seen` gets how many parts there were."""
    end = time.monotonic() + PATIENCE
    while not list((folder / "parts").glob("part-*.parquet")) and time.monotonic() < end:
        time.sleep(0.005)
    process.kill()
    seen.append(len(list((folder / "parts").glob("part-*.parquet"))))


def test_a_worker_killed_in_the_middle_costs_nothing(
    cluster: Cluster, vendor: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(job, "_WRITE_EVERY", 0.0)
    settings = sweeps.vendor_settings(
        vendor,
        tmp_path / "cluster",
        seeds=list(range(80)),
        chunk_rows=4000,
        signals=[{"name": "one", "kind": "operating_point", "height": 1.0, "duration": 1.0}],
    )
    seen: list[int] = []
    killer = threading.Thread(target=kill_when_recorded, args=(cluster.mortal, settings.output, seen))
    killer.start()
    result = run_sweep(settings, scheduler=cluster.address)
    killer.join()
    assert cluster.mortal.wait(10.0) == -9
    assert result.passed and len(result.rows) == 160
    assert 1 <= seen[0] < 40 / 2  # of at most 40 chunks, in the middle indeed
    assert sorted(sweeps.recorded(settings.output)) == sorted(row["key"] for row in result.rows)
    serial = run_sweep(settings.model_copy(update={"output": tmp_path / "serial"}))
    assert result.results.read_bytes() == serial.results.read_bytes()


def test_an_fmu_that_crashes_its_workers_is_recorded(cluster: Cluster, vendor: Path, tmp_path: Path) -> None:
    settings = sweeps.vendor_settings(
        vendor,
        tmp_path / "cluster",
        seeds=[1],
        parameters=[{"name": "deed", "values": [0, sweeps.DEED["traps"], sweeps.DEED["fails"], 0.5]}],
    )
    result = run_sweep(settings, scheduler=cluster.address)
    assert [row["status"] for row in result.rows] == ["ok", "crashed", "failed", "ok"]
    serial = run_sweep(settings.model_copy(update={"output": tmp_path / "serial"}))
    assert result.results.read_bytes() == serial.results.read_bytes()
    assert run_sweep(settings, scheduler=cluster.address).recorded == 4


def test_a_scheduler_that_is_not_there_is_said(
    vendor: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosimulation.sweep.cluster.CONNECT", 0.5)
    with pytest.raises(SettingsError, match="does not answer"):
        run_sweep(sweeps.vendor_settings(vendor, tmp_path), scheduler="tcp://127.0.0.1:9")
    with pytest.raises(SettingsError, match="does not answer"):
        run_sweep(sweeps.vendor_settings(vendor, tmp_path), scheduler="no address at all")


def test_a_cluster_without_workers_is_said(
    vendor: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from distributed import LocalCluster

    monkeypatch.setattr(job, "PATIENCE", 1.0)
    with (
        LocalCluster(
            n_workers=0, host="127.0.0.1", scheduler_port=0, dashboard_address="127.0.0.1:0"
        ) as empty,
        pytest.raises(SweepError, match="no worker for 1 s"),
    ):
        run_sweep(sweeps.vendor_settings(vendor, tmp_path), scheduler=empty.scheduler_address)
