"""`python -m cosimulation` is the command `llmn`."""

from cosimulation.cli import main

main()
