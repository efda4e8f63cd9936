"""The command as a user types it: bad input gets one clear message, status 1, and nothing half-written."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from cosim.whole_path import WholePath
from fmu_builder.compiler import host_platform
from fmu_builder.parameter_set import load
from identification.data_set import DataSet

LLMN = [sys.executable, "-m", "cosimulation"]
ROOT = Path(__file__).resolve().parents[2]


def llmn(folder: Path, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "200"}
    return subprocess.run(
        [*LLMN, *map(str, arguments)],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
    )


def refused(folder: Path, *arguments: str | Path) -> str:
    """Run a command that must fail with a message and leave the folder as it was."""
    before = sorted(path.relative_to(folder) for path in folder.rglob("*"))
    result = llmn(folder, *arguments)
    assert result.returncode == 1, result.stdout + result.stderr
    assert "Traceback" not in result.stderr
    assert any(line.startswith("llmn: ") for line in result.stderr.splitlines())
    assert sorted(path.relative_to(folder) for path in folder.rglob("*")) == before
    return result.stderr


def settings(folder: Path, text: str) -> Path:
    path = folder / "run.toml"
    path.write_text(text, encoding="utf-8")
    return path


def recorded(path: Path, rows: int = 50, change: str | None = None) -> Path:
    """A CSV with the pantograph's columns; `change` replaces one cell or line."""
    lines = ["time [s],eta [m],M_pa [N.m],xi [m]"]
    lines += [f"{row * 0.001:.3f},{1.5 + 0.001 * row},1310.9,{1.5007 + 0.001 * row}" for row in range(rows)]
    if change == "NaN":
        lines[10] = "0.009,nan,1310.9,1.5"
    elif change == "missing":
        lines[10] = "0.009,,1310.9,1.5"
    elif change == "gap":
        del lines[10:20]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_a_misspelt_key_is_named_with_the_right_one(tmp_path: Path) -> None:
    text = refused(tmp_path, "generate", settings(tmp_path, "[reference]\nfmus = 'x.fmu'\n"))
    assert "reference.fmus" in text
    assert "'fmu'" in text


@pytest.mark.parametrize(("change", "word"), [("NaN", "'eta'"), ("missing", "eta"), ("gap", "uniformly")])
def test_a_recording_with_a_fault_is_placed(blow: WholePath, tmp_path: Path, change: str, word: str) -> None:
    data = recorded(tmp_path / "recorded.csv", change=change)
    text = refused(tmp_path, "validate", blow.fmus["pantograph_n4sid_blow"], "--data", data)
    assert "recorded.csv" in text
    assert word in text


def test_a_mapped_signal_that_the_fmu_lacks_is_named(blow: WholePath, tmp_path: Path) -> None:
    text = f"""
[reference]
fmu = '{blow.white_box}'
[signals]
inputs = {{ eta = "etta", M_pa = "M_pa" }}
outputs = {{ xi = "panhead" }}
[[experiments]]
name = "a"
kind = "whole_range"
split = "train"
duration = 1.0
"""
    message = refused(tmp_path, "generate", settings(tmp_path, text), "--output", tmp_path / "data")
    assert "'etta'" in message
    assert "'eta'" in message


