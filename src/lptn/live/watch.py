"""The loop: a source's messages through the sample clock and the estimator to sinks; its state saved and taken up."""

from __future__ import annotations

import io
import json
import math
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Protocol
from zipfile import BadZipFile

import numpy as np
from scipy.special import ndtri

from lptn.basics.arrays import FloatArray
from lptn.basics.bounds import Bound
from lptn.basics.errors import InputError
from lptn.basics.files import bytes_of, fingerprint, write_whole
from lptn.basics.processes import one_blas_thread
from lptn.identify.data import LoadedModel
from lptn.live.assessment import Assessment, Question, Worker, assess
from lptn.live.change import learnt
from lptn.live.messages import Decoder, Numbers
from lptn.live.sampling import GAP, Clock, Columns, Rows, Sampler
from lptn.live.sources import Message, Source
from lptn.live.status import NodeStatus, Status
from lptn.logs.run import Run
from lptn.online.calibration import Calibration
from lptn.online.estimator import Estimator
from lptn.online.fault_bank import Alarm
from lptn.online.forecasting import Forecast, check_limits
from lptn.online.monitoring import THRESHOLD
from lptn.online.present import MEMORY, ModelUncertainty, judge_of_sensors
from lptn.simulate.bound_run import bind

_HISTORY = 2 * MEMORY  # s of rows that are kept: what a forecast looks at, and as much again for faults that creep
_MOST_ROWS = 50_000  # rows of a model with a shorter step: 50 MB for thirty joints
_LEAST_FOR_FORECAST = 60.0  # s of rows from which a forecast can be made
_SHARE = 0.05  # of a processor that assessments may take; the loop takes as much at 1 kHz
_TICK = 0.1  # s that the loop waits for a message
_SAVED = 60.0  # s between two savings of the state
_VERSION, _STATE = 4, "a state that lptn watch saved"  # of the state's file; what it should be
_OF_CLOCK = "last", "received", "shift", "jumps", "late"
_KEPT = "names", "averaged", "step", "since", "period", "last", "taken", "strange", "lasted", "counts"
"""What is saved besides the rows and the filter, as the attributes of the clock and of the watch are called."""
_SIZE = Bound(500_000_000, "bytes")  # of it, ten times what thirty joints fill
_CHANGED, _LASTS = 3.0, 600.0
"""Standard deviations by which something of the model is off, s for which it has been, before the robot is said to have
changed. Of twenty virtual legs nothing was for so long off by more than 0.7; by parts that had changed, by 2 to 5."""
_RAW = "raw:"  # how what samples say of themselves is called among the kept rows, beside what the model makes of it


class Sink(Protocol):
    """Something that shows, or passes on, what is known."""

    def show(self, status: Status) -> None:
        """Take a status; called once a step of the model, never from two threads."""

    def close(self) -> None:
        """Nothing more comes."""


