"""ROS 2 bags while they are recorded: what is added to MCAP or sqlite3 files, with the names of finished bags."""

from __future__ import annotations

import sqlite3
from collections import defaultdict
from collections.abc import Iterator
from contextlib import closing, suppress
from io import BytesIO
from math import isfinite
from pathlib import Path
from threading import Event
from typing import Any, BinaryIO, NamedTuple

from lptn.basics.bounds import Bound
from lptn.basics.errors import InputError
from lptn.live.ros import RosSource
from lptn.logs.bag_messages import Decoder, numbers_of
from lptn.logs.bags import BATCH, FIRST_MESSAGES, bounded, store_of
from lptn.logs.tables import require_package

ENDINGS = ".mcap", ".db3"
_PAUSE = 0.1  # s between two looks at a file that has not grown
_RECORD = Bound(1 << 30, "bytes")  # of a file; recorders make chunks of some megabytes
_MAGIC, _HEAD = b"\x89MCAP0\r\n", 9  # an MCAP file's first bytes; bytes before a record: its kind, and its size
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 2, 3, 4, 5, 6  # kinds of records


class Topic(NamedTuple):
    """A topic's name, its messages' type and the definition of that, called as rosbags calls them."""

    topic: str
    msgtype: str
    msgdef: Any


Batch = list[tuple[Topic, int, bytes]]
"""Messages: their topic, ns of reception, bytes."""


class GrowingBag(RosSource):
    """A bag from its beginning, and what its recorder adds; it ends where the recorder has closed it.

    Args:
        path: a `.mcap` or `.db3` file, or a folder of such files that follow each other.

    Raises:
        InputError: there is no such file, or the package rosbags is not installed.
    """

    def __init__(self, path: Path) -> None:
        require_package(path, "rosbags", "a ROS 2 bag", "pip install 'lptn[ros]'")
        super().__init__(str(path), live=False)
        self._path, self._ahead = path, 0  # ns by which header stamps are ahead of the times of reception
        if not self._files():
            found = f"a folder without {' or '.join(ENDINGS)} files" if path.is_dir() else "no such file"
            raise InputError(path, "source", found, "a ROS 2 bag that is recorded: its file, or its folder")
        self._topics, self._store = dict[Topic, None](), store_of(path, [])
        self._decoders = dict[Topic, tuple[dict[str, None], int, Decoder]]()
        """Of each topic: names of its numbers, how many messages were looked at for them, and what reads these."""

    def _files(self) -> list[Path]:
        if not self._path.is_dir():
            return [self._path] if self._path.is_file() else []
        found = (file for file in self._path.iterdir() if file.suffix in ENDINGS)
        return sorted(found, key=lambda file: (len(file.name), file.name))  # log_2 before log_10

    def run(self, stop: Event) -> None:
        number, closes = 0, self._files()[0].parent / "metadata.yaml"  # which a recorder writes at its end
        while number < len(files := self._files()) and not stop.is_set():
            file, closed = files[number], False  # since before the last look
            try:
                for batch in (_of_mcap if file.suffix == ".mcap" else _of_sqlite)(file):
                    if stop.is_set():
                        return
                    if batch:
                        self._tell(batch)
                    elif closed or stop.wait(_PAUSE):
                        break
                    else:
                        closed = number + 1 < len(self._files()) or closes.is_file()
            except InputError:
                raise
            except Exception as error:  # of any kind, by what is wrong with the bytes
                raise InputError(file, "source", f"a broken file ({error})", "a ROS 2 bag") from error
            number += 1
            while self._path.is_dir() and number == len(self._files()) and not closes.is_file():
                if stop.wait(_PAUSE):
                    return

    def _tell(self, batch: Batch) -> None:
        """Say messages in the order of their reception, a topic's decoded at once."""
        by_topic = defaultdict[Topic, list[tuple[int, bytes]]](list)
        for topic, when, raw in batch:
            by_topic[topic].append((when, raw))
        if by_topic.keys() - self._topics.keys():
            self._topics |= dict.fromkeys(by_topic)
            self._store = store_of(self._path, list(self._topics))
        said = [(topic, *one) for topic, messages in by_topic.items() for one in self._numbers(topic, messages)]
        self.inbox.dropped += len(batch) - len(said)
        for topic, when, stamp, numbers in sorted(said, key=lambda one: one[1]):
            self._ahead = stamp - when if stamp else self._ahead
            self.say(topic.topic, topic.msgtype, numbers, (stamp or when + self._ahead) / 1e9)

    def _numbers(self, topic: Topic, messages: list[tuple[int, bytes]]) -> list[tuple[int, int, dict[str, float]]]:
        """Times of reception, header stamps and numbers of a topic's messages, but of broken ones."""
        try:
            raws = [raw for _, raw in messages]
            stamps, values, _ = self._decoder(topic, raws).read(raws)
        except Exception:  # of any kind, by what is wrong with the bytes
            half = len(messages) // 2
            parts = (messages[:half], messages[half:]) if half else ()
            return [one for part in parts for one in self._numbers(topic, part)]
        names, rows = list(self._decoders[topic][0]), zip(messages, stamps.tolist(), values.tolist(), strict=True)
        return [
            (when, stamp, {name: x for name, x in zip(names, row, strict=True) if isfinite(x)})
            for (when, _), stamp, row in rows
        ]

    def _decoder(self, topic: Topic, raws: list[bytes]) -> Decoder:
        names, count, decoder = self._decoders.get(topic, ({}, 0, None))
        if count < FIRST_MESSAGES or decoder is None:
            for raw in raws[: FIRST_MESSAGES - count]:
                names |= dict.fromkeys(numbers_of(self._store, self._store.deserialize_cdr(raw, topic.msgtype)))
            decoder = Decoder(self._store, topic.msgtype, list(names))
            self._decoders[topic] = names, count + len(raws), decoder
        return decoder


