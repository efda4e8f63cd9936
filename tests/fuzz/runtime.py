"""The C runtime under sanitizers: FMUs to fuzz, the driver compiled with their sources, and runs of it.

`fuzz/c/fuzz_runtime.c` says what a run does. clang brings libFuzzer; without it gcc draws bytes from seeds.
"""

from __future__ import annotations

import functools
import os
import random
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import networks
import theta_networks

from fmu_builder.compiler import compile_shared_library
from fmu_builder.fmi2 import fmi_headers
from fmu_builder.llmn_fmu import build_llmn
from fmus.wbm import build_wbm

DRIVER = Path(__file__).parent / "c" / "fuzz_runtime.c"
CORPUS = Path(__file__).parent / "corpus"
"""Bytes that once found something; every run begins with them."""

_PLATFORM = "linux64"
_LARGEST_INPUT = 600
_TIME_LIMIT = 900.0  # s, of a compiler or of a short run

MODELS: Mapping[str, Callable[[Path], Path]] = {
    "n4sid": lambda path: build_llmn(networks.network(1, "affine", "output", "gaussian"), path, (_PLATFORM,)),
    "surrogate": lambda path: build_llmn(
        theta_networks.theta_network("chain9", gain=0.3, uneven=150.0), path, (_PLATFORM,)
    ),
    "white_box": lambda path: build_wbm(path, (_PLATFORM,)),
}
"""Name -> what builds it: every C file of the product is in one of them."""

_ERRORS = ("-fno-sanitize-recover=all", "-fno-omit-frame-pointer", "-ffp-contract=off", "-g")
_BEHAVIOUR = "address,undefined,float-cast-overflow"


@dataclass(frozen=True)
class Kind:
    """One way to compile the driver.

    Attributes:
        compiler: The program.
        flags: Beside those all have.
        optimised: By compilers' -O; without it a program is made in a third of the time.
        fuzzer: libFuzzer chooses the bytes; otherwise they are drawn from seeds.
    """

    compiler: str
    flags: tuple[str, ...]
    fuzzer: bool
    optimised: str = "-O1"


