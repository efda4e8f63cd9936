"""What an FMU must satisfy to drop in anywhere: ours or anybody's."""

from fmu_builder.check.archive import inspect_archive, unpack
from fmu_builder.check.finding import Finding, Report, Severity
from fmu_builder.check.sources import check_image
from fmu_builder.check.whole import Options, check_fmu

__all__ = [
    "Finding",
    "Options",
    "Report",
    "Severity",
    "check_fmu",
    "check_image",
    "inspect_archive",
    "unpack",
]
