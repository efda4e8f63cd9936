"""FMUs whose binary is compiled from our C sources with planted changes."""

from __future__ import annotations

import shutil
from pathlib import Path

from check.defects import entries_of, write
from fmi import lti
from fmu_builder.compiler import TARGETS, compile_shared_library, host_platform
from fmu_builder.fmi2 import C_FOLDER, fmi_headers

Changes = tuple[tuple[str, str, str], ...]
"""File, what stands there once, what stands there instead."""


def changed_sources(base: Path, folder: Path, changes: Changes) -> Path:
    """Write the C sources of the right FMU into `folder`, changed."""
    shutil.copytree(C_FOLDER, folder)
    shutil.copytree(lti.C_FOLDER, folder, dirs_exist_ok=True)
    (folder / "variables.h").write_bytes(entries_of(base)["sources/variables.h"])
    for file, right, wrong in changes:
        text = (folder / file).read_text()
        assert text.count(right) == 1, f"{right!r} is {text.count(right)} times in {file}"
        (folder / file).write_text(text.replace(right, wrong))
    return folder


def with_binary(base: Path, folder: Path, changes: Changes, platform: str | None = None) -> Path:
    """Copy the right FMU with another binary for a platform (this machine's by default)."""
    chosen = platform or host_platform()
    sources = changed_sources(base, folder / "c", changes)
    library = folder / f"lti_test{TARGETS[chosen].suffix}"
    compile_shared_library(sources / "all.c", library, chosen, (sources,), system_include=(fmi_headers(),))
    name = f"binaries/{chosen}/{library.name}"
    entries = entries_of(base)
    assert name in entries
    return write(folder / "lti_test.fmu", {**entries, name: library.read_bytes()}.items())
