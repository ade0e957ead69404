"""Diagnosis: which effect is missing, where, how sure, what else would look the same, and the next experiment."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
