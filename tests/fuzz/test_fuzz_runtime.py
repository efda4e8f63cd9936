"""Random calls, right and wrong, of the C runtime under sanitizers and valgrind; planted faults are found."""

from __future__ import annotations

import os
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from fuzz import runtime

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="sanitizers of Linux")
FMUS = tuple(runtime.MODELS)


def kind_of(name: str) -> runtime.Kind:
    if name not in runtime.kinds():
        missing(f"a compiler that makes the kind {name!r}: install clang and libclang-rt-dev, or gcc")
    return runtime.kinds()[name]


def missing(what: str) -> None:
    """Skip where people work, fail where changes are judged."""
    (pytest.fail if os.environ.get("CI") == "true" else pytest.skip)(f"needs {what}")


@pytest.fixture
def valgrind() -> None:
    if not (shutil.which("valgrind") and shutil.which("gcc")):
        missing("valgrind and gcc")


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The unpacked FMUs."""
    folder = tmp_path_factory.mktemp("fuzz")
    return {model: runtime.unpacked(model, folder) for model in FMUS}


@pytest.mark.parametrize(
    ("model", "kind", "runs"),
    [
        ("n4sid", "behaviour", 300),
        ("surrogate", "behaviour", 150),
        ("white_box", "behaviour", 200),
        ("surrogate", "memory", 100),
        ("n4sid", "gcc", 300),
    ],
)
def test_random_calls_find_nothing(
    model: str, kind: str, runs: int, fmus: dict[str, Path], tmp_path: Path
) -> None:
    how = kind_of(kind)
    program = runtime.program(how, fmus[model], tmp_path / "fuzz_runtime")
    result = runtime.run(how, program, tmp_path, runs)
    assert result.returncode == 0, result.stderr[-4000:]
    assert f"Done {runs} runs" in result.stderr or f"seed {runs}" in result.stderr


@pytest.mark.usefixtures("valgrind")
@pytest.mark.parametrize("model", FMUS)
def test_nothing_is_found_in_the_binaries_that_are_delivered(
    model: str, fmus: dict[str, Path], tmp_path: Path
) -> None:
    program, binary = (
        runtime.plain_program(fmus[model], tmp_path / "x"),
        runtime.production_binary(fmus[model]),
    )
    for result in (runtime.run_plain(program, binary, 3000), runtime.run_valgrind(program, binary, 25)):
        assert result.returncode == 0, result.stderr[-4000:]


# Fault -> kind of program, C file, what stands there, what is planted, what is said when it is found.
FAULTS: dict[str, tuple[str, str, str, str, str]] = {
    "value reference off by one": (
        "behaviour", "instance.c", "if (vr[k] >= VARIABLE_COUNT)", "if (vr[k] > VARIABLE_COUNT)",
        "out of bounds",
    ),
    "mode missing in a mask": (
        "behaviour", "instance.c", "LEGAL_DoStep = ONLY_CO_SIMULATION | MODE_STEP",
        "LEGAL_DoStep = ONLY_CO_SIMULATION | MODE_STEP | MODE_TERMINATED",
        "DoStep is not allowed after terminate",
    ),
    "right call refused": (
        "behaviour", "instance.c", "LEGAL_Terminate = MODE_RUNNING", "LEGAL_Terminate = MODE_STEP",
        "refuses what is right",
    ),
    "number never written": (
        "memory", "instance.c", "    message_clear(message);\n    if (instance == NULL)",
        "    if (instance == NULL)",
        "use-of-uninitialized-value",
    ),
    "memory not given back": (
        "behaviour", "saved_states.c", "free(*FMUstate);", "", "blocks of memory are not given back",
    ),
    "memory lost that is not counted": (
        "behaviour", "functions.c", "instance->last_step = fmi2OK;\n    instance->slave",
        "{ static void *volatile lost; lost = malloc(24); lost = NULL; }\n    instance->slave",
        "LeakSanitizer: detected memory leaks",
    ),
    "memory that is not there": (
        "behaviour", "functions.c", "(instance = (Instance *)calloc(1, sizeof(Instance))) == NULL",
        "(instance = (Instance *)calloc(1, sizeof(Instance))), 0", "null pointer",
    ),
    "one byte too many": (
        "behaviour", "saved_states.c", "if (size < SNAPSHOT_SIZE)", "if (size + 1 < SNAPSHOT_SIZE)",
        "heap-buffer-overflow",
    ),
    "damage unseen": (
        "behaviour", "snapshot.c", "!= checksum(bytes, size - SNAPSHOT_WORD)", "== 0",
        "took what it must not",
    ),
    "instances share": (
        "behaviour", "slave.c", "slave->latched[k] = slave->values[k];",
        "static int done; slave->latched[k] = slave->values[k] + 1e-9 * ++done;",
        "something outlives a reset",
    ),
    "error with an effect": (
        "behaviour", "functions.c", "if (!instance_accepts(",
        "if (nvr > 1) instance->slave.values[vr[0]] = variable_start[vr[0]];"
        " if (!instance_accepts(", "on a quiet instance",
    ),
    "state half restored": (
        "behaviour", "saved_states.c", "instance->slave = *(const Slave *)FMUstate;",
        "{ const int64_t n = instance->slave.tick; instance->slave = *(const Slave *)FMUstate;"
        " instance->slave.tick = n; }", "fuzz:",
    ),
    "reset half done": (
        "behaviour", "slave.c", "clear_bytes(slave, sizeof *slave);",
        "clear_bytes(&slave->model, sizeof slave->model); slave->model_ready = slave->outputs_ready = 0;",
        "fuzz:",
    ),
    "message without end": (
        "behaviour", "message.c", "message->length + 1 < MESSAGE_CAPACITY",
        "message->length <= MESSAGE_CAPACITY", "runtime error: index 512 out of bounds",
    ),
}  # fmt: skip


def planted(fmu: Path, folder: Path, name: str, old: str, new: str) -> Path:
    """A copy of an unpacked FMU with a fault in its sources."""
    copy = folder / "faulty"
    shutil.copytree(fmu, copy)
    source = copy / "sources" / name
    text = source.read_text(encoding="utf-8")
    assert text.count(old) >= 1, f"{name} has changed: {old!r} is not there"
    source.write_text(text.replace(old, new), encoding="utf-8")
    return copy


def quickly(kind: runtime.Kind) -> runtime.Kind:
    return replace(kind, optimised="-O0")


@pytest.fixture(scope="module")
def drivers(fmus: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The driver for n4sid by kind: the same for all faults."""
    folder = tmp_path_factory.mktemp("drivers")
    return {
        name: runtime.driver_object(quickly(kind), fmus["n4sid"], folder / f"{name}.o")
        for name, kind in runtime.kinds().items()
    }


