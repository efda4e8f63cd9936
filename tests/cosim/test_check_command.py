"""`llmn check` as a user types it."""

from __future__ import annotations

import dataclasses
import json
import re
import subprocess
from pathlib import Path

import pytest

from cosim.test_command import llmn
from fmi import lti
from fmu_builder.compiler import host_platform

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "check.md"


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return lti.build(tmp_path_factory.mktemp("fmu") / "lti_test.fmu", (host_platform(),))


def checked(folder: Path, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    result = llmn(folder, "check", *arguments)
    assert "Traceback" not in result.stderr
    return result


def test_a_clean_fmu_passes(fmu: Path, tmp_path: Path) -> None:
    result = checked(tmp_path, "--time-limit", "600", fmu)
    assert result.returncode == 0, result.stdout
    assert result.stdout.startswith("lti_test.fmu: 0 errors, 0 warnings, 0 notes; checked: archive")
    assert list(tmp_path.iterdir()) == []


def test_an_error_is_exit_status_1_and_json_says_it_all(fmu: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken.fmu"
    broken.write_bytes(fmu.read_bytes()[:-300])
    result = checked(tmp_path, "--json", "--static", fmu, broken)
    assert result.returncode == 1
    assert result.stderr == ""
    found = json.loads(result.stdout)
    assert [report["passed"] for report in found["reports"]] == [True, False]
    assert found["passed"] is False
    (item,) = found["reports"][1]["findings"]
    assert set(item) == {"severity", "rule", "place", "what", "paragraph", "mend"}
    assert item["severity"] == "error"


def test_the_command_lines_of_the_document_run(fmu: Path, tmp_path: Path) -> None:
    (block,) = re.findall(
        r"^```sh\n(.*?)^```", DOCUMENT.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    )
    lines = [line.split("#")[0].split() for line in block.splitlines()]
    names = {word for line in lines for word in line if word.endswith(".fmu")}
    for name in names:
        interface = dataclasses.replace(lti.INTERFACE, model_identifier=name.removesuffix(".fmu"))
        lti.build(tmp_path / name, (host_platform(),), interface=interface)
    assert len(lines) == 4 and len(names) == 2
    for program, command, *arguments in lines:
        assert (program, command) == ("llmn", "check")
        result = checked(tmp_path, "--time-limit", "600", *arguments)
        assert result.returncode == 0, result.stdout
    assert "one image" in result.stdout.splitlines()[-1]


def test_a_missing_file_is_a_finding(tmp_path: Path) -> None:
    result = checked(tmp_path, "none.fmu")
    assert result.returncode == 1
    assert "there is no such FMU file" in result.stdout
