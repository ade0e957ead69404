"""Tests of the planners' room."""
