"""Settings that all tests share."""

from __future__ import annotations

import signal

import pytest
from hypothesis import HealthCheck, settings

# The same examples each time: a test that fails today fails tomorrow, on a slow machine as well.
settings.register_profile(
    "repeatable", deadline=None, derandomize=True, max_examples=60, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("repeatable")

# A suite started in the background inherits an ignored Ctrl-C; the tests of Ctrl-C need one that works.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Coverage is measured by short tests and fixtures; the long ones, full of loops, would take two thirds longer."""
    for item in items:
        if item.config.pluginmanager.has_plugin("_cov") and item.get_closest_marker("long"):
            item.add_marker("no_cover")