@pytest.mark.parametrize("fault", ["cut", "garbage"])
def test_a_broken_fmu_is_refused(blow: WholePath, tmp_path: Path, fault: str) -> None:
    whole = blow.white_box.read_bytes()
    path = tmp_path / "broken.fmu"
    path.write_bytes(whole[: len(whole) // 2] if fault == "cut" else b"not an archive")
    text = refused(tmp_path, "validate", path, "--data", recorded(tmp_path / "recorded.csv"))
    assert "broken.fmu" in text
    assert "not a readable FMU archive" in text


def test_a_parameter_set_with_several_faults_names_them_all(blow: WholePath, tmp_path: Path) -> None:
    content = json.loads(blow.candidates["pantograph_n4sid_blow"].parameter_set.canonical_json())
    content["local_models"][1]["A"][0][0] = float("nan")
    content["local_models"][2]["B"] = content["local_models"][2]["B"][:-1]
    content["unknown"] = 1
    path = tmp_path / "bad.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    text = refused(tmp_path, "build", path)
    assert "local_models[1].A" in text
    assert "local_models[2].B" in text
    assert "unknown" in text


def test_a_height_out_of_reach_is_refused_with_the_height(blow: WholePath, tmp_path: Path) -> None:
    text = f"""
[reference]
fmu = '{blow.white_box}'
[[experiments]]
name = "too_high"
kind = "operating_point"
split = "train"
height = 4.5
duration = 1.0
"""
    message = refused(tmp_path, "generate", settings(tmp_path, text), "--output", tmp_path / "data")
    assert "eta = 4.49" in message
    assert "out of reach" in message


def test_an_output_that_cannot_be_written_is_named(blow: WholePath, tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("a file where a folder should be", encoding="utf-8")
    path = tmp_path / "model.json"
    blow.candidates["pantograph_n4sid_blow"].parameter_set.save(path)
    text = refused(tmp_path, "build", path, "--output", blocked / "model.fmu", "--platform", "linux64")
    assert str(blocked) in text


def test_demo_refuses_an_output_it_cannot_write(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("a file where a folder should be", encoding="utf-8")
    assert str(blocked) in refused(tmp_path, "demo", "--quick", "--output", blocked / "demo")


def test_control_c_leaves_nothing_half_written(tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        [*LLMN, "demo", "--platform", host_platform()],
        cwd=tmp_path,
        env=environment,
        stderr=subprocess.PIPE,
        text=True,
        # a test run in the background of a script ignores the signal, and its children would, too
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert process.stderr is not None
    for line in process.stderr:
        if line.startswith("reference data"):
            break
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    rest = process.stderr.read()
    assert process.wait(timeout=60) == 130
    assert "Traceback" not in rest
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


def test_generate_identify_build_validate_in_a_row(blow: WholePath, tmp_path: Path) -> None:
    heights = {"op25": 0.75, "op45": 1.25, "op65": 1.75, "op85": 2.25}
    text = f"[reference]\nfmu = '{blow.white_box}'\nstart_values = {{ preset = 'Blow' }}\n"
    for name, height in heights.items():
        text += f"[[experiments]]\nname = '{name}'\nkind = 'operating_point'\nsplit = 'train'\n"
        text += f"height = {height}\nduration = 15.0\n"
    text += "[[experiments]]\nname = 'wr'\nkind = 'whole_range'\nsplit = 'test'\nduration = 20.0\n"
    (tmp_path / "generate.toml").write_text(text, encoding="utf-8")
    (tmp_path / "identify.toml").write_text(
        "name = 'mine'\n[head]\nm_C = 5.419\nk_C = 6724.0\nc_C = 29.21\n", encoding="utf-8"
    )
    for command in (
        ["generate", "generate.toml", "--output", "data"],
        ["identify", "identify.toml", "--data", "data"],
        ["build", "mine.json", "--platform", "linux64"],
        ["validate", "mine.fmu", "--data", "data/wr.npz", "--json"],
    ):
        result = llmn(tmp_path, *command)
        assert result.returncode == 0, result.stderr
    scores = {item["signal"]: item["fit"] for item in json.loads(result.stdout)["scores"]}
    assert scores["F_p"] >= 95.0
    assert load(tmp_path / "mine.json").provenance["origin"]["reference"]["sha256"]


def test_a_recording_stands_in_for_an_fmu(blow: WholePath, tmp_path: Path) -> None:
    """A user's own names and files: CSV and .npz, static map by regression."""
    renamed = {
        "eta": "wire",
        "M_pa": "drive",
        "xi": "head",
        "xi_dot": "head_v",
        "zeta": "bar",
        "zeta_dot": "bar_v",
    }
    text = "[signals]\n"
    text += "inputs = { eta = 'wire', M_pa = 'drive' }\n"
    text += "outputs = { xi = 'head', xi_dot = 'head_v', zeta = 'bar', zeta_dot = 'bar_v' }\n"
    for index, item in enumerate(blow.data.experiments):
        if item.split != "train":
            continue
        data = item.data.select(renamed)
        data = DataSet(item.name, data.sample_time, tuple(renamed.values()), data.units, data.values)
        file = tmp_path / f"{item.name}{'.csv' if index == 0 else '.npz'}"
        data.save(file)
        text += (
            f"[[experiments]]\nname = '{item.name}'\nkind = '{item.kind}'\nsplit = 'train'\nfile = '{file}'\n"
        )
        text += f"height = {item.height}\n" if item.height else ""
    result = llmn(tmp_path, "generate", settings(tmp_path, text), "--output", "data")
    assert result.returncode == 0, result.stderr
    (tmp_path / "identify.toml").write_text("[head]\nm_C=5.419\nk_C=6724.0\nc_C=29.21\n", encoding="utf-8")
    result = llmn(tmp_path, "identify", "identify.toml", "--data", "data", "--json")
    assert result.returncode == 0, result.stderr
    found = load(tmp_path / "pantograph_n4sid.json")
    table = found.offsets.static_map
    assert table is not None
    reference = blow.data.static_map
    assert reference is not None
    rest = reference.select(("xi", "zeta")).at(np.array(table.positions))
    assert np.abs(np.array(table.values)[:, [0, 2]] - rest).max() < 2e-3  # metres: regression under noise


def test_validate_compares_two_fmus_on_the_same_inputs(blow: WholePath, tmp_path: Path) -> None:
    data = blow.data.select("whole_range", "test")[0].data.select(("eta", "M_pa")).rows(0, 5000)
    data.save(tmp_path / "inputs.npz")
    model = blow.fmus["pantograph_n4sid_blow"]
    options = ("--reference", blow.white_box, "--start", "preset=Blow", "--json")
    result = llmn(tmp_path, "validate", model, "--data", "inputs.npz", *options)
    assert result.returncode == 0, result.stderr
    fits = {item["signal"]: item["fit"] for item in json.loads(result.stdout)["scores"]}
    assert fits["F_p"] >= 95.0
    other = llmn(tmp_path, "validate", model, "--data", "inputs.npz", *options[:2], "--json")
    assert json.loads(other.stdout)["scores"] != json.loads(result.stdout)["scores"]  # preset A


def test_the_version_is_printed(tmp_path: Path) -> None:
    assert llmn(tmp_path, "--version").stdout.strip() == metadata.version("pantograph-llmn")


def test_the_command_computes_on_one_thread_unless_told_otherwise() -> None:
    """numpy reads the variables when it is loaded, so nothing may load it before they are set."""
    script = (
        "import sys, os, cosimulation.cli as cli\n"
        "assert 'numpy' not in sys.modules\n"
        "cli.app = lambda: print(os.environ['OPENBLAS_NUM_THREADS'], os.environ['OMP_NUM_THREADS'])\n"
        "cli.main()"
    )
    env = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")} | {"OMP_NUM_THREADS": "3"}
    result = subprocess.run(
        [sys.executable, "-c", script], env=env | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True
    )
    assert result.stdout.split() == ["1", "3"], result.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_behind_the_output_is_one_message(tmp_path: Path) -> None:
    with open("/dev/full", "w", encoding="utf-8") as full:
        result = subprocess.run(
            [*LLMN, "--version"],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
        )
    assert result.returncode == 1
    assert "Traceback" not in result.stderr
    assert "No space left" in result.stderr


def test_data_that_do_not_fit_into_memory_are_one_message(blow: WholePath, tmp_path: Path) -> None:
    text = f"[reference]\nfmu = '{blow.white_box}'\n[[experiments]]\nname = 'a'\nkind = 'whole_range'\n"
    text += "split = 'train'\nduration = 1e14\n"
    assert "memory" in refused(tmp_path, "generate", settings(tmp_path, text), "--output", tmp_path / "data")
