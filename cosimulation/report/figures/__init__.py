"""Figures of the report, each one a function that returns an inline SVG."""
