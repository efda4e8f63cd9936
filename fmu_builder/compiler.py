"""The one place that calls the C compiler: zig, which comes with the pip package `ziglang`.

An FMU's binary and a library loaded into Python are compiled with the same flags, so they give the same bits.
"""

from __future__ import annotations

import atexit
import ctypes
import functools
import os
import platform as host
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

from fmu_builder.compiled_cache import keep, kept, key_of
from fmu_builder.errors import BuildError, OutputError
from fmu_builder.files import write_bytes
from fmu_builder.universal_library import universal_library

PINNED = "0.17.1"
"""Version of the compiler; pyproject.toml asks for the same."""

FREESTANDING = Path(__file__).parent / "freestanding"
_HIDDEN_EXPORT = '__attribute__((visibility("default")))'
_WINDOWS_EXPORT = "__declspec(dllexport)"
_FLAGS = (
    *("-std=c99", "-O2", "-g0", "-s", "-shared", "-nostdlib", "-ffreestanding", "-fno-builtin"),
    *("-fvisibility=hidden", "-fno-stack-protector", "-fno-sanitize=undefined"),
    *("-fno-asynchronous-unwind-tables", "-fno-unwind-tables"),  # nothing here throws
    *("-ffp-contract=off", "-fno-math-errno"),  # the same bits on every platform
    *("-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror"),
    *(
        "-Wno-sign-conversion",
        "-Wno-unused-function",
    ),  # a unity build may leave functions of a library unused
)
_LINUX = ("-fPIC", "-Wl,--hash-style=gnu")  # no second table of names: no loader needs both
_WINDOWS = ("-lkernel32",)
_MACOS = (
    *("-fPIC", "-Wl,-undefined,dynamic_lookup", "-Wl,-install_name,@rpath/{output}"),
    "-Wl,-x",  # no names of static functions: -s leaves them there
)
_INCLUDE_LINE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*"([^"]+)"', re.MULTILINE)
_SHOWN_LINES = 12
_INTEL = ("x86_64", "amd64", "x86", "i386", "i486", "i586", "i686")


@dataclass(frozen=True)
class Target:
    """One platform a shared library can be built for.

    Attributes:
        triple: zig's name of it; naming it selects the baseline processor, never the builder's own.
        suffix: Ending of a shared library there.
        flags: What this platform needs beside the common flags; `{output}` stands for the file name.
        export: What the macro EXPORTED expands to.
        others: Platforms whose code goes into the same file, which then is a universal one of macOS.
    """

    triple: str
    suffix: str
    flags: tuple[str, ...]
    export: str
    others: tuple[str, ...] = ()


TARGETS: Mapping[str, Target] = {
    "linux64": Target("x86_64-linux-gnu.2.17", ".so", _LINUX, _HIDDEN_EXPORT),
    "linux32": Target("x86-linux-gnu.2.17", ".so", _LINUX, _HIDDEN_EXPORT),
    "aarch64-linux": Target("aarch64-linux-gnu.2.17", ".so", _LINUX, _HIDDEN_EXPORT),
    "win64": Target("x86_64-windows-gnu", ".dll", _WINDOWS, _WINDOWS_EXPORT),
    "win32": Target("x86-windows-gnu", ".dll", _WINDOWS, _WINDOWS_EXPORT),
    "aarch64-windows": Target("aarch64-windows-gnu", ".dll", _WINDOWS, _WINDOWS_EXPORT),
    "darwin64": Target("x86_64-macos.11.0", ".dylib", _MACOS, _HIDDEN_EXPORT, others=("aarch64-darwin",)),
    "aarch64-darwin": Target("aarch64-macos.11.0", ".dylib", _MACOS, _HIDDEN_EXPORT),
}
"""FMI 2.0 platform folder -> how to build for it."""


