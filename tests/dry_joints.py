"""Friction in every joint of the white-box model, each with a torque of its own."""

from __future__ import annotations

DRY = {
    "friction_base": 20.0,
    "friction_knee": 4.0,
    "friction_rod_end": 2.0,
    "friction_rod_foot": 3.0,
    "friction_bend": 1.0,
    "friction_slip_rate": 0.01,
    "friction_stribeck_ratio": 1.4,
    "friction_stribeck_rate": 0.05,
}
"""Torques N.m, rates rad/s: wide passages through rest, which integrators follow closely."""
