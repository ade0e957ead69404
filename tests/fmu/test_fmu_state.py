"""States saved, restored and turned into bytes; reset; several instances; threads: always the same to the last bit."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from typing import Any

import numpy as np
import pytest

from lptn.arrays import FloatArray
from lptn.fmu import Session
from tests.fmu.conftest import Build
from tests.fmu.drives import in_kelvin, steps

CASES = [("leg", 2, "rk4"), ("leg", 3, "rk4"), ("everything", 3, "rk4"), ("leg", 3, "ros2")]


@pytest.fixture(params=CASES, ids=lambda case: "-".join(map(str, case)))
def case(request: pytest.FixtureRequest, built: Build) -> tuple[Any, FloatArray]:
    """An FMU and rows of inputs for it."""
    exported = built(*request.param)
    model = exported.component.model
    return exported, in_kelvin(model, np.abs(steps(model, 60)))


def _run(session: Session, rows: FloatArray) -> FloatArray:
    found = []
    for row in rows:
        session.inputs[:] = row
        found.append(session.step(1.3).copy())
    return np.array(found)


def _state(session: Session) -> Any:
    fmu = session._fmu
    return fmu.getFMUstate() if session._fmi == 2 else fmu.getFMUState()


def _restore(session: Session, state: Any) -> None:
    fmu = session._fmu
    (fmu.setFMUstate if session._fmi == 2 else fmu.setFMUState)(state)
    session.time = float(session.read(["time"])[0])


def _bytes(session: Session, state: Any) -> bytes:
    fmu = session._fmu
    return bytes((fmu.serializeFMUstate if session._fmi == 2 else fmu.serializeFMUState)(state))


def _from_bytes(session: Session, content: bytes) -> Any:
    fmu = session._fmu
    return (fmu.deSerializeFMUstate if session._fmi == 2 else fmu.deserializeFMUState)(content)


def test_a_restored_state_goes_on_to_the_last_bit(case: tuple[Any, FloatArray]) -> None:
    exported, rows = case
    with Session(exported.path) as session:
        _run(session, rows[:20])
        state = _state(session)
        first = _run(session, rows[20:])
        _restore(session, state)
        assert (_run(session, rows[20:]) == first).all()


def test_a_state_goes_as_bytes_into_another_instance(case: tuple[Any, FloatArray]) -> None:
    exported, rows = case
    with Session(exported.path) as one, Session(exported.path) as other:
        _run(one, rows[:20])
        content = _bytes(one, _state(one))
        expected = _run(one, rows[20:])
        _restore(other, _from_bytes(other, content))
        assert (_run(other, rows[20:]) == expected).all()


def test_bytes_of_something_else_are_refused(built: Build) -> None:
    with Session(built("leg").path) as session, Session(built("everything").path) as stranger:
        content = bytearray(_bytes(session, _state(session)))
        with pytest.raises(Exception, match="fmi3DeserializeFMUState"):
            _from_bytes(stranger, bytes(content))
        assert "no state" in stranger.messages[-1] or "another FMU" in stranger.messages[-1]
        content[-9] ^= 1
        with pytest.raises(Exception, match="fmi3DeserializeFMUState"):
            _from_bytes(session, bytes(content))
        assert "damaged" in session.messages[-1]


def test_reset_begins_anew(case: tuple[Any, FloatArray]) -> None:
    exported, rows = case
    with Session(exported.path) as session:
        first = _run(session, rows)
        session.write({exported.component.of("parameter")[0].name: 77.0})
        session.reset()
        assert (_run(session, rows) == first).all()


def test_two_instances_do_not_disturb_each_other(case: tuple[Any, FloatArray]) -> None:
    exported, rows = case
    with Session(exported.path) as session:
        alone = [_run(session, rows)]
        session.reset()
        alone.append(_run(session, rows[::-1]))
    with Session(exported.path) as one, Session(exported.path) as other:
        mixed: list[list[FloatArray]] = [[], []]
        for first, second in zip(rows, rows[::-1], strict=True):
            mixed[0].append(_run(one, first[None])[0])
            mixed[1].append(_run(other, second[None])[0])
    assert (np.array(mixed) == np.array(alone)).all()


def test_eight_threads_give_what_one_gives(case: tuple[Any, FloatArray]) -> None:
    exported, rows = case
    many = np.tile(rows, (20, 1))
    scales = np.linspace(0.3, 1.0, 8)
    driven = [np.where(many > 200, many, many * scale) for scale in scales]
    with ExitStack() as stack:
        sessions = [stack.enter_context(Session(exported.path)) for _ in scales]
        with ThreadPoolExecutor(8) as pool:
            together = list(pool.map(_run, sessions, driven))
        for session, expected, inputs in zip(sessions, together, driven, strict=True):
            session.reset()
            assert (_run(session, inputs) == expected).all()