def host_platform() -> str:
    """Return the FMI 2.0 platform folder of the running Python.

    Raises:
        BuildError: This machine is none of `TARGETS`.
    """
    arm = host.machine().lower() in ("aarch64", "arm64")
    wide = sys.maxsize > 2**32
    if sys.platform.startswith("linux"):
        name = ("aarch64-linux" if arm else "linux64") if wide else "linux32"
    elif sys.platform == "win32":
        name = ("aarch64-windows" if arm else "win64") if wide else "win32"
    else:
        name = {"darwin": "aarch64-darwin" if arm else "darwin64"}.get(sys.platform, sys.platform)
    if name not in TARGETS or (not arm and host.machine().lower() not in _INTEL):
        what = f"{sys.platform} on {host.machine()} is not a platform FMUs can be compiled for"
        raise BuildError.of("this machine", what, f"Use one of: {', '.join(TARGETS)}")
    return name


def _temporary_folder() -> Path:
    """Return a new folder that goes away with this process."""
    folder = Path(tempfile.mkdtemp(prefix="pantograph-llmn-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


@functools.cache
def cache_folder() -> Path:
    """Return a folder of the user for compiled things; a temporary one when none can be written."""
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = base / "pantograph-llmn"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=folder):
            return folder
    except OSError:
        return _temporary_folder()


@functools.cache
def _zig() -> tuple[Path, str]:
    """Return zig's path and version, which is always the pinned one: another would make other bytes."""
    mend = f"Install it with: python -m pip install ziglang=={PINNED}"
    spec = find_spec("ziglang")
    if spec is None or not spec.submodule_search_locations:
        raise BuildError.of("C compiler", "the Python package ziglang is not installed", mend)
    folder = Path(next(iter(spec.submodule_search_locations)))
    program = folder / ("zig.exe" if sys.platform == "win32" else "zig")
    if not program.is_file():
        raise BuildError.of(str(program), "the zig compiler is missing from the package ziglang", mend)
    if (version := metadata.version("ziglang")) != PINNED:
        raise BuildError.of("C compiler", f"the Python package ziglang is version {version}", mend)
    return program, PINNED


def _environment() -> dict[str, str]:
    """Return the environment for zig: its caches with ours, nothing that changes what is compiled."""
    unwanted = ("CPATH", "C_INCLUDE_PATH", "LIBRARY_PATH", "ZIG_LIB_DIR", "SOURCE_DATE_EPOCH")
    kept = {name: value for name, value in os.environ.items() if name not in unwanted}
    zig_cache = str(cache_folder() / "zig")
    return kept | {"ZIG_GLOBAL_CACHE_DIR": zig_cache, "ZIG_LOCAL_CACHE_DIR": zig_cache}


def _flags(platform: str, file_name: str, defines: Mapping[str, str]) -> list[str]:
    """Return every flag that is not a path."""
    target = TARGETS[platform]
    definitions = {"EXPORTED": target.export, **defines}
    return [
        *("-target", target.triple),
        *_FLAGS,
        *(flag.format(output=file_name) for flag in target.flags),
        *(f"-D{name}={value}" for name, value in sorted(definitions.items())),
    ]


def _first_lines(text: str) -> str:
    lines = [line for line in text.rstrip(" .\r\n").splitlines() if line.strip()]
    left = len(lines) - _SHOWN_LINES
    return "\n  ".join(lines[:_SHOWN_LINES] + ([f"... and {left} more lines"] if left > 0 else []))


@dataclass(frozen=True)
class _Job:
    """What is compiled, but for the platform."""

    unity: Path
    stem: str  # of the library's file name, which goes into it on Windows and macOS
    include: tuple[Path, ...]
    defines: Mapping[str, str]
    system_include: tuple[Path, ...]

    def key(self, platform: str, file_name: str) -> str:
        """Return the hash of all that the library's bytes depend on."""
        parts = [_zig()[1], file_name, *_flags(platform, file_name, self.defines)]
        files = [
            *source_files(self.unity, self.include),
            *((path.name, path) for path in sorted(FREESTANDING.iterdir()) if path.is_file()),
            *((path.name, path) for folder in self.system_include for path in sorted(folder.glob("*.h"))),
        ]
        contents = (part for name, path in files for part in (name.encode(), path.read_bytes()))
        return key_of((*(text.encode() for text in parts), *contents))


def _one_processor(job: _Job, platform: str) -> bytes:
    """Return the library for the processor of a platform, from the cache when it has been made before."""
    file_name = job.stem + TARGETS[platform].suffix
    folder, key = cache_folder() / "libraries", job.key(platform, file_name)
    content = kept(folder, key)
    if content is None:
        content = _compiled(job, platform, file_name)
        keep(folder, key, content)
    return content


def _compiled(job: _Job, platform: str, file_name: str) -> bytes:
    """Call the compiler."""
    program, _ = _zig()
    with tempfile.TemporaryDirectory(prefix="llmn-compile-") as folder:
        (Path(folder) / "out").mkdir()
        headers = (*job.system_include, FREESTANDING)
        command = [
            *(str(program), "cc"),
            *_flags(platform, file_name, job.defines),
            *(f"-I{path.resolve()}" for path in job.include),
            *(part for path in headers for part in ("-isystem", str(path.resolve()))),
            *(str(job.unity.resolve()), str(FREESTANDING / "runtime.c")),
            *("-o", file_name),
        ]
        environment = {**_environment(), "ZIG_LOCAL_CACHE_DIR": str(Path(folder) / "zig")}
        where = Path(folder) / "out"
        try:
            run = subprocess.run(
                command, cwd=where, env=environment, capture_output=True, text=True, errors="replace"
            )
        except OSError as reason:
            mend = f"Reinstall it with: python -m pip install --force-reinstall ziglang=={PINNED}"
            raise BuildError.of(str(program), f"the compiler cannot be run ({reason})", mend) from reason
        library = where / file_name
        if run.returncode != 0 or not library.is_file():
            complaint = run.stderr.replace(f"{job.unity.resolve().parent}{os.sep}", "")
            what = f"does not compile for {platform}:\n  {_first_lines(complaint)}"
            raise BuildError.of(str(job.unity), what, "Mend the C source at the place named above")
        return library.read_bytes()


def compile_shared_libraries(
    unity: Path,
    stem: str,
    platforms: Sequence[str],
    include: Sequence[Path] = (),
    defines: Mapping[str, str] | None = None,
    system_include: Sequence[Path] = (),
) -> dict[str, bytes]:
    """Compile one C file that includes all others to freestanding shared libraries, several at a time.

    Exported is what the source marks: `EXPORTED` expands to the platform's mark, FMI2_Export likewise. The
    bytes depend on the sources, the flags and the file name only, not on any folder. What has been compiled
    before comes from the user's cache folder, where it is kept under a hash of all that.

    Args:
        unity: The C file to compile.
        stem: File name of the libraries without its ending; it goes into them on Windows and macOS.
        platforms: Keys of `TARGETS`.
        include: Folders searched by `#include`.
        defines: Preprocessor definitions.
        system_include: Folders with headers of others: searched after `include`, their warnings ignored.

    Returns:
        Platform -> content of the library.

    Raises:
        BuildError: Unknown platform, no compiler, or the source does not compile (with its first lines).
    """
    for platform in platforms:
        if platform not in TARGETS:
            raise BuildError.of(f"platform {platform}", "is not known", f"Use one of: {', '.join(TARGETS)}")
    if not unity.is_file():
        raise BuildError.of(str(unity), "this C source does not exist", "Give the path of the unity file")
    job = _Job(unity, stem, tuple(include), dict(defines or {}), tuple(system_include))
    parts = {platform: (platform, *TARGETS[platform].others) for platform in platforms}
    wanted = list(dict.fromkeys(part for chosen in parts.values() for part in chosen))
    _zig()
    cache_folder()
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        made = dict(zip(wanted, pool.map(lambda part: _one_processor(job, part), wanted), strict=True))
    return {
        platform: universal_library([made[part] for part in chosen]) if len(chosen) > 1 else made[platform]
        for platform, chosen in parts.items()
    }


def compile_shared_library(
    unity: Path,
    output: Path,
    platform: str,
    include: Sequence[Path] = (),
    defines: Mapping[str, str] | None = None,
    system_include: Sequence[Path] = (),
) -> None:
    """Write one library of `compile_shared_libraries`; the file name of `output` goes into it.

    Raises:
        BuildError: See there.
        OutputError: `output` cannot be written.
    """
    made = compile_shared_libraries(unity, output.stem, (platform,), include, defines, system_include)
    write_bytes(output, made[platform])


def run_compiler(
    arguments: Sequence[str], folder: Path, time_limit: float, language: str = "cc"
) -> subprocess.CompletedProcess[str]:
    """Call the compiler with other flags than ours, for sources of others.

    Args:
        arguments: Flags and files, as clang takes them.
        folder: Where it runs.
        time_limit: After which it is ended [s].
        language: "cc" or "c++".

    Raises:
        BuildError: There is no compiler, or it does not come to an end.
    """
    program, _ = _zig()
    try:
        return subprocess.run(
            [str(program), language, *arguments],
            cwd=folder,
            env=_environment(),
            capture_output=True,
            text=True,
            errors="replace",
            timeout=time_limit,
        )
    except (OSError, subprocess.TimeoutExpired) as reason:
        mend = "Compile these sources alone to see why"
        raise BuildError.of("C compiler", f"does not come to an end ({reason})", mend) from reason


def source_files(unity: Path, include: Sequence[Path] = ()) -> Iterator[tuple[str, Path]]:
    """Yield (name in the include line, path) of a unity file and all it includes in quotes, each once.

    Names that are found nowhere are left out: headers of others, or the compiler reports them better.
    """
    seen: set[Path] = set()
    waiting = [(unity.name, unity)]
    while waiting:
        name, path = waiting.pop(0)
        if path.resolve() in seen:
            continue
        seen.add(path.resolve())
        yield name, path
        for included in _INCLUDE_LINE.findall(path.read_text(encoding="utf-8")):
            candidates = (folder / included for folder in (path.parent, *include))
            found = next((candidate for candidate in candidates if candidate.is_file()), None)
            if found is not None:
                waiting.append((included, found))


def load_native(
    name: str, unity: Path, include: Sequence[Path] = (), defines: Mapping[str, str] | None = None
) -> ctypes.CDLL:
    """Compile a C source for this machine, once per content, and load it.

    The library is kept in the user's cache folder; a file there that is not what was compiled is replaced.

    Args:
        name: What the library is called, for people who look into the cache.
        unity: The C file to compile; functions marked `EXPORTED` can be called.
        include: Folders searched by `#include`.
        defines: Preprocessor definitions.

    Raises:
        BuildError: The source does not compile, or the library does not load.
    """
    platform = host_platform()
    if not unity.is_file():
        raise BuildError.of(str(unity), "this C source does not exist", "Reinstall the package")
    content = _one_processor(_Job(unity, name, tuple(include), dict(defines or {}), ()), platform)
    file_name = f"{name}-{key_of((content,))[:24]}{TARGETS[platform].suffix}"
    library = cache_folder() / "native" / file_name
    if not (library.is_file() and library.read_bytes() == content):
        try:
            write_bytes(library, content)
        except OutputError:
            library = write_bytes(_temporary_folder() / file_name, content)
    try:
        return ctypes.CDLL(str(library))
    except OSError as reason:
        what = f"the compiled library does not load ({reason})"
        raise BuildError.of(str(library), what, "Give a folder that libraries may be loaded from") from reason
