"""Small matrix products on one thread: several threads wait for each other longer than they work."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


@cache
def _libraries() -> ThreadpoolController:
    return ThreadpoolController()


def one_blas_thread(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """The same function, its matrix products on one thread.

    The products of a fit are many and narrow. With a busy machine, or with fits side by side in processes, a
    threaded BLAS was measured to take ten times as long.
    """

    @wraps(function)
    def alone(*arguments: Arguments.args, **named: Arguments.kwargs) -> Result:
        with _libraries().limit(limits=1, user_api="blas"):
            return function(*arguments, **named)

    return alone
