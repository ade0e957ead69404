"""Lumped-parameter thermal networks of electric robot joints: the names most people need, loaded when used."""

from importlib.metadata import version

import lazy_loader

# CasADi alone takes a third of a second to import: a program that only reads logs should not wait for it.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__version__ = version("lptn")
