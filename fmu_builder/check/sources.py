"""The sources of FMUs: they compile by themselves, and several FMUs link into one image."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from fmu_builder.check.archive import inspect_archive, unpack
from fmu_builder.check.binaries import object_symbols
from fmu_builder.check.description import Description, read_description
from fmu_builder.check.finding import Finding, Report, Severity, standard
from fmu_builder.check.functions import COMMON, OF_INTERFACE
from fmu_builder.compiler import TARGETS, run_compiler
from fmu_builder.errors import BuildError
from fmu_builder.fmi2 import fmi_headers

_PREFIX_RULE = standard("2.1.1")
_DISTRIBUTION = standard("2.3")
_PLATFORM = "linux64"  # any machine can compile for it, and its objects are read here
_CPLUSPLUS = (".cpp", ".cc", ".cxx", ".c++")
_WITHOUT_PREFIX = "#define fmi2FullName(name) name"
_WITH_PREFIX = """
#ifdef FMI2_FUNCTION_PREFIX
#define fmi2Paste(prefix, name) prefix ## name
#define fmi2PasteExpanded(prefix, name) fmi2Paste(prefix, name)
#define fmi2FullName(name) fmi2PasteExpanded(FMI2_FUNCTION_PREFIX, name)
#else
#define fmi2FullName(name) name
#endif
"""
_SHOWN = 6


@dataclass(frozen=True)
class Compiled:
    """The sources of one FMU as objects.

    Attributes:
        name: Of the FMU, for findings.
        objects: The object files.
        defined: Global names that they define.
    """

    name: str
    objects: tuple[Path, ...]
    defined: frozenset[str]


def _headers(folder: Path) -> Path:
    """Write the FMI headers with the standard's own prefix rule, which those of fmpy leave out."""
    target = folder / "fmi headers"
    target.mkdir(exist_ok=True)
    for file in fmi_headers().glob("fmi2*.h"):
        text = file.read_text(encoding="utf-8", errors="replace")
        (target / file.name).write_text(text.replace(_WITHOUT_PREFIX, _WITH_PREFIX), encoding="utf-8")
    return target


def _first_lines(text: str) -> str:
    lines = [line for line in text.splitlines() if "error" in line] or text.splitlines()
    return "; ".join(line.strip() for line in lines[:3])[:600]


def _compile(
    files: Sequence[str], sources: Path, prefix: str, folder: Path, time_limit: float
) -> tuple[list[Path], list[Finding]]:
    """Compile each file to an object with the function prefix of the standard."""
    headers = _headers(folder)
    objects: list[Path] = []
    findings: list[Finding] = []
    for number, name in enumerate(files):
        place, target = f"sources/{name}", folder / f"{prefix}{number}.o"
        arguments = [
            *("-target", TARGETS[_PLATFORM].triple, "-O0", "-w", "-fPIC", "-fno-sanitize=undefined"),
            *("-c", f"-DFMI2_FUNCTION_PREFIX={prefix}", f"-I{sources}", f"-I{(sources / name).parent}"),
            *("-isystem", str(headers), str(sources / name), "-o", str(target)),
        ]
        language = "c++" if name.lower().endswith(_CPLUSPLUS) else "cc"
        try:
            run = run_compiler(arguments, folder, time_limit, language)
        except BuildError as error:
            what, mend = error.problems[0].what, "Make the sources compile in reasonable time"
            findings.append(Finding(Severity.ERROR, "source-compile", place, what, _DISTRIBUTION, mend))
            continue
        if run.returncode != 0 or not target.is_file():
            what = f"does not compile: {_first_lines(run.stderr.replace(str(folder), ''))}"
            mend = "Ship every file and header but those of FMI and the C library, in C99"
            findings.append(Finding(Severity.ERROR, "source-compile", place, what, _DISTRIBUTION, mend))
        else:
            objects.append(target)
    return objects, findings


def _names(names: Sequence[str]) -> str:
    return ", ".join(names[:_SHOWN]) + (f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else "")


def _link(objects: Sequence[Path], folder: Path, time_limit: float) -> str | None:
    """Link objects into one image; return what the linker says against it."""
    arguments = [
        *("-target", TARGETS[_PLATFORM].triple, "-shared", "-nostdlib", *map(str, objects)),
        *("-o", str(folder / "image.so")),
    ]
    try:
        run = run_compiler(arguments, folder, time_limit)
    except BuildError as error:
        return error.problems[0].what
    return None if run.returncode == 0 else _first_lines(run.stderr.replace(str(folder), ""))


