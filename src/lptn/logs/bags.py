"""Bags of ROS 2 (folders with sqlite3 or MCAP storage, single .mcap and .db3 files) and ROS 1 (.bag) as tables."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from lptn.basics.arrays import FloatArray, IntArray
from lptn.basics.bounds import Bound
from lptn.basics.errors import InputError
from lptn.logs.bag_messages import COMMON_TYPES, Decoder, deserialized, label_of, numbers_of, quantities
from lptn.logs.streams import ANOTHER_SOURCE, conflicts
from lptn.logs.tables import TIMES_PACKED, UNPACKED, Bounded, Source, Table, require_package, table_of_sources

# --- A bag opened ----------------------------------------------------------------------------------

FIRST_MESSAGES = 20  # messages of a topic that are looked at for names: joints may come in several messages
_WIDEST = 4000  # columns of one topic
_CHANNELS = Bound(2_000, "channels")  # of a bag: a robot's has a hundred; to find so many takes 6 s, twice as many 25
_DEFINITIONS = Bound(10_000_000, "characters that define messages")  # of a bag: they take 30 s; ROS's own have 0.3 M
BATCH = 4096  # messages that are held at a time
_MOST_SOURCES = 20  # of a topic: what changes more often names no source
_KIND = re.compile(r"[A-Za-z]\w*(/[A-Za-z]\w*)+", re.ASCII)
_MEMBER = re.compile(r"[A-Za-z]\w*", re.ASCII)


def open_bag(path: Path) -> Table:
    """Open a bag: one column for each number that its messages hold, such as `/joint_states.effort[FR_calf]`.

    What JointState, DynamicJointState, Temperature, Odometry and TwistStamped messages hold is known by its quantity
    too (`torque.FR_calf`, `temperature.FR_calf`, `speed.base`). Time is that of the header's stamps, or where there are
    none the time of reception.

    Raises:
        InputError: the package rosbags is not installed, or the bag can't be read.
    """
    ros_1 = path.suffix == ".bag"
    words = "ROS 1 bag" if ros_1 else "ROS 2 bag"
    require_package(path, "rosbags", f"a {words}", "pip install 'lptn[ros]'")
    from rosbags import rosbag1, rosbag2

    opened = partial((rosbag1 if ros_1 else rosbag2).Reader, path)
    with bounded(), opened() as reader:
        store = store_of(path, reader.connections, ros_1)
        topics, of_opening = _topics(reader, store, ros_1)
    if not topics:
        raise InputError(path, "log", "no topic whose messages hold numbers", "a bag with joint states or the like")
    # A topic's messages, and those of each source by itself where several have one number.
    parts: dict[str, tuple[_Topic, Hashable]] = {name: (topic, None) for name, topic in topics.items()}
    for name, topic in topics.items():
        if topic.shared:
            parts |= {f"{name}:{number}": (topic, source) for number, source in enumerate(topic.sources, start=1)}
    names, notes = ("time", *(f"{part}.{n}" for part, (topic, _) in parts.items() for n in topic.names)), [*of_opening]

    def sources(wanted: Sequence[str]) -> list[Source]:
        of_all, streams, of_sources = set(wanted), list[Stream](), list[str]()
        with bounded(), opened() as again:
            for part, (topic, source) in parts.items():
                numbers = [name for name in topic.names if f"{part}.{name}" in of_all]
                if not numbers and (of_all != {"time"} or streams):
                    continue
                stream = replace(_stream(again, store, topic, numbers, ros_1), topic=part)
                dumb, said = set(stream.sources) - {source}, list[str]()
                if source is None:
                    dumb, said = _dumb(path, stream, topic.sources)
                of_sources += said
                rows = np.array([one not in dumb for one in stream.sources], dtype=bool)
                kept = {name: getattr(stream, name)[rows] for name in ("stamps", "received", "values")}
                streams.append(replace(stream, **kept))
        stamps, of_clock = one_clock(streams)
        notes[:] = [*of_opening, *of_sources, *of_clock]
        return [
            (own / 1e9, {f"{stream.topic}.{name}": stream.values[:, k] for k, name in enumerate(stream.names)})
            for stream, own in zip(streams, stamps, strict=True)
        ]

    defaults = quantities({name: (topic.kind, topic.names) for name, topic in topics.items()})
    return table_of_sources(path, names, sources, words, defaults=defaults, notes=notes)


@dataclass(frozen=True)
class _Topic:
    """Its messages' type, and of the first of them the names of numbers, the sources, whether two have one number."""

    name: str
    kind: str
    names: list[str]
    sources: list[Hashable]
    shared: bool


