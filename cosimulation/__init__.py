"""Runs FMUs: reference data, validation, reports and the command line."""
