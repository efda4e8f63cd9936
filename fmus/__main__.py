"""Build FMUs in their folders: python -m fmus [NAME ...], all without a name; `make fmus`."""

from __future__ import annotations

import sys

from fmu_builder.errors import LlmnError
from fmus import NAMES, rebuild


def main() -> None:
    """Build them one after the other and say which are done."""
    try:
        for name in sys.argv[1:] or NAMES:
            print(rebuild(name).name)
    except LlmnError as error:
        sys.exit("\n".join(f"fmus: {problem}" for problem in error.problems))


if __name__ == "__main__":
    main()
