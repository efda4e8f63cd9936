"""What goes with the sources of an FMU: how to compile them, who may use them; fmpy compiles them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.model_description import read_build_description

from fmi import lti
from fmu_builder.compiler import host_platform

ROOT = Path(__file__).resolve().parents[2]


def test_the_build_description_names_what_is_compiled(lti_fmu: Path) -> None:
    """Read, and held against the schema of FMI 3.0, by fmpy."""
    (configuration,) = read_build_description(str(lti_fmu), validate=True)
    (files,) = configuration.sourceFileSets
    described = fmpy.read_model_description(str(lti_fmu))
    assert configuration.modelIdentifier == described.coSimulation.modelIdentifier
    assert files.sourceFiles == ["all.c"]
    assert (files.language, files.preprocessorDefinitions, files.includeDirectories) == ("C99", [], [])


def test_the_licence_of_the_sources_goes_with_them(lti_fmu: Path, tmp_path: Path) -> None:
    built = lti.build(tmp_path / "bare.fmu", [host_platform()], pages={})
    with zipfile.ZipFile(built) as archive:
        assert archive.read("documentation/licenses/license.txt") == (ROOT / "LICENSE").read_bytes()
    with zipfile.ZipFile(lti_fmu) as archive:
        assert archive.read("documentation/licenses/license.txt") == b"MIT\n"


def test_fmpy_compiles_it(lti_fmu: Path, tmp_path: Path) -> None:
    missing = [program for program in ("cmake", "cc") if shutil.which(program) is None]
    if missing or not host_platform().startswith("linux"):
        # Where everything that is tested must be tested, a missing program is a fault.
        stop = pytest.fail if os.environ.get("CI") == "true" else pytest.skip
        stop(f"fmpy compiles with programs that are not here: {', '.join(missing)}")
    copy = tmp_path / "lti_test.fmu"
    own = fmpy.simulate_fmu(str(lti_fmu), stop_time=0.05, output_interval=0.01, start_values={"drive": 2.0})
    name = f"binaries/{host_platform()}/lti_test.so"
    # CMake leaves alone what is as old as what it has built, to the second: ours must not be there.
    with zipfile.ZipFile(lti_fmu) as ours, zipfile.ZipFile(copy, "w") as theirs:
        for entry in ours.infolist():
            if entry.filename != name:
                theirs.writestr(entry, ours.read(entry))
    command = [sys.executable, "-m", "fmpy.cli", "compile", str(copy)]
    run = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=300)
    assert run.returncode == 0, run.stdout + run.stderr
    with zipfile.ZipFile(copy) as theirs, zipfile.ZipFile(lti_fmu) as ours:
        assert theirs.read(name) != ours.read(name)
    again = fmpy.simulate_fmu(str(copy), stop_time=0.05, output_interval=0.01, start_values={"drive": 2.0})
    assert np.array_equal(own, again)
