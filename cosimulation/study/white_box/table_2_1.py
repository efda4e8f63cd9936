"""Thesis Table 2.1: resonances of step responses of its white-box model [Hz]."""

from __future__ import annotations

STATISTICS = ("min", "max", "mean", "median", "mode")

TABLE: dict[tuple[str, str], tuple[float | None, ...] | None] = {
    ("f_L", "xi_dot"): (3.052, 3.601, 3.256, 3.235, 3.113),
    ("f_L", "zeta_dot"): (3.052, 3.601, 3.264, 3.235, 3.174),
    ("f_L", "F_H"): (3.174, 3.662, 3.325, 3.235, 3.235),
    ("f_L", "F_p"): (3.174, 3.662, 3.332, 3.296, 3.235),
    ("f_M", "xi_dot"): (9.827, 13.184, 12.078, 12.390, None),
    ("f_M", "zeta_dot"): (9.827, 13.123, 12.092, 12.451, None),
    ("f_M", "F_H"): (9.827, 13.184, 12.078, 12.390, None),
    ("f_M", "F_p"): (9.888, 13.245, 12.107, 12.451, None),
    ("f_H", "xi_dot"): (20.752, 23.987, 22.369, 22.827, 23.865),
    ("f_H", "zeta_dot"): (20.691, 23.804, 22.332, 22.705, 22.217),
    ("f_H", "F_H"): (19.592, 23.804, 22.429, 22.705, 23.804),
    ("f_H", "F_p"): None,
}
"""By resonance and signal; None where the thesis found none."""
POSITIONS = ("xi", "zeta")
"""Signals in which it found no resonance at all."""