def _topic(name: str, kind: str, encoding: str, definition: str) -> Topic:
    from rosbags.interfaces import MessageDefinition, MessageDefinitionFormat

    forms = {"ros2msg": MessageDefinitionFormat.MSG, "ros2idl": MessageDefinitionFormat.IDL}
    return Topic(name, kind, MessageDefinition(forms.get(encoding, MessageDefinitionFormat.NONE), definition))


def _of_mcap(path: Path) -> Iterator[Batch]:
    """Messages as they come, none while no record is complete; ends behind the file's footer."""
    from rosbags.rosbag2.storage_mcap import read_string

    schemas, topics, batch = dict[bytes, tuple[str, ...]](), dict[bytes, Topic](), Batch()
    with path.open("rb") as stream:
        while len(begin := stream.read(len(_MAGIC))) < len(_MAGIC) and _MAGIC.startswith(begin):
            stream.seek(0)
            yield []
        if begin != _MAGIC:
            raise ValueError("its first bytes are not those of an MCAP file")
        while True:
            for kind, content in _records(stream, path):
                number, fields = content[:2], BytesIO(content[2:])
                if kind == _SCHEMA:
                    schemas[number] = tuple(read_string(fields) for _ in range(3))
                elif kind == _CHANNEL:
                    kind_of, form, text = schemas.get(fields.read(2), ("", "", ""))
                    topics[number] = _topic(read_string(fields), kind_of, form, text)
                elif kind == _MESSAGE and number in topics:
                    batch.append((topics[number], int.from_bytes(content[6:14], "little"), content[22:]))
                if len(batch) == BATCH or kind == _FOOTER:
                    yield batch
                    batch = []
                if kind == _FOOTER:
                    return
            yield batch
            batch = []


def _records(stream: BinaryIO, path: Path) -> Iterator[tuple[int, bytes]]:
    """Kind and content of each record that is there, those in chunks, too; what is not yet complete is left."""
    from rosbags.rosbag2.storage_mcap import decompress, read_sized, read_string

    while True:
        at, head = stream.tell(), stream.read(_HEAD)
        _RECORD.check(size := int.from_bytes(head[1:], "little"), path, "log")
        if len(head) < _HEAD or len(content := stream.read(size)) < size:
            stream.seek(at)
            return
        if head[0] != _CHUNK:
            yield head[0], content
            continue
        fields = BytesIO(content[24:])
        crc, method = int.from_bytes(fields.read(4), "little"), read_string(fields)
        with bounded():
            unpacked = decompress(read_sized(fields), method, int.from_bytes(content[16:24], "little"), crc)
        yield from _records(BytesIO(unpacked), path)


def _of_sqlite(path: Path) -> Iterator[Batch]:
    """Messages as they come, none while there are no more."""
    topics, last = dict[int, Topic](), 0
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, timeout=0.0)) as base:
        while True:
            rows = list[tuple[int, int, int, bytes]]()
            with suppress(sqlite3.OperationalError):  # locked just now, or its tables are not made yet
                asked = "SELECT id, topic_id, timestamp, data FROM messages WHERE id > ? ORDER BY id LIMIT ?"
                found = base.execute(asked, (last, BATCH)).fetchall()
                if not {topic for _, topic, *_ in found} <= topics.keys():
                    kinds = dict[str, tuple[str, str]]()
                    with suppress(sqlite3.OperationalError):  # older recorders keep no definitions
                        of_kinds = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
                        kinds = {kind: (form, text) for kind, form, text in base.execute(of_kinds)}
                    for number, name, kind in base.execute("SELECT id, name, type FROM topics"):
                        topics.setdefault(number, _topic(name, kind, *kinds.get(kind, ("", ""))))
                rows = found  # where their topics could not be read, they come with the next look
            last = rows[-1][0] if rows else last
            yield [(topics[topic], when, raw) for _, topic, when, raw in rows if topic in topics]