@dataclass(frozen=True, eq=False)
class Stream:
    """A topic's messages: header stamps and times of reception, (n,) ns, values, (n, names), and who sent each."""

    topic: str
    names: Sequence[str]
    stamps: IntArray
    received: IntArray
    values: FloatArray
    sources: Sequence[Hashable] = ()


def _stream(reader: Any, store: Any, topic: _Topic, wanted: list[str], ros_1: bool) -> Stream:
    """All of a topic's messages of one type, the wanted numbers of each."""
    decoder = Decoder(store, topic.kind, wanted, ros_1)
    messages = reader.messages(_connections(reader, topic.name, topic.kind))
    stamps, received, values = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], [np.zeros((0, len(wanted)))]
    sources: list[Hashable] = []
    while batch := list(islice(messages, BATCH)):
        own, numbers, labels = decoder.read([bytes(raw) for _, _, raw in batch])
        stamps.append(own)
        received.append(np.array([when for _, when, _ in batch], np.int64))
        values.append(numbers)
        sources += [(channel.id, label) for (channel, _, _), label in zip(batch, labels, strict=True)]
    return Stream(topic.name, wanted, np.concatenate(stamps), np.concatenate(received), np.concatenate(values), sources)


def _dumb(path: Path, stream: Stream, first: Sequence[Hashable]) -> tuple[set[Hashable], list[str]]:
    """Sources of a topic that say zero throughout where another speaks; and notes. The `first` ones have numbers.

    Raises:
        InputError: two sources say different things of one number.
    """
    if len(set(stream.sources)) > _MOST_SOURCES:
        return set(), []
    found = conflicts(stream.names, stream.values, stream.sources)
    for pair, name, silent in found:
        if len(silent) != 1:
            numbers = [first.index(source) + 1 if source in first else 0 for source in pair]
            (channel, (frame, joints)), (channel2, (frame2, joints2)) = cast(Any, pair)
            words = f"joints {', '.join(joints[:3])} … and {', '.join(joints2[:3])} …"
            words = f"frames '{frame}' and '{frame2}'" if frame != frame2 else words
            words = f"connections {channel} and {channel2}" if channel != channel2 else words
            said = f"messages of 2 sources in turn, {words}, which say different things of {name}"
            columns = " or ".join(f'"{stream.topic}:{number}.{name}"' for number in numbers)
            expected = f"one of them, in [columns] as {columns} (behind --map with [] at its end), and so for others"
            raise InputError(path, stream.topic, said, expected if all(numbers) else "a bag of one of them")
    dumb = {source for _, _, silent in found for source in silent}
    left_out = sum(source in dumb for source in stream.sources)
    return dumb, [f"{stream.topic}: {left_out} messages {ANOTHER_SOURCE} hold zeros alone; left out."] if dumb else []


def _connections(reader: Any, topic: str, kind: str) -> list[Any]:
    return [channel for channel in reader.connections if channel.topic == topic and channel.msgtype == kind]


def _topics(reader: Any, store: Any, ros_1: bool) -> tuple[dict[str, _Topic], list[str]]:
    """The topics that hold numbers, and what is left out, a sentence each."""
    from rosbags.serde import SerdeError

    kinds: dict[str, str] = {}
    of_types: dict[str, None] = {}  # notes, each once
    for channel in sorted(reader.connections, key=lambda channel: (channel.topic, channel.id)):
        name, kind = channel.topic, channel.msgtype
        if kind not in store.fielddefs:
            of_types[f"{name}: the bag does not define the type of its messages; left out."] = None
        elif kinds.setdefault(name, kind) != kind:
            of_types[f"{name}: of several types; only messages of {kinds[name]} are read."] = None
    topics, notes = {}, list(of_types)
    for name, kind in kinds.items():
        numbers: dict[str, set[Hashable]] = {}
        sources: dict[Hashable, None] = {}
        try:
            for connection in _connections(reader, name, kind):
                for _, _, raw in islice(reader.messages([connection]), FIRST_MESSAGES):
                    message = deserialized(store, raw, kind, ros_1)
                    source = (connection.id, label_of(message))
                    sources[source] = None
                    for number in islice(numbers_of(store, message), _WIDEST):
                        numbers.setdefault(number, set()).add(source)
        except SerdeError:  # of another version of its type
            notes.append(f"{name}: its messages do not decode as {kind}; left out.")
            continue
        if numbers:
            shared = len(sources) <= _MOST_SOURCES and any(len(of_number) > 1 for of_number in numbers.values())
            topics[name] = _Topic(name, kind, list(numbers)[:_WIDEST], list(sources), shared)
    return topics, notes


