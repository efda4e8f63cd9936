"""Turns a model into an FMU that drops in anywhere."""
