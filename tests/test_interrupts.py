"""Ctrl-C at any moment, also while CasADi converts its arguments."""

import os
import signal

import casadi as ca
import pytest

from lptn.interrupts import heard_interrupts


class _Pressed:
    """An argument that presses Ctrl-C while CasADi looks at it."""

    def __float__(self) -> float:
        os.kill(os.getpid(), signal.SIGINT)
        return 1.0

    def __SX__(self) -> ca.SX:  # noqa: N802 - CasADi asks for this name
        os.kill(os.getpid(), signal.SIGINT)
        return ca.SX(1)


def test_an_interrupt_inside_casadi_is_heard_behind_it() -> None:
    x = ca.SX.sym("x")
    double = ca.Function("double", [x], [2 * x])
    results = []
    with pytest.raises(KeyboardInterrupt), heard_interrupts():  # noqa: PT012 - the interrupt comes some time later
        results.append(double(_Pressed()))
        for _ in range(10**9):
            pass
    assert len(results) == 1


def test_an_interrupt_elsewhere_is_heard_at_once_and_the_usual_handler_comes_back() -> None:
    with pytest.raises(KeyboardInterrupt), heard_interrupts():
        os.kill(os.getpid(), signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