def store_of(path: Path, connections: Sequence[Any], ros_1: bool = False) -> Any:
    """Types of ROS 2 itself, those of joint states, and those that a bag defines; one of ROS 1 defines all of its own.

    Raises:
        InputError: the bag at this path has more topics, or more of definitions, than a robot's.
    """
    from rosbags.interfaces import MessageDefinitionFormat
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    _CHANNELS.check(len(connections), path, "log")
    of_types = {channel.msgtype: len(channel.msgdef.data) for channel in connections}
    _DEFINITIONS.check(sum(of_types.values()), path, "log")
    store = get_typestore(Stores.EMPTY if ros_1 else Stores.ROS2_HUMBLE)
    for name, text in ({} if ros_1 else COMMON_TYPES).items():
        store.register(get_types_from_msg(text, name))
    for connection in connections:
        definition = connection.msgdef
        if connection.msgtype in store.fielddefs or definition.format == MessageDefinitionFormat.NONE:
            continue
        # A type that the library can't read costs its own topics and no others.
        with suppress(Exception):
            if definition.format == MessageDefinitionFormat.IDL:
                types = get_types_from_idl(definition.data)
            else:
                types = get_types_from_msg(definition.data, connection.msgtype)
            types = {name: fields for name, fields in types.items() if name not in store.fielddefs}
            if _plain(types):
                store.register(types)
    return store


def _plain(types: Mapping[str, Any]) -> bool:
    """Whether all names are names: the library makes Python code of them, and a log must not bring code of its own."""
    for kind, (constants, members) in types.items():
        used = [*(name for name, *_ in constants), *(name for name, _ in members)]
        if not _KIND.fullmatch(kind) or not all(map(_MEMBER.fullmatch, used)):
            return False
        described: list[Any] = [how for _, how in members]
        while described:
            one = described.pop()
            if isinstance(one, tuple):
                described += one
            elif isinstance(one, str) and not (_KIND.fullmatch(one) or _MEMBER.fullmatch(one)):
                return False
        if not all(isinstance(value, bool | int | float | str) for *_, value in constants):
            return False
    return True


# --- One clock for the topics of a bag: header stamps where there are any, times of reception else ---

_APART = 1_000_000_000  # ns; no message is under way for so long
_BACK = 1_000_000_000  # ns by which a stamp may lie before the one before it: messages overtake each other


def one_clock(streams: Sequence[Stream]) -> tuple[list[IntArray], list[str]]:
    """For each topic the times of its messages, (n,) ns, and what was done.

    Topics without usable header stamps are put on the others' clock by the median difference between stamps and
    reception there.
    """
    written = [stream for stream in streams if stream.stamps.size and stream.stamps.max() > 0]
    stamped = [stream for stream in written if (np.diff(stream.stamps) > -_BACK).all()]
    rest = [stream for stream in streams if stream not in stamped]
    notes, shift, moved = [], 0, ""
    if stamped:
        shift = int(np.median(np.concatenate([stream.stamps - stream.received for stream in stamped])))
        moved = f", moved by {shift / 1e9:.6g} s onto the header stamps' clock"
        notes.append(f"time: from the header stamps of {', '.join(stream.topic for stream in stamped)}.")
        ahead = [int(np.median(stream.stamps - stream.received)) for stream in stamped]
        notes += [  # nobody knows which is right
            f"time: the header stamps of {stream.topic} lie {(own - ahead[0]) / 1e9:+.4g} s from those of "
            f"{stamped[0].topic}, by the times of reception; two clocks, it seems, and nothing was moved."
            for stream, own in zip(stamped, ahead, strict=True)
            if abs(own - ahead[0]) > _APART
        ]
    if rest:
        topics = ", ".join(stream.topic for stream in rest)
        notes.append(f"time: of {topics} the time of reception{moved}; no usable header stamps.")
    return [stream.stamps if stream in stamped else stream.received + shift for stream in streams], notes


