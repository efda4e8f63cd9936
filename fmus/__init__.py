"""One folder per FMU: what it is, its parameters, its variables, its own C if it has any."""
