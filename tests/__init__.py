"""Tests of lptn; a package so that all of them can share `tests.builders`."""
