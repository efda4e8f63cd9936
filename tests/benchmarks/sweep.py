"""What reuse of instances gains, and whether a sweep bears kills. Run: python -m tests.benchmarks.sweep

With --quick it takes a fraction of the time. The first part times the same runs three ways on one
processor: a worker that resets its instance, a new instance per run, one call of fmpy's `simulate_fmu` per
run on the archive. The second starts a sweep of 500 runs, kills its whole process group with SIGKILL at 20
random points, lets it end, and compares the table with that of an undisturbed sweep, byte for byte.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from fmpy import simulate_fmu

from cosimulation.settings import load_settings
from cosimulation.sweep import SweepSettings
from cosimulation.sweep.bench import open_bench
from cosimulation.sweep.plan import Bench, Run, runs_of
from cosimulation.sweep.worker import Workbench
from fmu_builder.compiler import host_platform
from fmus.wbm import build_wbm

LEAST_RATIO = 5.0  # reuse of an instance against one simulate_fmu call per run
KILLS = 20
SETTINGS = """
output = "{folder}/sweep"
processes = 2
chunk_rows = 10000
seeds = {seeds}
outputs = ["F_p"]
reference = {{ fmu = "{fmu}", start_values = {{ preset = 4 }} }}
models = [{{ fmu = "{fmu}", start_values = {{ preset = 4 }} }}]

[[signals]]
name = "middle"
kind = "operating_point"
height = 1.5
duration = {duration}

[[parameters]]
name = "{parameter}"
low = {low}
high = {high}
"""


def settings_file(folder: Path, fmu: Path, seeds: int, duration: float) -> Path:
    """Write the settings of a sweep over a parameter and seeds; every seed has a run of the reference."""
    values = {"folder": folder, "fmu": fmu, "seeds": list(range(seeds)), "duration": duration}
    text = SETTINGS.format(**values, parameter="k_C", low=5e3, high=8e3)
    file = folder / "sweep.toml"
    file.write_text(text, encoding="utf-8")
    return file


def reused(bench: Bench, runs: list[Run]) -> float:
    """Seconds per run of a worker."""
    workbench = Workbench(bench)
    workbench.row(runs[0])  # unpacks
    workbench.row(runs[1])  # tries whether a reset is as good as a new instance
    begin = time.perf_counter()
    rows = [workbench.row(run) for run in runs[2:]]
    seconds = time.perf_counter() - begin
    workbench.close()
    if any(row["status"] != "ok" for row in rows):
        raise RuntimeError(rows)
    return seconds / len(rows)


def by_fmpy(bench: Bench, runs: list[Run]) -> float:
    """Seconds per run of `simulate_fmu` on the archive, inputs given and outputs recorded every sample."""
    total = 0.0
    for run in runs:
        model, data = bench.models[run.model], bench.signals[run.signal].data(run.seed)
        table = np.zeros(len(data), dtype=[("time", float), ("eta", float), ("M_pa", float)])
        table["time"] = data.time
        table["eta"], table["M_pa"] = data.values.T
        start = {**model.settings.start_values, **run.parameters}
        begin = time.perf_counter()
        simulate_fmu(
            str(model.archive),
            stop_time=float(data.time[-1]),
            step_size=data.sample_time,
            output_interval=data.sample_time,
            input=table,
            output=["F_p"],
            start_values=start,
        )
        total += time.perf_counter() - begin
    return total / len(runs)


def reuse(folder: Path, fmu: Path, duration: float, count: int) -> bool:
    """Print a line on runs of one length; whether the limit is kept."""
    settings, bench = open_bench(
        load_settings(SweepSettings, settings_file(folder, fmu, count, duration)).model_copy(
            update={"reference": None, "outputs": ()}
        )
    )
    runs = runs_of(settings, bench)
    ours, theirs = reused(bench, runs), by_fmpy(bench, runs[: max(3, count // 10)])
    alone = bench.models[0].settings.model_copy(update={"reuse": False})
    new = reused(replace(bench, models=(replace(bench.models[0], settings=alone),)), runs)
    kept = theirs / ours >= LEAST_RATIO
    print(
        f"{'pass' if kept else 'FAIL'}  runs of {duration:g} s: {1e3 * ours:.2f} ms with one instance reset,"
        f" {1e3 * new:.2f} ms with a new one each, {1e3 * theirs:.1f} ms by simulate_fmu each:"
        f" {theirs / ours:.1f} times faster (at least {LEAST_RATIO:g})",
        flush=True,
    )
    return kept


def command(file: Path) -> list[str]:
    return [sys.executable, "-m", "cosimulation", "sweep", str(file), "--json"]


def recorded(folder: Path) -> list[str]:
    """Return the tasks in all parts, as often as they stand there."""
    parts = sorted((folder / "parts").glob("part-*.parquet"))
    return [task for part in parts for task in pq.read_table(part)["task"].to_pylist()]


def killed(folder: Path, fmu: Path, runs: int, kills: int, duration: float) -> bool:
    """Print a line on a sweep that is killed again and again; whether it ends as an undisturbed one does."""
    file, chance = settings_file(folder, fmu, runs, duration), random.Random(2)
    seconds = []
    for _ in range(2):  # the second time there is nothing to do: what starting alone takes
        begin = time.monotonic()
        subprocess.run(command(file), check=True, capture_output=True)
        seconds.append(time.monotonic() - begin)
    whole, start = seconds
    (folder / "sweep").rename(folder / "undisturbed")
    counts: list[int] = []
    twice, parts = 0, folder / "sweep" / "parts"
    for kill in range(kills):
        process = subprocess.Popen(command(file), start_new_session=True, stdout=subprocess.DEVNULL)
        if kill % 2:  # while results are written
            wanted = len(list(parts.glob("part-*"))) + chance.randint(1, 3)
            while process.poll() is None and len(list(parts.glob("part-*"))) < wanted:
                time.sleep(0.01)
            time.sleep(chance.uniform(0.0, 0.3))
        else:  # at any time of its start
            time.sleep(chance.uniform(0.0, start))
        if process.poll() is not None:
            break
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        stored = recorded(folder / "sweep")
        counts.append(len(set(stored)))
        twice += len(stored) - len(set(stored))
    subprocess.run(command(file), check=True, capture_output=True)
    tables = [(folder / name / "results.parquet").read_bytes() for name in ("sweep", "undisturbed")]
    same = tables[0] == tables[1]
    kept = same and len(counts) == kills and not twice and counts == sorted(counts)
    print(
        f"{'pass' if kept else 'FAIL'}  sweep of {runs} runs of {duration:g} s, killed {len(counts)} times:"
        f" the table is {'the same' if same else 'ANOTHER'} byte for byte; recorded after each kill"
        f" {', '.join(map(str, counts))}; recorded twice: {twice}; undisturbed it takes {whole:.1f} s",
        flush=True,
    )
    return kept


def main(quick: bool) -> int:
    """Print a line per claim; 1 when one does not hold."""
    with tempfile.TemporaryDirectory(prefix="llmn-sweep-") as name:
        folder = Path(name)
        fmu = build_wbm(folder / "pantograph_wbm.fmu", (host_platform(),))
        lengths = ((0.1, 200), (1.0, 60)) if quick else ((0.1, 500), (1.0, 100), (10.0, 20))
        kept = [reuse(folder, fmu, duration, count) for duration, count in lengths]
        kept.append(killed(folder, fmu, *((100, 4, 4.0) if quick else (500, KILLS, 20.0))))
    return int(not all(kept))


if __name__ == "__main__":
    sys.exit(main("--quick" in sys.argv[1:]))
