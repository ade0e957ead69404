"""Ctrl-C at any moment, also while CasADi converts its arguments; each in a process of its own."""

import subprocess
import sys

INSIDE_CASADI = """
import os, signal
import casadi as ca
from lptn.basics.processes import heard_interrupts

signal.signal(signal.SIGINT, signal.default_int_handler)

class Pressed:
    def press(self):
        os.kill(os.getpid(), signal.SIGINT)
    def __float__(self):
        self.press()
        return 1.0
    def __SX__(self):
        self.press()
        return ca.SX(1)

x = ca.SX.sym("x")
double = ca.Function("double", [x], [2 * x])
results = []
try:
    with heard_interrupts():
        results.append(double(Pressed()))
        for _ in range(10**9):
            pass
except KeyboardInterrupt:
    print("heard behind", len(results))
"""

WHILE_HELD_BACK = INSIDE_CASADI.replace(
    "class Pressed:",
    """
import threading
usual_start, started = threading.Timer.start, []

def start(timer):  # the first timer runs out before its start is over, as on a busy machine
    started.append(timer)
    timer.function(*timer.args) if len(started) == 1 else usual_start(timer)

threading.Timer.start = start

class Pressed:""",
)

ELSEWHERE = """
import os, signal
from lptn.basics.processes import heard_interrupts

signal.signal(signal.SIGINT, signal.default_int_handler)
try:
    with heard_interrupts():
        os.kill(os.getpid(), signal.SIGINT)
        print("too late")
except KeyboardInterrupt:
    print("heard", signal.getsignal(signal.SIGINT) is signal.default_int_handler)
"""


def _said(code: str) -> str:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60).stdout


def test_an_interrupt_inside_casadi_is_heard_behind_it() -> None:
    assert _said(INSIDE_CASADI) == "heard behind 1\n"


def test_an_interrupt_while_another_is_held_back_is_held_back_too() -> None:
    assert _said(WHILE_HELD_BACK) == "heard behind 1\n"


def test_an_interrupt_elsewhere_is_heard_at_once_and_the_usual_handler_comes_back() -> None:
    assert _said(ELSEWHERE) == "heard True\n"
