"""The public interface: every argument documented, every return said, every unknown keyword refused."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any

import pytest

import lptn
import lptn.batch
import lptn.fmu
import lptn.planners
from lptn.effects import Effect
from tests.docs.pages import pages

_ROOMS = (lptn, lptn.batch, lptn.fmu, lptn.planners)


def _shown() -> Iterator[tuple[str, str]]:
    """What the pages' Python blocks import from this package."""
    for page in pages():
        for block in page.blocks("python"):
            for node in ast.walk(ast.parse(block)):
                if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("lptn"):
                    yield from ((node.module or "", alias.name) for alias in node.names)


def _public() -> dict[str, Any]:
    names = {(room.__name__, name) for room in _ROOMS for name in room.__all__} | set(_shown())
    public = {f"{module}.{name}": getattr(import_module(module), name) for module, name in sorted(names)}
    return {name: thing for name, thing in public.items() if callable(thing)}


PUBLIC = _public()
every = pytest.mark.parametrize("name", PUBLIC)


def _arguments(thing: Callable[..., object]) -> list[str]:
    kinds = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    parameters = inspect.signature(thing).parameters.values()
    return [
        parameter.name
        for parameter in parameters
        if parameter.kind not in kinds and parameter.name not in ("self", "cls")
    ]


def _documented(text: str) -> set[str]:
    """The names under "Args:", of which one line may hold several: `low, high: …`."""
    section = re.search(r"^ *(?:Args|Attributes):\n(.*?)(?=^ *(?:Returns|Raises|Yields|Source):|\Z)", text, re.M | re.S)
    lines = section[1].splitlines() if section else []
    heads = [line.partition(":")[0] for line in lines if re.match(r" {4,8}[\w*]+(, [\w*]+)*:", line)]
    return {name.strip(" *") for head in heads for name in head.split(",")}


def _methods(thing: object) -> Iterator[tuple[str, Callable[..., object]]]:
    if inspect.isclass(thing):
        for name, method in vars(thing).items():
            if not name.startswith("_") and inspect.isfunction(method):
                yield name, method


def test_the_pages_and_the_front_doors_name_something() -> None:
    assert {"lptn.Model", "lptn.fmu.export", "lptn.planners.TorqueMPC", "lptn.effects.LinkEffect"} <= set(PUBLIC)


@every
def test_every_argument_is_documented(name: str) -> None:
    thing = PUBLIC[name]
    text = inspect.getdoc(thing) or ""
    assert text
    if inspect.isclass(thing):
        text += "\n" + (inspect.getdoc(thing.__init__) or "")
    if inspect.isclass(thing) and issubclass(thing, (Effect, Exception)):
        return
    assert set(_arguments(thing)) <= _documented(text), name


@every
def test_every_public_method_says_what_it_does(name: str) -> None:
    for method, call in _methods(PUBLIC[name]):
        assert inspect.getdoc(call), f"{name}.{method}"


@every
def test_an_unknown_keyword_is_refused(name: str) -> None:
    thing = PUBLIC[name]
    if inspect.isclass(thing) and issubclass(thing, Effect):
        return  # an effect's options are its own: tests/effects/test_contract.py refuses others
    with pytest.raises(TypeError, match=r"nonsense|no keyword"):
        thing(nonsense=1)
