"""An effect added to a model file, at the size at which it is usually met."""

from __future__ import annotations

from dataclasses import replace
from difflib import get_close_matches

from lptn.effects import catalogue
from lptn.errors import InputError
from lptn.model_file import ModelFile
from lptn.network import EffectDeclaration
from lptn.parameters import Share
from lptn.places import is_glob


def added(file: ModelFile, key: str, at: str) -> ModelFile:
    """The model file with one more effect; where `at` is a pattern, its places share the parameters.

    Raises:
        InputError: no such effect, or it can't stand there.
    """
    kind = catalogue().get(key)
    if kind is None:
        near = get_close_matches(key, catalogue(), n=1, cutoff=0.5)
        raise InputError("add", "EFFECT", f"'{key}'", near[0] if near else f"one of {', '.join(catalogue())}")
    share: Share = "all" if is_glob(at) or "{" in at else "each"
    parameters = tuple(replace(parameter.switched_on, share=share) for parameter in kind.parameters)
    return file.with_effects([EffectDeclaration(kind(), at, parameters)])
