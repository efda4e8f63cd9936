"""The binaries of an FMU: there, for the right processor, complete, and loadable on the target."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from fmu_builder.check.binaries import Binary, BinaryError, read_binary
from fmu_builder.check.description import Description
from fmu_builder.check.finding import Finding, Severity, practice, standard
from fmu_builder.check.functions import COMMON, OF_INTERFACE

PLATFORMS: Mapping[str, tuple[str, str, str]] = {
    "linux64": ("ELF", "x86_64", ".so"),
    "linux32": ("ELF", "x86", ".so"),
    "win64": ("PE", "x86_64", ".dll"),
    "win32": ("PE", "x86", ".dll"),
    "darwin64": ("Mach-O", "x86_64", ".dylib"),
    **{
        f"{machine}-{system}": (kind, machine, suffix)
        for machine in ("x86", "x86_64", "aarch64")
        for system, kind, suffix in (
            ("linux", "ELF", ".so"), ("windows", "PE", ".dll"), ("darwin", "Mach-O", ".dylib"),
        )
    },
}  # fmt: skip
"""Folder below binaries/ -> format, processor, ending."""

_DISTRIBUTION = standard("2.3")
_OLDEST_GLIBC = (2, 17)
_GLIBC = re.compile(r"GLIBC_(\d+)\.(\d+)")
_SHOWN = 6
_LIBM = frozenset(
    """
    acos acosh asin asinh atan atan2 atanh cbrt ceil cos cosh erf erfc exp exp2 expm1 fabs floor fma fmax
    fmin fmod frexp hypot ldexp lgamma log log10 log1p log2 lrint lround modf nearbyint pow remainder rint
    round sin sincos sinh sqrt tan tanh tgamma trunc
    """.split()  # noqa: SIM905 - fifty names read better as text
)
_IN_EVERY_PROCESS = frozenset(
    """
    abort calloc fflush fprintf fputs free malloc memchr memcmp memcpy memmove memset printf putchar puts
    realloc snprintf sprintf strcat strchr strcmp strcpy strlen strncmp strncpy strrchr strtod strtol
    vsnprintf __errno_location __stack_chk_fail
    """.split()  # noqa: SIM905
)
_SYSTEM: Mapping[str, re.Pattern[str]] = {
    "ELF": re.compile(r"(lib(c|m|dl|rt|pthread|gcc_s)|ld-linux.*)\.so.*"),
    "PE": re.compile(
        r"(kernel32|user32|advapi32|shell32|ole32|oleaut32|ws2_32|gdi32|shlwapi|ntdll|msvcrt|ucrtbase|version"
        r"|bcrypt|api-ms-win-.*)\.dll",
        re.IGNORECASE,
    ),
    "Mach-O": re.compile(r"(/usr/lib/|/System/).*"),
}
"""Libraries that every target has."""


def _shown(names: list[str]) -> str:
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(names[:_SHOWN]) + more


def _kind_findings(place: str, folder: str, slices: list[Binary]) -> Iterator[Finding]:
    kind, machine, _ = PLATFORMS[folder]
    found = [(item.format, item.machine) for item in slices]
    if (kind, machine) not in found:
        what = f"holds {', '.join(' '.join(pair) for pair in found)}, not {kind} {machine}"
        mend = f"Put a {kind} library for {machine} into binaries/{folder}"
        yield Finding(Severity.ERROR, "binary-platform", place, what, _DISTRIBUTION, mend)


def _function_findings(place: str, binary: Binary, interfaces: list[str]) -> Iterator[Finding]:
    wanted = COMMON.union(*(OF_INTERFACE[name] for name in interfaces))
    missing = sorted(wanted - binary.exported)
    if missing:
        what = f"does not export {_shown(missing)}"
        mend = "Export every function of the interface; one that is not supported returns fmi2Error"
        yield Finding(Severity.ERROR, "missing-function", place, what, standard("2.1.1"), mend)
    known = COMMON.union(*OF_INTERFACE.values())
    others = sorted(binary.exported - known)
    if others and binary.format != "PE":
        what = f"exports {len(others)} names that are no FMI functions: {_shown(others)}"
        mend = "Hide them (-fvisibility=hidden): libraries of one process share one space of names"
        yield Finding(Severity.NOTE, "other-exports", place, what, practice("loaders"), mend)


def _symbol_findings(place: str, binary: Binary) -> Iterator[Finding]:
    """Names that nobody promises to bring."""
    if binary.format != "ELF":
        return
    libraries = " ".join(binary.libraries)
    mathematics = sorted(binary.needed & _LIBM)
    if mathematics and "libm.so" not in libraries:
        what = f"takes {_shown(mathematics)} from the mathematical library, but does not name libm"
        mend = "Link it with -lm, or bring these functions along"
        yield Finding(Severity.ERROR, "libm-symbol", place, what, practice("loaders"), mend)
    elif mathematics:
        what = f"takes {_shown(mathematics)} from the target's libm, whose last digits differ by version"
        mend = "Bring these functions along where the same bits are wanted everywhere"
        yield Finding(Severity.NOTE, "libm-symbol", place, what, practice("reproducibility"), mend)
    python = sorted(name for name in binary.needed if re.match(r"_?Py[A-Z_]", name))
    if python and "libpython" not in libraries:
        what = f"takes {_shown(python)} from Python, but does not name libpython"
        mend = "Link it with libpython; now it loads in Python programs only"
        yield Finding(Severity.ERROR, "python-symbol", place, what, practice("loaders"), mend)
    if not binary.libraries:
        others = sorted(binary.needed - _IN_EVERY_PROCESS - _LIBM - set(python))
        if others:
            what = f"takes {_shown(others)} from others, but names no library"
            mend = "Link it with the libraries that have them"
            yield Finding(Severity.WARNING, "undefined-symbol", place, what, practice("loaders"), mend)


def _library_findings(place: str, folder: Path, binary: Binary) -> Iterator[Finding]:
    beside = {path.name.lower() for path in folder.iterdir()}
    own = (binary.remarks.get("install name", ""),)
    missing = [
        name
        for name in binary.libraries
        if not _SYSTEM[binary.format].fullmatch(name)
        and name.rsplit("/", 1)[-1].lower() not in beside
        and name not in own
    ]
    if missing:
        what = f"needs {_shown(missing)}, which the target may not have"
        mend = "Link them statically, or put them beside the library"
        yield Finding(Severity.WARNING, "needed-library", place, what, _DISTRIBUTION, mend)
    levels = {}
    for version, names in binary.versions.items():
        if match := _GLIBC.fullmatch(version):
            levels[int(match[1]), int(match[2])] = list(names)
    if levels and max(levels) > _OLDEST_GLIBC:
        level = max(levels)
        what = f"needs glibc {level[0]}.{level[1]} for {_shown(levels[level])}"
        mend = f"Build it against glibc {_OLDEST_GLIBC[0]}.{_OLDEST_GLIBC[1]} to run on older systems"
        yield Finding(Severity.WARNING, "glibc-level", place, what, practice("Linux"), mend)


def _remark_findings(place: str, binary: Binary) -> Iterator[Finding]:
    if "executable stack" in binary.remarks:
        what, mend = "asks for an executable stack, which loaders refuse", "Link it with -z noexecstack"
        yield Finding(Severity.WARNING, "executable-stack", place, what, practice("loaders"), mend)
    if binary.machine == "aarch64" and "unsigned" in binary.remarks:
        what, mend = "is not signed; macOS ends the process that loads it", "Sign it, ad hoc at least"
        yield Finding(Severity.ERROR, "unsigned", place, what, practice("macOS"), mend)
    name = binary.remarks.get("install name", "")
    if name.startswith("/") and not name.startswith(("/usr/lib/", "/System/")):
        what, mend = f"carries the path {name} of the machine it was built on", "Use @rpath/NAME.dylib"
        yield Finding(Severity.WARNING, "install-name", place, what, practice("macOS"), mend)


def _file_findings(folder: Path, file: Path, interfaces: list[str]) -> Iterator[Finding]:
    place = f"binaries/{folder.name}/{file.name}"
    try:
        slices = read_binary(file.read_bytes())
    except BinaryError as reason:
        mend = "Build it again"
        yield Finding(Severity.ERROR, "binary-format", place, str(reason), _DISTRIBUTION, mend)
        return
    yield from _kind_findings(place, folder.name, slices)
    for binary in slices:
        where = place if len(slices) == 1 else f"{place}, {binary.machine}"
        yield from _function_findings(where, binary, interfaces)
        yield from _symbol_findings(where, binary)
        yield from _library_findings(where, folder, binary)
        yield from _remark_findings(where, binary)


def library_findings(description: Description, folder: Path) -> Iterator[Finding]:
    """Yield what is wrong with the binaries of all platforms; nothing is loaded.

    Args:
        description: The description, which names the libraries.
        folder: Where the FMU is unpacked.
    """
    by_name: dict[str, list[str]] = {}
    for kind in description.interfaces:
        if name := description.identifier(kind):  # without one there is a finding already
            by_name.setdefault(name, []).append(kind)
    folders = [path for path in sorted((folder / "binaries").glob("*")) if path.is_dir()]
    if not folders and not any(description.sources.values()):
        what, mend = "has neither binaries nor sources", "Ship a binary per platform, or the sources"
        yield Finding(Severity.ERROR, "no-binary", "archive", what, _DISTRIBUTION, mend)
    for platform in folders:
        if platform.name not in PLATFORMS:
            what = "is no platform that importers look for"
            mend = f"Use one of {', '.join(list(PLATFORMS)[:5])}, aarch64-linux, aarch64-darwin, ..."
            place = f"binaries/{platform.name}"
            yield Finding(Severity.NOTE, "platform-folder", place, what, _DISTRIBUTION, mend)
            continue
        for name, interfaces in by_name.items():
            file = platform / (name + PLATFORMS[platform.name][2])
            if not file.is_file():
                place, what = f"binaries/{platform.name}", f"lacks {file.name}, named after modelIdentifier"
                mend = "Name the library after modelIdentifier"
                yield Finding(Severity.ERROR, "binary-name", place, what, _DISTRIBUTION, mend)
            else:
                yield from _file_findings(platform, file, interfaces)