def compile_sources(
    description: Description, name: str, unpacked: Path, folder: Path, time_limit: float
) -> tuple[Compiled | None, list[Finding]]:
    """Compile the sources of an FMU with its own prefix and look at the names they define.

    Args:
        description: The description, which lists the files.
        name: Of the FMU, for findings.
        unpacked: Where the FMU is unpacked.
        folder: For the objects.
        time_limit: Of one file [s].
    """
    sources = unpacked / "sources"
    kind = next((kind for kind, files in description.sources.items() if files), None)
    if kind is None:
        return None, []
    files = list(dict.fromkeys(description.sources[kind]))
    inside = {file.relative_to(sources).as_posix() for file in sources.rglob("*") if file.is_file()}
    prefix = description.identifier(kind) + "_"
    if prefix == "_" or not set(files) <= inside:
        return None, []  # there is a finding on that already
    objects, findings = _compile(files, sources, prefix, folder, time_limit)
    if findings:
        return None, findings
    defined: set[str] = set()
    for item in objects:
        defined |= object_symbols(item.read_bytes())[0]
    findings = list(_name_findings(defined, prefix, description, kind))
    if not findings and (complaint := _link(objects, folder, time_limit)) is not None:
        what, mend = f"do not link: {complaint}", "Define every name once"
        findings.append(Finding(Severity.ERROR, "source-link", "sources", what, _DISTRIBUTION, mend))
    return Compiled(name, tuple(objects), frozenset(defined)), findings


def _name_findings(defined: set[str], prefix: str, description: Description, kind: str) -> Iterator[Finding]:
    wanted = COMMON | OF_INTERFACE[kind]
    other = [name for name in description.interfaces if name != kind]
    same = [name for name in other if description.sources[name] == description.sources[kind]]
    wanted = wanted.union(*(OF_INTERFACE[name] for name in same))
    missing = sorted(name for name in wanted if prefix + name not in defined)
    if missing:
        what = f"do not define {_names([prefix + name for name in missing])}"
        mend = "Define all functions, their names made by fmi2FullName, so that FMI2_FUNCTION_PREFIX counts"
        yield Finding(Severity.ERROR, "source-function", "sources", what, _PREFIX_RULE, mend)
    strange = sorted(name for name in defined if not name.startswith(prefix))
    if strange:
        what = f"define global names without the prefix {prefix}: {_names(strange)}"
        mend = "Make them static or prefix them: a second FMU in the same image may have them too"
        yield Finding(Severity.ERROR, "unprefixed-symbol", "sources", what, _PREFIX_RULE, mend)


def source_findings(description: Description, unpacked: Path, time_limit: float) -> list[Finding]:
    """Return what is wrong with the sources of one FMU; nothing of them runs."""
    with tempfile.TemporaryDirectory(prefix="llmn-objects-") as folder:
        return compile_sources(description, "", unpacked, Path(folder), time_limit)[1]


def check_image(paths: Sequence[Path], time_limit: float) -> Report:
    """Link the sources of several FMUs into one image, as rapid prototyping systems do.

    FMUs without sources, or whose sources do not compile, are left out: their own report says why.

    Args:
        paths: The FMUs.
        time_limit: Of one compilation [s].
    """
    findings: list[Finding] = []
    compiled: list[Compiled] = []
    with tempfile.TemporaryDirectory(prefix="llmn-image-", ignore_cleanup_errors=True) as name:
        for number, path in enumerate(paths):
            folder = Path(name) / str(number)
            folder.mkdir()
            found = _compiled(path, folder, time_limit)
            if found is not None:
                compiled.append(found)
        title = " + ".join(item.name for item in compiled)
        if len(compiled) > 1:
            findings.extend(_clashes(compiled))
            objects = [item for one in compiled for item in one.objects]
            if not findings and (complaint := _link(objects, Path(name), time_limit)) is not None:
                mend = "Define every name once"
                what = f"do not link: {complaint}"
                findings.append(Finding(Severity.ERROR, "image", title, what, _PREFIX_RULE, mend))
        checked = ["one image"] if len(compiled) > 1 else []
        return Report.of(title or "one image", findings, checked)


def _compiled(path: Path, folder: Path, time_limit: float) -> Compiled | None:
    if any(item.rule in ("archive", "archive-bomb") for item in inspect_archive(path)):
        return None
    unpacked = folder / "fmu"
    unpacked.mkdir()
    unpack(path, unpacked)
    description, _ = read_description(unpacked)
    if description is None:
        return None
    return compile_sources(description, path.name, unpacked, folder, time_limit)[0]


def _clashes(compiled: Sequence[Compiled]) -> Iterator[Finding]:
    for k, one in enumerate(compiled):
        for other in compiled[k + 1 :]:
            if both := sorted(one.defined & other.defined):
                what = f"both define {_names(both)}"
                mend = "Make them static or prefix them with the modelIdentifier; give each FMU its own"
                place = f"{one.name} + {other.name}"
                yield Finding(Severity.ERROR, "image", place, what, _PREFIX_RULE, mend)