class Watch:
    """A robot watched as it runs.

    Temperatures, their intervals and the trust in each sensor follow every step of the model by one `lptn.Estimator`,
    the filter by which `lptn.forecast` judges sensors. Times to the limits and faults are those of `lptn.forecast` and
    `lptn.monitor` on the last two hours: for a live source by a process of its own, on a twentieth of a processor at
    most; in a log that is replayed at fixed times, so that the answers don't depend on the machine. After a gap
    everything begins anew, as a log is cut there.

    Args:
        loaded: the model file.
        source: what says numbers.
        sinks: what gets each status.
        limits: degC, by node or pattern, or one for all joints that are measured; none: no forecast.
        coverage: of the intervals.
        calibration: of `lptn.monitor`.
        every: s between assessments, at least.
        state: file in which the state is saved each minute and at the end, and taken up again.
        learn: model file that is written at the end: the model with parameters that follow the last two hours, or what
            came since the robot changed, held by twice the standard errors of its fit. Readings of faulty sensors teach
            nothing, nor do any where an input is faulty.

    Raises:
        InputError: the state is of another model, or broken; a limit of what is no place of the model.

    Example:
        >>> import lptn
        >>> from lptn.live import Push, Watch
        >>> loaded = lptn.load_model("examples/tclab/two_heaters.toml")
        >>> source = Push(live=False)
        >>> for k in range(90):
        ...     source.push({"time": k, "T1": 22.0, "T2": 22.0, "Q1": 50.0, "Q2": 0.0})
        >>> source.end()
        >>> last = Watch(loaded, source, limits=60.0).run()
        >>> [node.node for node in last.nodes]
        ['heater1', 'heater2']
    """

    def __init__(
        self,
        loaded: LoadedModel,
        source: Source,
        sinks: Sequence[Sink] = (),
        *,
        limits: float | Mapping[str, float] | None = None,
        coverage: float = 0.9,
        calibration: Calibration | None = None,
        threshold: float = THRESHOLD,
        every: float = 30.0,
        state: Path | None = None,
        learn: Path | None = None,
    ) -> None:
        if not 0 < coverage < 1:
            raise ValueError(f"coverage: found {coverage:g}; expected a share between 0 and 1")
        if not every > 0:
            raise ValueError(f"every: found {every:g}; expected seconds above 0")
        self.loaded, self.model, self.source, self.sinks = loaded, loaded.model, source, list(sinks)
        given = limits if isinstance(limits, Mapping) else {} if limits is None else {"": limits}
        check_limits(given, loaded.model)
        self._question = Question(self.model, loaded.file.fit, given, coverage, threshold, calibration, source.name)
        self._width = float(ndtri(0.5 + coverage / 2))
        self._every, self._state, self._learn = every, state, learn
        self._stop = threading.Event()
        self._decoder = Decoder(source.name)
        self._columns = Columns(loaded, source.name, source.defaults)
        self._clock = Clock(live=source.live)
        self._sampler: Sampler | None = None
        self._learnt, self._unread = 0, list[tuple[Numbers, float]]()  # the first messages, until the columns are known
        self._names = list[str]()  # of the quantities in the rows
        self._rows = deque[FloatArray](maxlen=_MOST_ROWS)  # of the last hours: time [s], then quantities
        self._averaged, self._step = False, loaded.file.step or 1.0
        self._period: float | None = None
        self._estimator: Estimator | None = None
        self._last: dict[str, float] | None = None  # inputs of the newest row that the estimator has
        self._taken = math.nan  # s, where that row begins
        self._resumed: dict[str, FloatArray] = {}  # an estimator's state that was saved
        self._assessment = Assessment(-math.inf)
        self._ahead: Forecast | None = None
        self._earlier = dict[str, Alarm]()
        self._false_inputs = set[str]()  # loads of which the estimator knows that they are false
        self._strange = dict[str, float]()  # what is off in the model, by s since when
        self._lasted, self._why_since = 0.0, math.inf
        """s for which they had when it was last asked what is likely; s from which on it is to be asked next."""
        self._worker = Worker() if source.live else None  # a source that waits is not kept waiting by another process
        self._asked: Future[Assessment] | None = None
        self._since, self._due, self._assessed = math.inf, math.inf, 0
        """s: where what is known begins, when to assess next; how often that was done."""
        self._heard = self._saved = time.monotonic()
        self._counts = dict.fromkeys(("messages", "rows", "gaps"), 0)
        self._events = list[str]()
        self.status: Status | None = None
        """The newest; `None` before the first row."""
        if state is not None and state.exists():
            self._restore(state)

    # --- The loop -----------------------------------------------------------------------------------

    def stop(self) -> None:
        """End the loop cleanly, from any thread or a signal."""
        self._stop.set()

    @one_blas_thread
    def run(self) -> Status:
        """Watch until the source ends, `stop` is called, or SIGINT or SIGTERM comes; the last status.

        Raises:
            InputError: the source's messages lack a quantity, no row was made of any of them, or nothing can be learnt
                of what there is.
        """
        reader = threading.Thread(target=self._read, daemon=True)
        with ExitStack() as stack:
            for sink in self.sinks:
                stack.callback(sink.close)
            stack.enter_context(_signals(self.stop))
            if self._worker is not None:
                stack.callback(self._worker.close)
            stack.callback(self._stop.set)
            reader.start()
            if self._state is not None:
                stack.callback(self._save, self._state)  # whatever happens
            self._loop()
            if not self._stop.is_set():
                self._finish()
        if self.source.inbox.error is not None:
            raise self.source.inbox.error
        if self.status is None:
            found = f"{self._counts['messages']} messages, no row of the model's step"
            raise InputError(self.source.name, "source", self._columns.last_bad or found, "messages for a few steps")
        if self._learn is not None:
            self._write_learnt(self._learn)
        return self.status

    def _loop(self) -> None:
        if self._resumed:
            self._take_assessment(assess(self._question_now()))
        while not self._stop.is_set():
            if self.source.live and not self.source.inbox.closed:
                self._stop.wait(_TICK)  # many messages at once cost less than one after the other
            messages = self.source.inbox.take(_TICK)
            if messages:
                self._take(messages)
            elif self.source.inbox.closed:
                return
            self._look_at_the_clock()

    def _read(self) -> None:
        error: Exception | None = None
        try:
            self.source.run(self._stop)
        except Exception as problem:
            error = problem
        self.source.inbox.close(error)

    def _finish(self) -> None:
        """What a source that ended has left, and what the whole of it says."""
        if self._sampler is None and self._unread:
            self._begin(enough=True)
            self._take([])
        if self._sampler is not None:
            for rows in self._sampler.add(np.zeros(0), {}, end=True):
                self._take_rows(rows)
        if self._rows and self._assessment.time < self._newest:
            self._take_assessment(assess(self._question_now()))
            self._show()

    def _take(self, messages: Sequence[Message]) -> None:
        """Take in what has come."""
        self._counts["messages"] += len(messages)
        self._heard = time.monotonic()
        for received, payload in messages:
            try:
                said = self._decoder.decode(payload) if isinstance(payload, bytes) else payload
            except InputError as error:
                self._columns.bad, self._columns.last_bad = self._columns.bad + 1, str(error)
                continue
            if said is not None:
                self._unread.append((said, received))
        if self._sampler is None and self._unread:
            self._begin()
        if self._sampler is None or not self._unread:
            return
        jumps, silent, bad = self._clock.jumps, self._sampler.missing, self._columns.bad
        raw, received_at = self._columns.values(
            [said for said, _ in self._unread], np.array([received for _, received in self._unread])
        )
        self._unread.clear()
        own = self._clock.of(raw.pop("time"), received_at)
        for rows in self._sampler.add(own, raw):
            self._take_rows(rows)
        if self._columns.bad > bad == 0:
            self._events.append(f"left out: {self._columns.last_bad}")
        if self._clock.jumps > jumps:
            self._events.append(f"the clock of {self.source.name} jumped; it is taken to have gone on by what passed")
        if self._sampler.missing != silent:
            names = ", ".join(self._sampler.missing)
            self._events.append(
                f"silent, so that nothing can be estimated: {names}" if names else "all inputs are back"
            )
            self._show()

    def _begin(self, *, enough: bool = False) -> None:
        """Learn the columns from the first messages."""
        new = [] if enough else self._unread[self._learnt :]
        self._learnt = len(self._unread)
        if notes := self._columns.learn(new, enough=enough):
            self._events += notes
            columns = self._columns
            step = self.loaded.file.step or 1.0
            self._sampler = Sampler(columns.inputs, columns.outputs, columns.sources, step, self._period)

    def _look_at_the_clock(self) -> None:
        """What is due with or without messages."""
        if self._asked is not None and self._asked.done():
            found, self._asked = self._asked.result(), None
            self._take_assessment(found)
        now = time.monotonic()
        if self.source.live and now - self._heard > GAP:
            self._events.append(f"no message of {self.source.name} for {GAP:g} s")
            self._heard = math.inf
            self._show()
        if self._state is not None and now - self._saved > _SAVED:
            self._save(self._state)

    # --- The estimate ---------------------------------------------------------------------------------

    def _take_rows(self, rows: Rows) -> None:
        """Take in complete rows: a status for each, and an assessment where one is due."""
        sampler, names = self._sampler, [*rows.columns, *(f"{_RAW}{key}" for key in rows.raw)]
        gone = set[str]()
        if sampler is not None:
            self._averaged, self._step, self._period = sampler.averaged, sampler.step, sampler.period
            gone = sampler.gone
        if self._names != names:
            self._names, self._rows = names, deque(maxlen=_MOST_ROWS)
        if not self._rows or (rows.first and rows.time[0] - self._newest > GAP + self._step):
            if self._rows:
                self._counts["gaps"] += 1
                silence = f"{rows.time[0] - self._newest:.0f} s without {', '.join(sorted(gone)) or 'messages'}"
                gone.clear()
                self._events.append(f"{silence}: the estimate begins anew")
            self._estimator, self._last, self._ahead = None, None, None
            self._strange.clear()
            self._since = float(rows.time[0])
            self._due = self._since + _LEAST_FOR_FORECAST
        for row in np.column_stack([rows.time, *rows.columns.values(), *rows.raw.values()]):
            self._rows.append(row)
            now, *values = row.tolist()
            while self._rows[0][0] < now - _HISTORY:
                self._rows.popleft()
            self._counts["rows"] += 1
            if self._estimator is not None:
                self._advance(self._estimator, now, dict(zip(names, values, strict=True)))
                self._look_for_change(self._estimator, now)
            if now >= self._due and self._asked is None:
                if self._worker is None:  # nobody waits
                    self._take_assessment(assess(self._question_now()))
                else:
                    self._asked = self._worker.ask(self._question_now())
            self._show()

    def _advance(self, estimator: Estimator, now: float, row: Mapping[str, float]) -> None:
        """Take in a row, a mean in the middle of its step."""
        inputs = {column: row[column] for column in self._columns.inputs}
        readings = {node: row.get(f"temperature.{node}") for node in self.model.nodes}
        last, since = self._last or inputs, now - self._taken if self._last else 0.0
        if self._averaged and self._last:
            estimator.advance(last, since / 2)
            last, since = inputs, since / 2
        estimator.update(last, readings, since)
        self._last, self._taken = inputs, now

    def _look_for_change(self, estimator: Estimator, now: float) -> None:
        """Whether the readings move the model's parameters, or ask for heat, by far more than its fit leaves open; not
        while a sensor or an input is to blame."""
        errors = {} if self._to_blame else estimator.model_errors
        off = {name for name, away in errors.items() if abs(away) > _CHANGED}
        self._strange = {name: self._strange.get(name, now) for name in off}
        since = min(self._strange.values(), default=math.inf)
        if since == math.inf:
            self._lasted = 0.0
        elif now - since >= max(_LASTS, 2 * self._lasted):  # twice the data may say something else
            if not self._lasted:
                when = f"since {since - self._clock.shift:.0f} s"
                self._events.append(f"the robot is not as its model any more, {when}: {', '.join(sorted(off))}")
            self._lasted, self._why_since = now - since, since

    # --- Forecast and monitor -------------------------------------------------------------------------

    @property
    def _newest(self) -> float:
        return float(self._rows[-1][0]) if self._rows else -math.inf

    def _kept(self) -> dict[str, FloatArray]:
        """The rows of the last hours: `time` [s] and quantities, (n,) each."""
        return dict(zip(("time", *self._names), np.array(self._rows).T, strict=True))

    def _question_now(self) -> Question:
        """With samples as they came, or means."""
        kept = self._kept()
        raw = {key.removeprefix(_RAW): kept.pop(key) for key in list(kept) if key.startswith(_RAW)}
        speeds, period = (self._sampler.speeds, self._period or 0.0) if self._sampler is not None else ([], 0.0)
        rows, readings = (kept, raw) if self._averaged else ({"time": kept["time"]} | (raw or kept), {})
        why_since, self._why_since = self._why_since, math.inf
        sensors = self._estimator.sensors if self._estimator is not None else []
        if any(alarm.channel for alarm in self._to_blame):  # which explains, too, that one stands where the model moves
            sensors = []
        stands = {
            node: self._taken + one.since - one.clock
            for node, one in zip(self.model.nodes, sensors, strict=False)
            if one.stands
        }
        return replace(self._question, rows=rows, readings=readings, step=self._step, averaged=self._averaged,
                       speeds=speeds, period=period, stands=stands, why_since=why_since)  # fmt: skip

    def _take_assessment(self, found: Assessment) -> None:
        """Use an assessment; the filter goes on with what it says of noise and of the model."""
        if found.refused is not None and not self._assessed:
            raise found.refused
        pause = max(self._every, found.seconds / _SHARE if self.source.live else 0.0)
        self._due, self._assessed = self._newest + pause, self._assessed + 1
        problem = str(found.refused or found.why_not)
        if problem and problem != str(self._assessment.refused or self._assessment.why_not):
            self._events.append(problem)
        known = set(self._alarms)
        start = float(self._rows[0][0]) if self._rows else math.inf
        self._earlier = {name: alarm for name, alarm in self._alarms.items() if alarm.onset < start}
        self._assessment = found
        for name, alarm in self._alarms.items():
            if name not in known:
                self._events.append(f"{name}: {alarm.words}, since {alarm.onset - self._clock.shift:.0f} s")
        if found.changed is not None:
            likely = "; ".join(found.changed) or "nothing in the catalogue explains it"
            self._events.append(f"likely cause: {likely}")
        if found.uncertainty is not None and found.time >= self._since:  # not from before a gap
            self._ahead = found.forecast or self._ahead
            self._judge_anew(found, found.uncertainty)

    @property
    def _alarms(self) -> dict[str, Alarm]:
        """By channel: the newest, and those whose beginning is forgotten."""
        return self._earlier | {alarm.channel or alarm.node: alarm for alarm in self._assessment.alarms}

    @property
    def _to_blame(self) -> list[Alarm]:
        """Those that leave no doubt whether it is the sensor, the input or the model."""
        return [alarm for alarm in self._alarms.values() if alarm.kind != "undecided"]

    def _judge_anew(self, found: Assessment, uncertainty: ModelUncertainty) -> None:
        """The estimator with the newest noise and errors of the model; at first it takes in all rows since a gap."""
        columns, since = self._kept(), max(self._since, self._newest - MEMORY)
        inside = columns["time"] >= since
        columns = {key: values[inside] for key, values in columns.items()}
        time = columns.pop("time")
        run = Run("live", self._step, time, columns, self._averaged, self.source.name, "",
                  resolution=found.resolution, scatter=found.scatter)  # fmt: skip
        # What a false load said of its joint's heat is taken back: all rows are judged anew without it.
        false = {alarm.channel for alarm in self._to_blame if alarm.channel and alarm.node in self.model.nodes}
        judge = judge_of_sensors(self.model, bind(self.model, run), uncertainty, sorted(false))
        if false != self._false_inputs:
            self._false_inputs, self._estimator = false, None
        before = self._resumed or (self._estimator.state() if self._estimator is not None else {})
        self._resumed = {}
        # Noise that is estimated anew may decide otherwise whether parameters are states, which the log moves.
        if before and before["mean"].size == judge.size:
            judge.restore(before)
        else:
            self._last = None
            rows = zip(*columns.values(), strict=True)
            for now, values in zip(time.tolist(), rows, strict=True):
                self._advance(judge, now, dict(zip(columns, map(float, values), strict=True)))
        self._estimator = judge

    def _write_learnt(self, path: Path) -> None:
        """The model as the last hours have it, into its file."""
        question, alarms = self._question_now(), self._to_blame
        blamed = {alarm.node for alarm in alarms}
        if self._estimator is not None:
            blamed |= set(self._estimator.estimate.untrusted)
        rows = {key: values for key, values in question.rows.items() if key.removeprefix("temperature.") not in blamed}
        if any(alarm.channel for alarm in alarms):
            raise InputError(self.source.name, "--learn", "an input that is at fault", "inputs that can be trusted")
        since = min(self._strange.values()) if self._lasted and self._strange else -math.inf
        runs = replace(question, rows=rows).runs(since)
        self.loaded.file.with_fit(learnt(self.model, question.fit, runs).table()).write(path)

    # --- What is shown ----------------------------------------------------------------------------------

    def _show(self) -> None:
        """Tell all sinks what is known now."""
        if not self._rows:
            return
        counts = self._counts | {
            "dropped": self.source.inbox.dropped, "bad": self._columns.bad,
            "late": self._clock.late, "jumps": self._clock.jumps,
        }  # fmt: skip
        missing = self._sampler.missing if self._sampler is not None else ()
        ago = self._newest - self._assessment.time
        nodes = tuple(self._nodes(ago))
        changed = min(self._strange.values()) - self._clock.shift if self._lasted and self._strange else None
        self.status = Status(
            self._newest - self._clock.shift,
            nodes,
            tuple(self._alarms.values()),
            ago,
            missing,
            counts,
            changed,
            tuple(self._events),
        )
        self._events.clear()
        for sink in self.sinks:
            sink.show(self.status)

    def _nodes(self, ago: float) -> Iterator[NodeStatus]:
        estimator, newest = self._estimator, dict(zip(self._names, self._rows[-1][1:].tolist(), strict=True))
        readings = {place: newest.get(f"temperature.{place}", math.nan) for place in self.model.places}
        if estimator is None:  # the first minute
            for node in self.model.nodes:
                own = readings[node]
                yield NodeStatus(node, own, math.nan, math.nan, own, None, None, None, None, "not yet")
            return
        now, sensors = estimator.estimate, dict(zip(self.model.nodes, estimator.sensors, strict=True))
        doubts = {doubt.node: doubt.why for doubt in self._ahead.doubts} if self._ahead else {}
        for place in self.model.places:
            temperature, deviation = now.temperature(place)
            trust = "none"
            if place in sensors and f"temperature.{place}" in newest:
                proven = "trusted" if sensors[place].once_trusted else "not yet"
                trust = now.untrusted.get(place) or doubts.get(place) or proven
            limit = left = early = late = None
            if ahead := self._ahead.nodes.get(place) if self._ahead else None:  # the time that is left of what was said
                limit = ahead.limit
                early, left, late = (max(x - ago, 0.0) for x in (ahead.low, ahead.time_to_limit, ahead.high))
                left = 0.0 if temperature >= limit else left
            low, high = temperature - self._width * deviation, temperature + self._width * deviation
            yield NodeStatus(place, temperature, low, high, readings[place], limit, left, early, late, trust)

    # --- The state ------------------------------------------------------------------------------------

    def _save(self, path: Path) -> None:
        """Save all that is known, whole or not at all."""
        self._saved = time.monotonic()
        if not self._rows:
            return
        about = {
            "version": _VERSION,
            "model": fingerprint(self.loaded.file.path),
            "clock": {name: getattr(self._clock, name) for name in _OF_CLOCK},
            "alarms": [asdict(alarm) for alarm in self._alarms.values()],
            **{name: getattr(self, f"_{name}") for name in _KEPT},
        }
        about_it = np.frombuffer(json.dumps(about).encode(), dtype=np.uint8)
        arrays: dict[str, Any] = {"about": about_it, "rows": np.array(self._rows)}
        of_filter = self._estimator.state() if self._estimator is not None else self._resumed
        arrays |= {f"estimator/{name}": array for name, array in of_filter.items()}
        stream = io.BytesIO()
        np.savez(stream, **arrays)
        write_whole(path, stream.getvalue())

    def _restore(self, path: Path) -> None:
        """Take up a state that was saved.

        Raises:
            InputError: it is none, or of another model.
        """
        try:
            with np.load(io.BytesIO(bytes_of(path, _SIZE, _STATE)), allow_pickle=False) as file:
                arrays = {name: file[name] for name in file.files}
            about: dict[str, Any] = json.loads(arrays.pop("about").tobytes())
            if about["version"] != _VERSION or about["model"] != fingerprint(self.loaded.file.path):
                problem = "the state of another model, or of another version of it"
                raise InputError(path, "state", problem, "that of this model; delete it to begin anew")
            self._take_up(about, arrays)
        except InputError:
            raise
        except (AttributeError, ValueError, KeyError, TypeError, EOFError, MemoryError, BadZipFile) as error:
            raise InputError(path, "state", "another or a broken file", _STATE) from error

    def _take_up(self, about: Mapping[str, Any], arrays: Mapping[str, FloatArray]) -> None:
        for name in _OF_CLOCK:
            setattr(self._clock, name, about["clock"][name])
        for name in _KEPT:
            setattr(self, f"_{name}", about[name])
        self._earlier = {alarm.channel or alarm.node: alarm for alarm in (Alarm(**one) for one in about["alarms"])}
        self._rows = deque(arrays["rows"], maxlen=_MOST_ROWS)
        self._resumed = {key.removeprefix("estimator/"): x for key, x in arrays.items() if key.startswith("estimator/")}
        self._due = self._newest + self._every
        self._events.append(f"{len(self._rows)} rows taken up from {self._state}")


@contextmanager
def _signals(stop: Callable[[], None]) -> Iterator[None]:
    """Within it SIGINT and SIGTERM end the loop cleanly; only the main thread hears them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    usual = {number: signal.signal(number, lambda *_: stop()) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in usual.items():
            signal.signal(number, handler)
