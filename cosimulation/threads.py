"""One thread for linear algebra, in this process and in those it starts."""

import os

_VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


def one_thread_each() -> None:
    """Set the libraries' own variables where nobody has; they are read when numpy is loaded.

    Matrices here are small: threads that wait for one another cost more than they save, many times more on a
    busy machine. Studies run processes side by side instead.
    """
    for variable in _VARIABLES:
        os.environ.setdefault(variable, "1")
