"""The catalogue of physical effects: one effect, one file; others come in by the entry point `lptn.effects`.

The room grows by some fifty lines with each effect: its equation, its parameters with reasons, how it shows itself.
"""

from __future__ import annotations

import inspect
import logging
from collections.abc import Iterable
from difflib import get_close_matches
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from pkgutil import iter_modules

from lptn.basics.errors import InputError, one_line
from lptn.effects.base import (
    SITES,
    BoundaryEffect,
    ClockEffect,
    ContactEffect,
    EdgeEffect,
    Effect,
    ExcessEffect,
    GroupEffect,
    InertialEffect,
    LinkEffect,
    LossEffect,
    MassEffect,
    NodeEffect,
    PairSensorEffect,
    SensorEffect,
    Signature,
)

__all__ = [
    "BoundaryEffect", "ClockEffect", "ContactEffect", "EdgeEffect", "Effect", "ExcessEffect", "GroupEffect",
    "InertialEffect", "LinkEffect", "LossEffect", "MassEffect", "NodeEffect", "PairSensorEffect", "SensorEffect",
    "Signature", "catalogue", "effect_named",
]  # fmt: skip

logger = logging.getLogger(__name__)


@cache
def catalogue() -> dict[str, type[Effect]]:
    """Every effect by its key: those of this folder, by what they act on and by name; then those of plug-ins.

    A plug-in that can't be used is left out, with one warning that names it; a key that is taken stays with the first.
    """
    sites = list(SITES)
    built_in = sorted(_of_this_folder(), key=lambda effect: (sites.index(effect.site), effect.key))
    effects = {effect.key: effect for effect in built_in}
    for entry in entry_points(group="lptn.effects"):
        if (effect := _of_plug_in(entry)) is not None:
            effects.setdefault(effect.key, effect)
    return effects


def effect_named(key: str, file: str | Path, place: str) -> type[Effect]:
    """An effect of the catalogue.

    Args:
        key: its key, from outside.
        file: where the key stands, for the message: a file or a command.
        place: where in it.

    Raises:
        InputError: there is none of this key; with those that share a word with it or are spelled like it.
    """
    effects = catalogue()
    if key in effects:
        return effects[key]
    words = {word for word in key.lower().replace("-", "_").split("_") if len(word) > 2}
    typing_error, similar_word = 0.85, 0.5  # difflib's ratio of like letters: only one can be meant; worth offering
    similar = (
        get_close_matches(key, effects, n=1, cutoff=typing_error)
        or [name for name in effects if words & set(name.split("_"))]
        or get_close_matches(key, effects, cutoff=similar_word)
    )
    hint = f"{' or '.join(similar)} (`lptn effects` lists them all)" if similar else f"one of {', '.join(effects)}"
    raise InputError(file, place, f'unknown effect "{key}"', hint)


def _of_this_folder() -> Iterable[type[Effect]]:
    for module in iter_modules(__path__):
        for effect in vars(import_module(f"{__name__}.{module.name}")).values():
            if inspect.isclass(effect) and issubclass(effect, Effect) and "key" in vars(effect):
                yield effect


def _of_plug_in(entry: EntryPoint) -> type[Effect] | None:
    """A plug-in's effect, `None` with a warning if it is none."""
    try:
        effect = entry.load()
        mistake = _mistake(effect)
    except Exception as error:  # whatever a stranger's module raises
        mistake = f"{type(error).__name__}: {error}"
    if mistake:
        logger.warning("plug-in %s (%s) is left out: %s", entry.name, entry.value, one_line(mistake))
        return None
    return effect  # type: ignore[no-any-return]  # `_mistake` has looked


def _mistake(effect: object) -> str:
    """Why an object is no effect, `""` if it is one."""
    if not (inspect.isclass(effect) and issubclass(effect, Effect)):
        return "not a subclass of lptn.effects.Effect"
    lacking = [name for name in ("key", "title", "site", "signature", "source") if not hasattr(effect, name)]
    lacking += sorted(getattr(effect, "__abstractmethods__", ()))
    return f"{effect.__name__} has no {', '.join(lacking)}" if lacking else ""
