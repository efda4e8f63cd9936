"""Run a job (see jobs.py) in ecos: the job as JSON comes in, the rows are the last line that is printed."""

from __future__ import annotations

import ctypes
import json
import sys
from importlib import metadata

# ecos's library links to that of oneTBB, which comes with a Python package beside the loader's folders.
for item in metadata.files("tbb") or ():
    if item.name == "libtbb.so.12":
        ctypes.CDLL(str(item.locate()), mode=ctypes.RTLD_GLOBAL)

import ecospy  # noqa: E402

job = json.load(sys.stdin)
ecospy.EcosLib.set_log_level("warning")
# An SSP, and a parameter set in it, take the place of what the job says of FMUs and their start.
package, values = sys.argv[1:] or (None, "start")
with ecospy.EcosSimulationStructure() as structure:
    for name, path in job["fmus"].items():
        structure.add_model(name, path)
    for source, sink in job["connections"]:
        structure.make_real_connection(source, sink)
    structure.add_parameter_set("start", job["starts"])
    source = {"structure": structure} if package is None else {"ssp_path": package}
    with ecospy.EcosSimulation(step_size=job["step"], **source) as simulation:
        if not simulation.init(parameter_set=values):
            raise RuntimeError(ecospy.EcosLib.get_last_error())
        rows = []
        for row in job["rows"]:
            for name, value in zip(job["driven"], row, strict=True):
                simulation.set_real(name, value)
            simulation.step()
            rows.append([simulation.get_real(name) for name in job["outputs"]])
        simulation.terminate()
print()
print(json.dumps(rows))
