"""From a parameter set to an FMU that computes in Python."""

from __future__ import annotations

import hashlib
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import replace
from importlib import metadata
from pathlib import Path

from fmu_builder.compiler import TARGETS
from fmu_builder.errors import BuildError, Problem
from fmu_builder.files import written_atomically
from fmu_builder.fmi2 import Interface, index_page, licence_page, model_description, write_archive
from fmu_builder.llmn_fmu import identity, interface
from fmu_builder.parameter_set import ParameterSet

PLATFORMS = ("linux64", "win64")
"""What pythonfmu brings a binary for."""

_FOLDER = Path(__file__).parent
_IMPORT = "from fmu_builder.python_fmu.network import Network"
_WRAPPER = "pythonfmu-export"
_WHERE = (
    "in Python, for cross-checks and to edit; needs a running Python with NumPy: loads in fmpy, elsewhere"
    " only with libpython preloaded"
)
_ABILITIES = {
    "needsExecutionTool": "true",
    "canHandleVariableCommunicationStepSize": "true",
    "canInterpolateInputs": "false",
    "maxOutputDerivativeOrder": "0",
    "canRunAsynchronuously": "false",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
    "providesDirectionalDerivative": "false",
}


def build_python_fmu(
    parameter_set: ParameterSet,
    output: Path,
    platforms: Sequence[str] = PLATFORMS,
    model_identifier: str | None = None,
) -> Path:
    """Build the FMI 2.0 co-simulation FMU of a network with its arithmetic in NumPy (network.py, slave.py).

    The binaries are those of the package pythonfmu, which run the Python files in resources/; the description
    is the native FMU's, with the abilities that pythonfmu has. The same arguments give the same bytes.

    Args:
        parameter_set: The network.
        output: The .fmu file.
        platforms: Some of `PLATFORMS`.
        model_identifier: C identifier of the FMU; by default the name of the parameter set.

    Returns:
        `output`.

    Raises:
        BuildError: pythonfmu is missing, or it has no binary for a platform; unknown unit.
        OutputError: `output` cannot be written.
    """
    mend = f"Use {' or '.join(PLATFORMS)}, or the native FMU"
    what = "pythonfmu brings no binary for it"
    problems = [Problem(f"platform {name}", what, mend) for name in platforms if name not in PLATFORMS]
    if problems:
        raise BuildError(problems)
    package, installed = _pythonfmu()
    arithmetic = (_FOLDER / "network.py").read_text(encoding="utf-8")
    slave = (_FOLDER / "slave.py").read_text(encoding="utf-8")
    native = interface(parameter_set, model_identifier)
    shown = replace(
        native,
        variables=tuple(v for v in native.variables if v.causality in ("input", "output")),
        description=f"{native.description}; {_WHERE}",
        tool=f"{native.tool} with pythonfmu {installed.version}",
        directional_derivatives=False,
    )
    # Python loads one module per name and process: every model has names of its own.
    module = f"{shown.model_identifier}_slave"
    network = f"{shown.model_identifier}_network"
    embedded = {path.name: path.read_bytes() for path in sorted(package.glob("*.py"))}
    computed_with = hashlib.sha256((identity(parameter_set) + arithmetic + slave).encode("utf-8"))
    entries = {
        "modelDescription.xml": _description(shown, computed_with.hexdigest()).encode("utf-8"),
        "documentation/index.html": index_page(shown).encode("utf-8"),
        **{f"documentation/{name}": text for name, text in licence_page().items()},
        "documentation/licenses/pythonfmu.txt": _licence(installed),
        "resources/parameter_set.json": parameter_set.compact_json().encode("utf-8"),
        "resources/slavemodule.txt": module.encode("ascii"),
        f"resources/{module}.py": slave.replace(_IMPORT, f"from {network} import Network").encode("utf-8"),
        f"resources/{network}.py": arithmetic.encode("utf-8"),
        **{f"resources/pythonfmu/{name}": content for name, content in embedded.items()},
        **{
            f"binaries/{platform}/{shown.model_identifier}{TARGETS[platform].suffix}": _wrapper(
                package, platform
            )
            for platform in dict.fromkeys(platforms)
        },
    }
    with written_atomically(output) as temporary:
        write_archive(temporary, entries)
    return output


def _pythonfmu() -> tuple[Path, metadata.Distribution]:
    """Return the folder of the package pythonfmu and what is installed of it.

    Not by `find_spec`: a Python FMU that runs in this process has brought its own copy into sys.modules.
    """
    try:
        installed = metadata.distribution("pythonfmu")
    except metadata.PackageNotFoundError as reason:
        mend = "Install it with: python -m pip install pythonfmu"
        raise BuildError.of("Python FMU", "the Python package pythonfmu is not installed", mend) from reason
    return Path(str(installed.locate_file("pythonfmu"))), installed


def _licence(installed: metadata.Distribution) -> bytes:
    """Return the licence of pythonfmu, whose code goes into the FMU."""
    texts = [item for item in installed.files or () if item.name == "LICENSE"]
    return b"".join(Path(str(item.locate())).read_bytes() for item in texts)


def _wrapper(package: Path, platform: str) -> bytes:
    """Return pythonfmu's binary for a platform."""
    folder = package / "resources" / "binaries" / platform
    found = sorted(folder.glob(f"*{_WRAPPER}{TARGETS[platform].suffix}"))
    if not found:
        mend = f"Use another version of pythonfmu, or leave {platform} out"
        raise BuildError.of(f"platform {platform}", "the installed pythonfmu has no binary for it", mend)
    return found[0].read_bytes()


def _description(shown: Interface, computed_with: str) -> str:
    """Return the native description with what pythonfmu is able to do: co-simulation, no sources."""
    root = ET.fromstring(model_description(shown, shown.guid(computed_with)))
    kept = [element for element in root if element.tag not in ("ModelExchange", "CoSimulation")]
    root[:] = [ET.Element("CoSimulation", {"modelIdentifier": shown.model_identifier, **_ABILITIES}), *kept]
    ET.indent(root, space="  ")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"
