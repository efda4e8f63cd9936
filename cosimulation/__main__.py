"""`python -m cosimulation` is the command `llmn`."""

import sys

try:
    from cosimulation.cli import main
except KeyboardInterrupt:  # while the libraries load, before the command can take care of it
    sys.exit(130)

main()
