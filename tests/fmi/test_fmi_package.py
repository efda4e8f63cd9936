"""The FMU file: its bytes, its names, its symbols, and other people's tools on it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import fmpy.fmi2
import numpy as np
import pytest
import ziglang
from fmpy.validation import validate_fmu

from fmi import lti
from fmi.conftest import GUID
from fmi.exports import elf_needs_libraries, elf_symbols, pe_symbols
from fmi.lti import VR
from fmu_builder.compiler import cache_folder, host_platform
from fmu_builder.errors import BuildError, OutputError
from fmu_builder.fmi2 import build_fmu, fmi_headers

# All functions of FMI 2.0.
NAMES = """
GetTypesPlatform GetVersion SetDebugLogging Instantiate FreeInstance SetupExperiment
EnterInitializationMode ExitInitializationMode Terminate Reset GetReal GetInteger GetBoolean
GetString SetReal SetInteger SetBoolean SetString GetFMUstate SetFMUstate FreeFMUstate
SerializedFMUstateSize SerializeFMUstate DeSerializeFMUstate GetDirectionalDerivative
SetRealInputDerivatives GetRealOutputDerivatives DoStep CancelStep GetStatus GetRealStatus
GetIntegerStatus GetBooleanStatus GetStringStatus
EnterEventMode NewDiscreteStates EnterContinuousTimeMode CompletedIntegratorStep SetTime
SetContinuousStates GetDerivatives GetEventIndicators GetContinuousStates GetNominalsOfContinuousStates
"""
PREFIXES = ("one_", "two_")
FUNCTIONS = {"fmi2" + name for name in NAMES.split()}


def test_fmpy_has_nothing_to_say(lti_fmu: Path) -> None:
    assert validate_fmu(str(lti_fmu)) == []


def test_same_bytes_wherever_it_is_built(
    lti_fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fmu_builder.compiler.kept", lambda *_: None)  # compiled anew
    with zipfile.ZipFile(lti_fmu) as archive:
        platforms = sorted({n.split("/")[1] for n in archive.namelist() if n.startswith("binaries/")})
    elsewhere = tmp_path / "with a space" / "tests"
    shutil.copytree(lti.C_FOLDER, elsewhere / "lti_c")
    again = build_fmu(
        lti.INTERFACE,
        lti.MODEL_HASH,
        elsewhere / "lti_c" / "all.c",
        (elsewhere / "lti_c",),
        {},
        tmp_path / "other.fmu",
        platforms,
        {"note.txt": b"x"},
        {"licenses/license.txt": b"MIT\n"},
    )
    assert again.read_bytes() == lti_fmu.read_bytes()


def test_archive(lti_fmu: Path) -> None:
    with zipfile.ZipFile(lti_fmu) as archive:
        entries = archive.infolist()
        included = {n.removeprefix("sources/") for n in archive.namelist() if n.startswith("sources/")}
        contents = b"".join(archive.read(entry) for entry in entries)
    names = [entry.filename for entry in entries]
    assert names[0] == "modelDescription.xml"
    assert names[1:] == sorted(names[1:])
    assert {entry.compress_type for entry in entries} == {zipfile.ZIP_STORED}
    assert {entry.date_time for entry in entries} == {(1980, 1, 1, 0, 0, 0)}
    assert {"documentation/index.html", "documentation/licenses/license.txt", "resources/note.txt"} <= set(
        names
    )
    assert {"all.c", "functions.c", "slave.c", "lti_model.c", "variables.h", "variable_kinds.h"} <= included
    assert not any(name.startswith("fmi2") for name in included)
    assert not any(name.endswith((".pdb", ".lib")) for name in names)
    assert str(Path(__file__).parents[2]).encode() not in contents
    assert b"llmn-build" not in contents


def test_linux_binary_exports_the_fmi_functions_and_needs_the_heap_only(lti_fmu: Path) -> None:
    with zipfile.ZipFile(lti_fmu) as archive:
        content = archive.read("binaries/linux64/lti_test.so")
    assert elf_symbols(content) == (FUNCTIONS, {"calloc", "free"})
    assert not elf_needs_libraries(content)


def test_windows_binary_exports_the_fmi_functions_and_needs_the_kernel_only(lti_fmu: Path) -> None:
    with zipfile.ZipFile(lti_fmu) as archive:
        content = archive.read("binaries/win64/lti_test.dll")
    exported, libraries = pe_symbols(content)
    assert exported == FUNCTIONS
    assert {library.lower() for library in libraries} == {"kernel32.dll"}


def _compile(*arguments: object) -> None:
    """Call a C compiler such as an importer may have, without any of our flags."""
    program = Path(ziglang.__file__).parent / ("zig.exe" if sys.platform == "win32" else "zig")
    cache = str(cache_folder() / "zig")
    caches = {"ZIG_GLOBAL_CACHE_DIR": cache, "ZIG_LOCAL_CACHE_DIR": cache}
    command = [str(program), "cc", f"-I{fmi_headers()}", "-fPIC", *map(str, arguments)]
    subprocess.run(command, check=True, env={**os.environ, **caches})


@pytest.mark.skipif(not host_platform().startswith("linux"), reason="reads ELF and loads what it links")
def test_sources_of_two_fmus_link_into_one_image(lti_fmu: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(lti_fmu) as archive:
        archive.extractall(tmp_path)
    objects = [tmp_path / f"{prefix}.o" for prefix in PREFIXES]
    for prefix, target in zip(PREFIXES, objects, strict=True):
        warnings = ("-Wall", "-Werror", "-Wno-unused-function")
        source = tmp_path / "sources" / "all.c"
        _compile("-O1", *warnings, f"-DFMI2_FUNCTION_PREFIX={prefix}", "-c", source, "-o", target)
    library = tmp_path / "both.so"
    _compile("-shared", "-nostdlib", *objects, "-o", library)
    defined, _ = elf_symbols(library.read_bytes())
    expected = {prefix + name for prefix in PREFIXES for name in FUNCTIONS}
    assert {name for name in defined if "fmi2" in name} == expected


@pytest.mark.skipif(not host_platform().startswith("linux"), reason="links a library for this machine")
def test_sources_compile_by_themselves_to_the_same_behaviour(lti_fmu: Path, tmp_path: Path) -> None:
    own = fmpy.simulate_fmu(str(lti_fmu), stop_time=0.05, output_interval=0.01, start_values={"drive": 2.0})
    with zipfile.ZipFile(lti_fmu) as archive:
        archive.extractall(tmp_path)
    binary = tmp_path / "binaries" / host_platform() / "lti_test.so"
    original = binary.read_bytes()
    _compile("-shared", "-nostdlib", "-O1", tmp_path / "sources" / "all.c", "-o", binary)
    assert binary.read_bytes() != original
    theirs = fmpy.simulate_fmu(
        str(tmp_path), stop_time=0.05, output_interval=0.01, start_values={"drive": 2.0}
    )
    assert np.array_equal(own, theirs)


def test_fmpy_simulates_it(lti_fmu: Path) -> None:
    time = np.array([0.0, 0.02, 0.02, 0.1])
    drive = np.array([1.25, 1.25, 0.5, 0.5])
    signals = np.rec.fromarrays([time, drive], names=["time", "drive"])
    result = fmpy.simulate_fmu(
        str(lti_fmu),
        stop_time=0.1,
        output_interval=0.001,
        input=signals,
        output=["x_1", "mixed"],
        validate=True,
        start_values={"preset": 2},
    )
    assert len(result) == 101
    state = lti.steady_state(lti.START, 3.0)
    assert result["x_1"][0] == state[0]
    assert result["mixed"][0] == 4.0 * state[0] - 5.0 * state[1] + 0.5 * lti.START[1]
    assert result["x_1"][-1] != state[0]


def test_fmpy_slave(lti_fmu: Path, tmp_path: Path) -> None:
    fmpy.extract(str(lti_fmu), str(tmp_path))
    slave = fmpy.fmi2.FMU2Slave(
        guid=GUID, unzipDirectory=str(tmp_path), modelIdentifier="lti_test", instanceName="one"
    )
    slave.instantiate()
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    slave.setReal([VR["drive"]], [0.5])
    slave.doStep(0.0, 0.001)
    expected = lti.tick(lti.steady_state(lti.START), (0.5, lti.START[1]))
    assert slave.getReal([VR["x_1"], VR["x_2"]]) == expected
    state = slave.getFMUstate()
    content = slave.serializeFMUstate(state)
    slave.doStep(0.001, 0.001)
    slave.setFMUstate(slave.deSerializeFMUstate(content))
    assert slave.getReal([VR["x_1"], VR["x_2"]]) == expected
    slave.terminate()
    slave.freeInstance()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"platforms": ["amiga", "vax"]}, "platform amiga"),
        ({"resources": {"../evil": b""}}, "resources/../evil"),
        ({"documentation": {"C:/x": b"", "a\\b": b""}}, "documentation/a\\b"),
        ({"unity": Path("nowhere.c")}, "this C source does not exist"),
        ({"generated": {"unused.h": "int x;"}}, "is generated but all.c does not include it"),
    ],
)
def test_wrong_build_is_refused_and_writes_nothing(
    change: dict[str, object], words: str, tmp_path: Path
) -> None:
    arguments = {
        "unity": lti.C_FOLDER / "all.c",
        "include": (),
        "generated": {},
        "output": tmp_path / "x.fmu",
        "platforms": ["linux64"],
    }
    with pytest.raises(BuildError) as caught:
        build_fmu(lti.INTERFACE, "hash", **(arguments | change))
    assert words in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_c_that_does_not_compile_is_shown(tmp_path: Path) -> None:
    shutil.copytree(lti.C_FOLDER, tmp_path / "c")
    model = tmp_path / "c" / "lti_model.c"
    model.write_text(model.read_text() + "\nstatic int broken(void) { return undeclared_name; }\n")
    with pytest.raises(BuildError) as caught:
        build_fmu(lti.INTERFACE, "h", tmp_path / "c" / "all.c", (), {}, tmp_path / "x.fmu", ["linux64"])
    assert "undeclared_name" in str(caught.value)
    assert "lti_model.c:" in str(caught.value)
    assert "llmn-build" not in str(caught.value)
    assert not (tmp_path / "x.fmu").exists()


def test_output_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError):
        lti.build(tmp_path / "file" / "x.fmu", ["linux64"])
