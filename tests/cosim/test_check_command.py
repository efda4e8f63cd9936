"""`llmn check` as a user types it."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

from cosim.test_command import llmn
from fmi import lti
from fmu_builder.compiler import host_platform


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return lti.build(tmp_path_factory.mktemp("fmu") / "lti_test.fmu", (host_platform(),))


def checked(folder: Path, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    result = llmn(folder, "check", *arguments)
    assert "Traceback" not in result.stderr
    return result


def test_a_clean_fmu_passes(fmu: Path, tmp_path: Path) -> None:
    result = checked(tmp_path, fmu)
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


def test_a_missing_file_is_a_finding(tmp_path: Path) -> None:
    result = checked(tmp_path, "none.fmu")
    assert result.returncode == 1
    assert "there is no such file" in result.stdout
