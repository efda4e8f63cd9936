"""What the documents show is run as it stands."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def blocks(document: str, language: str) -> list[str]:
    text = (ROOT / document).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def run(folder: Path, *command: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    result = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def test_the_python_of_the_readme_runs(tmp_path: Path) -> None:
    (code,) = blocks("README.md", "python")
    assert "contact force at rest: 69.7 N" in run(tmp_path, sys.executable, "-c", code)


def test_the_python_of_the_page_on_fmus_runs(tmp_path: Path) -> None:
    (code,) = blocks("docs/fmus.md", "python")
    assert "contact force at rest: 69.7 N" in run(tmp_path, sys.executable, "-c", code)


def test_the_python_of_the_page_on_the_white_box_model_runs(tmp_path: Path) -> None:
    (code,) = blocks("docs/white_box.md", "python")
    assert run(tmp_path, sys.executable, "-c", code).startswith("2.00 m, standard deviation 0.0")


def test_the_command_lines_and_settings_of_the_documents_run(tmp_path: Path) -> None:
    (tmp_path / "generate.toml").write_text(blocks("docs/settings.md", "toml")[0], encoding="utf-8")
    (tmp_path / "identify.toml").write_text(blocks("docs/settings.md", "toml")[1], encoding="utf-8")
    llmn = [sys.executable, "-m", "cosimulation"]
    run(tmp_path, *llmn, "build", "wbm", "--platform", "linux64")
    lines = [line.split("#")[0].split() for line in blocks("README.md", "sh")[1].splitlines()]
    assert [line[1] for line in lines] == ["generate", "identify", "build"]
    for line in lines:
        run(tmp_path, *llmn, *line[1:])
    found = json.loads(
        run(tmp_path, *llmn, "validate", "my_pantograph.fmu", "--data", "data/test.npz", "--json")
    )
    fits = {item["signal"]: item["fit"] for item in found["scores"]}
    assert fits["F_p"] >= 95.0


def test_the_make_targets_of_the_readme_exist() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    commands = [line.split("#")[0].split() for line in blocks("README.md", "sh")[0].splitlines()]
    assert [command[0] for command in commands] == ["make", "make"]
    for command in commands:
        assert re.search(rf"^{command[1]}:", makefile, re.MULTILINE)


@pytest.mark.parametrize(
    "document",
    sorted(
        path.relative_to(ROOT).as_posix()
        for path in ROOT.glob("**/*.md")
        if not {".venv", "runs"} & set(path.parts)
    ),
)
def test_links_to_files_lead_somewhere(document: str) -> None:
    text = (ROOT / document).read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#]+)\)", text):
        if "://" not in target:
            assert (ROOT / document).parent.joinpath(target).exists(), target


def test_the_readme_names_the_version_of_fmpy_that_is_pinned() -> None:
    pins = (ROOT / "requirements.txt").read_text(encoding="utf-8")
    version = re.search(r"^fmpy==(\S+)", pins, re.MULTILINE)
    assert version is not None
    assert f"fmpy {version[1]}" in (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_wheel_holds_the_packages_and_their_sources_only(tmp_path: Path) -> None:
    source = tmp_path / "source"
    ignored = shutil.ignore_patterns(".venv", ".git", "runs", "*cache*", "__pycache__")
    shutil.copytree(ROOT, source, ignore=ignored)
    command = (
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--no-deps",
        "--no-build-isolation",
        "--no-index",
        "-w",
        ".",
    )
    run(tmp_path, *command, str(source))
    (wheel,) = tmp_path.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    rooms = {name.split("/")[0] for name in names if ".dist-info" not in name}
    assert rooms == {"fmu_builder", "identification", "cosimulation", "fmus"}
    for needed in (
        "fmu_builder/kernel/c/kernel.c",
        "fmu_builder/fmi2/c/slave.c",
        "fmu_builder/freestanding/runtime.c",
        "fmus/wbm/c/wbm_equations.c",
        "fmus/wbm/parameters.json",
        "identification/surrogate/c/output_error.c",
        "cosimulation/c/drive.c",
        "cosimulation/studies/demo.toml",
        "fmus/surrogate/pantograph_surrogate.fmu",
        "fmus/n4sid_blow/parameters.json",
        "fmus/n4sid_blow/README.md",
    ):
        assert needed in names


def test_the_commands_of_the_page_on_sweeps_run(tmp_path: Path) -> None:
    (settings,) = blocks("docs/sweep.md", "toml")
    short = settings.replace("duration = 10.0", "duration = 0.5").replace("seeds = [1, 2, 3]", "seeds = [1]")
    (tmp_path / "sweep.toml").write_text(short, encoding="utf-8")
    (commands,) = blocks("docs/sweep.md", "sh")
    lines = [line.split("#")[0].split()[1:] for line in commands.splitlines()]
    assert [line[0] for line in lines] == ["build", "build", "sweep", "sweep", "sweep"]
    for line in lines:
        only = ["--platform", "linux64"] if line[0] == "build" else []
        told = run(tmp_path, sys.executable, "-m", "cosimulation", *line, *only)
        if "--json" in line:
            found = json.loads(told)
            assert found["runs"] == found["recorded_before"] == found["ok"] == 2 * 2 * 4


def test_the_python_of_the_page_on_lolimot_makes_a_network_that_can_be_built(tmp_path: Path) -> None:
    generate = """
output = "data"
signals = { outputs = { phi_1 = "phi_1" }, units = { phi_1 = "rad" } }
reference = { fmu = "pantograph_wbm.fmu" }
experiments = [{ name = "train", kind = "whole_range", split = "train", duration = 8.0 }]
"""
    (tmp_path / "generate.toml").write_text(generate, encoding="utf-8")
    llmn = [sys.executable, "-m", "cosimulation"]
    run(tmp_path, *llmn, "build", "wbm", "--platform", "linux64")
    run(tmp_path, *llmn, "generate", "generate.toml")
    (code,) = blocks("docs/lolimot.md", "python")
    run(tmp_path, sys.executable, "-c", code)
    run(tmp_path, *llmn, "build", "arm_angle.json", "--platform", "linux64")
    assert (tmp_path / "arm_angle.fmu").is_file()


def test_settings_examples_are_valid_toml() -> None:
    for block in blocks("docs/settings.md", "toml"):
        tomllib.loads(block)
