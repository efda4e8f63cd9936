"""Run a job (see jobs.py) in libcosim, which reads FMUs with FMI Library; talks as run_ecos.py does."""

from __future__ import annotations

import json
import sys

from libcosimpy import CosimConstants
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

job = json.load(sys.stdin)
log_output_level(CosimLogLevel.WARNING)
execution = CosimExecution.from_step_size(step_size=round(job["step"] * 1e9))
index, reference = {}, {}
for fmu, path in job["fmus"].items():
    index[fmu] = execution.add_local_slave(CosimLocalSlave(fmu_path=path, instance_name=fmu))
    for variable in execution.slave_variables(index[fmu]):
        reference[f"{fmu}::{variable.name.decode()}"] = (index[fmu], variable.reference)
observer, manipulator = CosimObserver.create_last_value(), CosimManipulator.create_override()
done = [execution.add_observer(observer), execution.add_manipulator(manipulator)]
done += [execution.real_initial_value(*reference[name], value) for name, value in job["starts"].items()]
done += [
    execution.connect_real_variables(*reference[source], *reference[sink]) == CosimConstants.success
    for source, sink in job["connections"]
]
rows = []
for row in job["rows"]:
    for name, value in zip(job["driven"], row, strict=True):
        slave, variable = reference[name]
        done.append(manipulator.slave_real_values(slave, [variable], [value]))
    done.append(execution.step())
    found = [reference[name] for name in job["outputs"]]
    rows.append([observer.last_real_values(slave, [variable])[0] for slave, variable in found])
if not all(done):
    raise RuntimeError(f"call {done.index(False)} of {len(done)} was refused")
print()
print(json.dumps(rows))