# --- Compressed bags decompressed within bounds: a few kilobytes must not fill the memory or the disk ---

_MOST = 1 << 30  # bytes of a chunk, or of a message; recorders make chunks of some megabytes
_RECORD = 400  # bytes that a record of a chunk counts for besides its own: 10 million empty ones take 10 s
_HEAD = 9  # bytes before a record's content: its kind, and its length
_SHARE = 0.5  # of the disk's free space that a bag may take while it is read


@contextmanager
def bounded() -> Iterator[None]:
    """Within it rosbags decompresses no piece beyond 1 GiB or the size that it declares, and all within `UNPACKED`.

    The library has no such option; its own functions are put back afterwards.
    """
    from bz2 import BZ2Decompressor

    from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]
    from rosbags.rosbag1 import reader as reader_1
    from rosbags.rosbag2 import reader, storage_mcap

    left = UNPACKED  # bytes that may still come

    def within(decompressor: Any, data: bytes, size: int, *, records: bool = True) -> bytes:
        """Data decompressed, one frame of at most `size` bytes; a ValueError if it is more, or is cut off."""
        nonlocal left
        if not 0 <= size <= _MOST:
            raise ValueError(f"{size} bytes in one piece, of which {_MOST} at most are taken")
        left += TIMES_PACKED * len(data)
        most = min(size, left)
        unpacked: bytes = decompressor.decompress(bytes(data), max_length=most + 1)
        left, at = left - len(unpacked), 0
        while records and at < len(unpacked) and left >= 0:
            left -= _RECORD
            at += _HEAD + int.from_bytes(unpacked[at + 1 : at + _HEAD], "little")
        if left < 0:
            bound = f"{UNPACKED / 1e9:g} GB and {TIMES_PACKED} times their size"
            raise ValueError(f"pieces that unfold to more than {bound}")
        if len(unpacked) > size:
            raise ValueError(f"a piece of more than the {size} bytes that it may have")
        if not decompressor.eof:
            raise ValueError("a compressed piece that is cut off")
        return unpacked

    def opened(stream: Any, mode: str) -> Bounded:
        """A bag that is compressed as a whole, which the library unpacks to the disk."""
        free = int(_SHARE * shutil.disk_usage(tempfile.gettempdir()).free)
        size = max(UNPACKED, TIMES_PACKED * os.fstat(stream.fileno()).st_size)
        found = "half of the disk's free space" if free < size else f"{size / 1e9:g} GB"
        return Bounded(zstd.open(stream, mode), min(free, size), ValueError(f"a compressed file of more than {found}"))

    chunks, chunks_1 = cast("list[dict[str, Any]]", [storage_mcap.DECOMPRESSORS, reader_1.decompressors])
    usual, usual_1 = dict(chunks), dict(chunks_1)
    zstd: Any = getattr(reader, "zstd", None)  # older versions use another package: only their lz4 is bounded
    chunks["lz4"] = lambda data, size: within(LZ4FrameDecompressor(), data, size)
    chunks_1["lz4"] = lambda data: within(LZ4FrameDecompressor(), data, _MOST, records=False)
    chunks_1["bz2"] = lambda data: within(BZ2Decompressor(), data, _MOST, records=False)
    if zstd is not None:
        chunks["zstd"] = lambda data, size: within(zstd.ZstdDecompressor(), data, size)
        whole = partial(within, size=_MOST, records=False)
        vars(reader)["zstd"] = SimpleNamespace(
            decompress=lambda data: whole(zstd.ZstdDecompressor(), data), open=opened
        )
    try:
        yield
    finally:
        chunks.update(usual)
        chunks_1.update(usual_1)
        if zstd is not None:
            vars(reader)["zstd"] = zstd
