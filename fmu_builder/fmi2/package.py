"""From an interface, generated data and C sources to an FMU file."""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path, PurePosixPath

from fmu_builder.compiler import TARGETS, compile_shared_libraries, source_files
from fmu_builder.errors import BuildError, Problem
from fmu_builder.files import written_atomically
from fmu_builder.fmi2.build_description import BUILD_DESCRIPTION, build_description
from fmu_builder.fmi2.description import UNITY_NAME, model_description
from fmu_builder.fmi2.documentation import index_page, licence_page
from fmu_builder.fmi2.header import variables_header
from fmu_builder.fmi2.interface import Interface

C_FOLDER = Path(__file__).parent / "c"
"""The slave and the FMI functions, for the include path of a unity file."""

DEFAULT_PLATFORMS = tuple(TARGETS)
"""All that can be built for."""

_FIXED_DATE = (1980, 1, 1, 0, 0, 0)
_FILE_MODE = 0o100644
_BINARY_MODE = 0o100755
_UNIX = 3  # ZipInfo.create_system: which system the modes belong to


def fmi_headers() -> Path:
    """Return the folder of the FMI headers, which come with fmpy; they are needed for compiling only.

    Raises:
        BuildError: fmpy or its headers are missing.
    """
    spec = find_spec("fmpy")
    for package in (spec.submodule_search_locations or ()) if spec else ():
        folder = Path(package) / "c-code"
        if (folder / "fmi2Functions.h").is_file():
            return folder
    mend = "Install it with: python -m pip install fmpy"
    raise BuildError.of("FMI headers", "the Python package fmpy or its C headers are missing", mend)


def _is_inside(name: str) -> bool:
    """Whether an archive name stays below its folder on every system."""
    parts = name.split("/")
    return not (set(parts) & {"", ".", ".."} or "\\" in name or ":" in name)


def _wrong_names(folder: str, names: Mapping[str, object]) -> Iterator[Problem]:
    for name in names:
        if not _is_inside(name):
            what = "is no plain relative path with forward slashes"
            yield Problem(f"{folder}/{name}", what, "Name a file below its folder")


def _collect_sources(unity: Path, include: Sequence[Path], generated: Mapping[str, str]) -> dict[str, str]:
    """Return name below `sources/` -> text of everything the unity file includes, and of the file itself."""
    with tempfile.TemporaryDirectory(prefix="llmn-sources-") as folder:
        for name, text in generated.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        sources: dict[str, str] = {}
        problems = []
        for name, path in source_files(unity, (Path(folder), *include, C_FOLDER)):
            target = UNITY_NAME if path == unity else name
            text = path.read_text(encoding="utf-8")
            if sources.setdefault(target, text) != text:
                what = "two different files are included under this name"
                problems.append(Problem(f"sources/{target}", what, "Rename one of them"))
        for name in generated:
            if name not in sources:
                what = f"is generated but {unity.name} does not include it"
                problems.append(Problem(f"sources/{name}", what, "Include it, or do not generate it"))
    problems.extend(_wrong_names("sources", sources))
    if problems:
        raise BuildError(problems)
    return sources


def _compile(interface: Interface, sources: Mapping[str, str], platforms: Sequence[str]) -> dict[str, bytes]:
    """Return archive name -> binary, compiled from exactly what goes into `sources/`."""
    headers = fmi_headers()
    with tempfile.TemporaryDirectory(prefix="llmn-build-") as folder:
        for name, text in sources.items():
            path = Path(folder) / "sources" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8", newline="\n")
        unity = Path(folder) / "sources" / UNITY_NAME
        try:
            made = compile_shared_libraries(
                unity, interface.model_identifier, platforms, (unity.parent,), system_include=(headers,)
            )
        except BuildError as error:  # the folder is gone when somebody reads this
            place = f"{interface.model_identifier}.fmu, sources/{UNITY_NAME}"
            found = error.problems
            raise BuildError(Problem(place, problem.what, problem.mend) for problem in found) from error
    return {
        f"binaries/{platform}/{interface.model_identifier}{TARGETS[platform].suffix}": content
        for platform, content in made.items()
    }


def write_archive(path: Path, entries: Mapping[str, bytes]) -> None:
    """Write a zip that depends on the entries only: stored, fixed date and modes, the description first."""
    names = sorted(entries, key=lambda name: (name != "modelDescription.xml", name))
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for name in names:
            entry = zipfile.ZipInfo(name, _FIXED_DATE)
            entry.create_system = _UNIX
            mode = _BINARY_MODE if PurePosixPath(name).parts[0] == "binaries" else _FILE_MODE
            entry.external_attr = mode << 16
            archive.writestr(entry, entries[name])


def build_fmu(
    interface: Interface,
    model_hash: str,
    unity: Path,
    include: Sequence[Path],
    generated: Mapping[str, str],
    output: Path,
    platforms: Sequence[str] = DEFAULT_PLATFORMS,
    resources: Mapping[str, bytes] | None = None,
    documentation: Mapping[str, bytes] | None = None,
) -> Path:
    """Build an FMU: description, one binary per platform, the sources they were compiled from, documentation.

    The same arguments give the same bytes, in any folder and on any machine.

    Args:
        interface: What the FMU shows to the outside.
        model_hash: Hash of what the model computes with; with the interface it makes the GUID.
        unity: The C file that includes all others (see c/model.h); it becomes sources/all.c.
        include: Folders of further C files; those of the FMI layer are found without.
        generated: Headers of data, name -> text, beside variables.h, which is made here.
        output: The .fmu file.
        platforms: FMI 2.0 platform folders, keys of `fmu_builder.compiler.TARGETS`.
        resources: Files below resources/.
        documentation: Files below documentation/. index.html is made from the interface, and
            licenses/license.txt is that of the C sources, when they are not among them.

    Returns:
        `output`.

    Raises:
        BuildError: Unknown platform, bad file name, missing source, or C code that does not compile.
        OutputError: `output` cannot be written.
    """
    unknown = [platform for platform in platforms if platform not in TARGETS]
    problems = [
        Problem(f"platform {name}", "is not known", f"Use one of: {', '.join(TARGETS)}") for name in unknown
    ]
    problems.extend(_wrong_names("resources", resources or {}))
    problems.extend(_wrong_names("documentation", documentation or {}))
    problems.extend(_wrong_names("sources", generated))
    if not unity.is_file():
        problems.append(
            Problem(str(unity), "this C source does not exist", "Give the path of the unity file")
        )
    if problems:
        raise BuildError(problems)
    guid = interface.guid(model_hash)
    headers = {**generated, "variables.h": variables_header(interface, guid)}
    sources = _collect_sources(unity, include, headers)
    pages = {
        "index.html": index_page(interface).encode("utf-8"),
        **licence_page(),
        **(documentation or {}),
    }
    entries = {
        "modelDescription.xml": model_description(interface, guid).encode("utf-8"),
        **_compile(interface, sources, tuple(dict.fromkeys(platforms))),
        **{f"sources/{name}": text.encode("utf-8") for name, text in sources.items()},
        f"sources/{BUILD_DESCRIPTION}": build_description(interface).encode("utf-8"),
        **{f"documentation/{name}": content for name, content in pages.items()},
        **{f"resources/{name}": content for name, content in (resources or {}).items()},
    }
    with written_atomically(output) as temporary:
        write_archive(temporary, entries)
    return output
