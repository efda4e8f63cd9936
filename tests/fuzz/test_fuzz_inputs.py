"""Damaged archives, descriptions, binaries, parameter sets: messages only, nothing left, nothing outside."""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
from pathlib import Path
from typing import Any

import networks
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fmi import lti
from fmu_builder.compiler import host_platform
from fmu_builder.errors import LlmnError
from fmu_builder.parameter_set import ParameterSet
from fuzz import archives, texts
from fuzz.archives import entries_of, packed

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="limits of memory are those of Unix")
ROOT = Path(__file__).resolve().parents[2]
TESTS = ROOT / "tests"


def watched(*words: str) -> subprocess.CompletedProcess[str]:
    paths = os.pathsep.join((str(ROOT), str(TESTS)))
    environment = {
        **os.environ,
        "PYTHONPATH": paths,
        "PYTHONDONTWRITEBYTECODE": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
    command = [sys.executable, "-m", *words]
    return subprocess.run(
        command, env=environment, capture_output=True, text=True, errors="replace", timeout=900
    )


@pytest.mark.parametrize(
    ("kind", "count"), [("archives", 120), ("descriptions", 100), ("binaries", 100), ("parameters", 250)]
)
def test_damage_gives_messages_only(kind: str, count: int, tmp_path: Path) -> None:
    result = watched("fuzz.inputs", kind, "--folder", str(tmp_path), "--count", str(count))
    assert result.returncode == 0, result.stdout[-6000:] + result.stderr[-3000:]
    assert f"{kind}: {count} cases" in result.stdout


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("crash", "IndexError: planted"),
        ("write_outside", "written outside"),
        ("write_outside_unheard", "left behind"),
        ("leave_behind", "left behind"),
        ("hang", "Timeout"),
        ("use_memory", "MemoryError"),
        ("speak_to_the_terminal", "steer a terminal"),
        ("change_the_file", "the file itself was changed"),
    ],
)
def test_a_planted_fault_of_the_commands_is_found(fault: str, said: str, tmp_path: Path) -> None:
    result = watched("fuzz.faulty_inputs", fault, str(tmp_path / "sandbox"))
    assert result.returncode != 0
    assert said in result.stdout + result.stderr, result.stdout + result.stderr


def test_the_whole_check_of_damaged_files_in_a_process_of_its_own(tmp_path: Path) -> None:
    """Binaries and all: what crashes or hangs is a finding about the FMU, not an end of the command."""
    fmu = lti.build(tmp_path / "lti_test.fmu", (host_platform(),))
    content = archives.content_of(fmu)
    fmu.unlink()
    binary = next(name for name in content if name.startswith("binaries/"))
    draw = random.Random(5)
    description = texts.damaged_xml(content["modelDescription.xml"].decode(), draw)
    broken = bytearray(content[binary])
    broken[len(broken) // 3 : len(broken) // 2] = draw.randbytes(len(broken) // 2 - len(broken) // 3)
    cases = {
        "description": {**content, "modelDescription.xml": description},
        "binary": {**content, binary: bytes(broken)},
        "source": {**content, "sources/all.c": b"int x(" + draw.randbytes(99)},
    }
    for name, entries in cases.items():
        case = tmp_path / f"{name}.fmu"
        case.write_bytes(packed(entries_of(entries)))
        result = watched("cosimulation", "check", "--json", "--time-limit", "5", str(case))
        assert result.returncode == 1 and "Traceback" not in result.stderr, result.stderr[-3000:]
        assert not json.loads(result.stdout)["passed"]
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"{name}.fmu" for name in sorted(cases)]


SET: dict[str, Any] = json.loads(networks.network(3, "affine", "parameter", "hat").canonical_json())
json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)


@settings(max_examples=100, deadline=None)
@given(data=st.data(), value=json_values)
def test_any_value_in_any_place_of_a_parameter_set_is_taken_or_refused(
    data: st.DataObject, value: Any
) -> None:
    content = json.loads(json.dumps(SET))
    container, steps = content, data.draw(st.integers(1, 5))
    for _ in range(steps):
        keys = sorted(container) if isinstance(container, dict) else range(len(container))
        if not keys:
            break
        key = data.draw(st.sampled_from(keys))
        last, container = container, container[key]
        if not isinstance(container, dict | list):
            break
    last[key] = value
    try:
        ParameterSet(**content)
    except LlmnError as refused:
        assert all(problem.place and problem.what and problem.mend for problem in refused.problems)