@pytest.mark.parametrize("fault", FAULTS)
def test_a_planted_fault_is_found(
    fault: str, fmus: dict[str, Path], drivers: dict[str, Path], tmp_path: Path
) -> None:
    kind, name, old, new, said = FAULTS[fault]
    how = quickly(kind_of(kind))
    faulty = planted(fmus["n4sid"], tmp_path, name, old, new)
    program = runtime.program(how, faulty, tmp_path / "fuzz_runtime", drivers[kind])
    result = runtime.run(how, program, tmp_path, 4000)
    assert result.returncode != 0
    assert said in result.stderr, result.stderr[-4000:]


@pytest.mark.usefixtures("valgrind")
@pytest.mark.parametrize(
    ("name", "old", "new", "said"),
    [
        ("message.c", "message->length = 0;", "", "uninitialised value"),
        ("snapshot.c", "at < sizeof(Slave)", "at <= sizeof(Slave)", "Invalid read of size"),
        ("saved_states.c", "free(*FMUstate);", "", "definitely lost"),
    ],
)
def test_valgrind_finds_a_planted_fault(
    name: str, old: str, new: str, said: str, fmus: dict[str, Path], tmp_path: Path
) -> None:
    """Compiled as it is delivered."""
    faulty = planted(fmus["n4sid"], tmp_path, name, old, new)
    program = runtime.plain_program(faulty, tmp_path / "fuzz_runtime")
    result = runtime.run_valgrind(program, runtime.recompiled(faulty), 15)
    assert result.returncode == 9, result.stderr[-4000:]
    assert said in result.stderr, result.stderr[-4000:]