def _links(compiler: str, flags: Sequence[str]) -> bool:
    """Whether a program can be made with these flags: the sanitizers may not be installed."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "empty.c"
        source.write_text(
            "int LLVMFuzzerTestOneInput(const char *b, unsigned long n) { return b && n && 0; }\n"
        )
        text = [compiler, *flags, str(source), "-o", f"{folder}/empty"]
        if not any("fuzzer" in flag for flag in flags):
            text.append("-DLLVMFuzzerTestOneInput=main_of_it")
            source.write_text("int main(void) { return 0; }\n")
        return subprocess.run(text, capture_output=True, timeout=_TIME_LIMIT).returncode == 0


def _clangs() -> list[str]:
    names = ("clang", *(f"clang-{version}" for version in range(30, 10, -1)))
    return [name for name in names if shutil.which(name)]


@functools.cache
def kinds() -> Mapping[str, Kind]:
    """Return what can be compiled here.

    "behaviour" finds wrong addresses, undefined behaviour and leaks, "memory" what is read and was never
    written, "gcc" is behaviour by another compiler.
    """
    found = {}
    for name, sanitizers in (("behaviour", _BEHAVIOUR), ("memory", "memory")):
        flags = (f"-fsanitize=fuzzer,{sanitizers}",)
        compiler = next((one for one in _clangs() if _links(one, flags)), None)
        if compiler is not None:
            found[name] = Kind(compiler, flags, True)
    flags = (f"-fsanitize={_BEHAVIOUR}",)
    if shutil.which("gcc") and _links("gcc", flags):
        found["gcc"] = Kind("gcc", (*flags, "-DFUZZ_MAIN"), False, "-O0")
    return found


def unpacked(model: str, folder: Path) -> Path:
    """Build an FMU of `MODELS` and return the folder with its parts."""
    path = MODELS[model](folder / f"{model}.fmu")
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder / model)
    return folder / model


def _run(command: Sequence[str], **options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command, capture_output=True, text=True, errors="replace", timeout=_TIME_LIMIT, **options
    )


def _compiled(command: Sequence[str], output: Path) -> Path:
    result = _run([*command, "-o", str(output)])
    assert result.returncode == 0, result.stderr
    return output


def driver_object(kind: Kind, fmu: Path, output: Path) -> Path:
    """Compile the driver alone; it knows the variables of one FMU, not its functions."""
    common = (
        *_ERRORS,
        kind.optimised,
        *kind.flags,
        "-std=c11",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-Wno-missing-field-initializers",
    )
    include = (f"-I{fmu / 'sources'}", "-isystem", str(fmi_headers()))
    return _compiled([kind.compiler, *common, *include, "-c", str(DRIVER)], output)


def program(kind: Kind, fmu: Path, output: Path, driver: Path | None = None) -> Path:
    """Compile an FMU's sources with the driver.

    Args:
        kind: How.
        fmu: Folder of the unpacked FMU.
        output: The program.
        driver: From `driver_object`, where several FMUs share their variables.
    """
    driver = driver or driver_object(kind, fmu, output.with_suffix(".driver.o"))
    heap = ("-std=c99", "-Dcalloc=fuzz_calloc", "-Dfree=fuzz_free")
    source = ("-isystem", str(fmi_headers()), "-c", str(fmu / "sources" / "all.c"))
    runtime = _compiled(
        [kind.compiler, *_ERRORS, kind.optimised, *kind.flags, *heap, *source], output.with_suffix(".o")
    )
    return _compiled(
        [kind.compiler, *_ERRORS, kind.optimised, *kind.flags, str(driver), str(runtime), "-lm"], output
    )


def plain_program(fmu: Path, output: Path) -> Path:
    """Compile the driver without sanitizers, for a binary that FUZZ_LIBRARY names."""
    flags = ("-g", "-O1", "-std=gnu11", "-DFUZZ_MAIN", "-DFUZZ_LIBRARY", f"-I{fmu / 'sources'}")
    command = ["gcc", *flags, "-isystem", str(fmi_headers()), str(DRIVER), "-lm", "-ldl"]
    return _compiled(command, output)


def production_binary(fmu: Path) -> Path:
    """Return the binary an importer loads."""
    return next((fmu / "binaries" / _PLATFORM).glob("*.so"))


def recompiled(fmu: Path) -> Path:
    """Compile the sources of an unpacked FMU as the product does and return the binary."""
    binary = production_binary(fmu)
    sources = fmu / "sources"
    compile_shared_library(sources / "all.c", binary, _PLATFORM, (sources,), system_include=(fmi_headers(),))
    return binary


def seed_folder(folder: Path, count: int = 40) -> Path:
    """Return a folder with the regression corpus and `count` drawn inputs, which reach deep at once."""
    folder.mkdir(parents=True, exist_ok=True)
    for path in CORPUS.glob("*.bin"):
        shutil.copy(path, folder)
    for seed in range(count):
        (folder / f"drawn-{seed:03}").write_bytes(random.Random(seed).randbytes(_LARGEST_INPUT))
    return folder


def libfuzzer_command(
    program_file: Path, corpus: Path, artifacts: Path, runs: int = -1, seconds: int = 0
) -> list[str]:
    """Return the command of a run of libFuzzer that ends after `runs` inputs, or `seconds` if not 0."""
    return [
        *(str(program_file), f"-runs={runs}", "-seed=1", f"-max_len={_LARGEST_INPUT}", "-len_control=0"),
        *(f"-max_total_time={seconds}", "-timeout=60", "-rss_limit_mb=2048", "-print_final_stats=1"),
        *(f"-artifact_prefix={artifacts}{os.sep}", str(corpus)),
    ]


def run(kind: Kind, program_file: Path, folder: Path, runs: int) -> subprocess.CompletedProcess[str]:
    """Run a short time, the same way every time; the return code is not 0 when something was found."""
    corpus = seed_folder(folder / "seeds")
    if kind.fuzzer:
        return _run(libfuzzer_command(program_file, corpus, folder, runs))
    known = _run([str(program_file), *(str(path) for path in sorted(corpus.iterdir()))])
    drawn = [str(program_file), "--seeds", "1", str(runs), str(_LARGEST_INPUT)]
    return known if known.returncode != 0 else _run(drawn)


def run_plain(program_file: Path, binary: Path, runs: int) -> subprocess.CompletedProcess[str]:
    """Run a production binary: the corpus, and what is drawn from the first seeds."""
    environment = {**os.environ, "FUZZ_LIBRARY": str(binary)}
    known = _run([str(program_file), *map(str, sorted(CORPUS.glob("*.bin")))], env=environment)
    drawn = [str(program_file), "--seeds", "1", str(runs), str(_LARGEST_INPUT)]
    return known if known.returncode != 0 else _run(drawn, env=environment)


def run_valgrind(program_file: Path, binary: Path, runs: int) -> subprocess.CompletedProcess[str]:
    """Run a production binary under valgrind, which ends with 9 when it has found something."""
    options = ("--quiet", "--error-exitcode=9", "--leak-check=full", "--exit-on-first-error=yes")
    drawn = ("--seeds", "1", str(runs), str(_LARGEST_INPUT))
    command = ["valgrind", *options, str(program_file), *drawn]
    return _run(command, env={**os.environ, "FUZZ_LIBRARY": str(binary)})
