"""ROS 2 topics and Unitree's low-level state by DDS, without ROS: what is published is read, what is known written."""

from __future__ import annotations

import os
from threading import Event
from typing import Any

from lptn.basics.errors import InputError
from lptn.live.ros import OWN, READ, RosSource, as_messages, message_types, ros_name
from lptn.live.sources import LOOPBACK, one_line_if_refused
from lptn.live.status import Status

_PAUSE = 0.01  # s between two looks at a topic: Python takes a tenth of that for a message of twenty motors
_LAST_DOMAIN = 232  # a greater one has no port
_WAITING = 50  # diagnostics of other nodes that a look finds at most
_CONFIGURATION = """<CycloneDDS><Domain><General><Interfaces><NetworkInterface address="{address}"/></Interfaces>
</General></Domain></CycloneDDS>"""


class _Participant:
    """A participant of a domain, and the domain where it is configured here.

    Args:
        name: for messages.
        place: what it is there, `source` or `sink`.
        address: of this machine's interface; '' for the one that `CYCLONEDDS_URI` names or else loopback.
        domain: its number.

    Raises:
        InputError: the package is not installed, or there is no such domain or interface.
    """

    def __init__(self, name: str, place: str, address: str, domain: int) -> None:
        if not 0 <= domain <= _LAST_DOMAIN:
            raise InputError(name, place, f"domain {domain}", f"a number from 0 to {_LAST_DOMAIN}")
        with one_line_if_refused(name, place, "", "dds"):
            message_types()
            from cyclonedds.core import DDSException
            from cyclonedds.domain import Domain, DomainParticipant
        try:
            if address or "CYCLONEDDS_URI" not in os.environ:
                at = address or LOOPBACK
                if domain not in _CONFIGURED:
                    _CONFIGURED[domain] = at, Domain(domain, _CONFIGURATION.format(address=at))
                if (other := _CONFIGURED[domain][0]) != at:
                    found = f"domain {domain} at {at}, which this process has at {other}"
                    raise InputError(name, place, found, "one address for a domain, or another domain")
            self.own = DomainParticipant(domain)
        except DDSException as error:
            raise InputError(name, place, str(error), "an interface of this machine, a free domain") from error


_CONFIGURED = dict[int, tuple[str, Any]]()
"""Address and domain by its number: a process can configure each once."""


class Dds(RosSource):
    """Topics of JointState, DynamicJointState, Temperature, DiagnosticArray and LowState, from whoever publishes them.

    Of each topic the newest message counts, a hundred times a second, of diagnostics each.

    Args:
        address: of this machine's interface; '' for the one that `CYCLONEDDS_URI` names or else loopback.
        domain: its number.

    Raises:
        InputError: the package is not installed, or there is no such domain or interface.
    """

    def __init__(self, address: str, domain: int) -> None:
        super().__init__(f"dds://{address}:{domain}")
        self._participant = _Participant(self.name, "source", address, domain).own

    def run(self, stop: Event) -> None:
        from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
        from cyclonedds.core import Policy, Qos
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic

        known, readers = message_types(), dict[str, tuple[Any, int]]()
        publications = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)
        while not stop.wait(_PAUSE):
            for one in publications.take(100):
                kind, topic = (getattr(one, name, None) or "" for name in ("type_name", "topic_name"))  # None of an end
                written_here = topic.startswith(f"rt/{OWN}/")
                if kind in known and ros_name(kind) in READ and topic not in readers and not written_here:
                    kept = _WAITING if kind.endswith("DiagnosticArray_") else 1
                    newest = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(kept))
                    found = Topic(self._participant, topic, known[kind])
                    readers[topic] = DataReader(self._participant, found, newest), kept
            for topic, (reader, kept) in readers.items():
                for message in reader.take(kept):
                    if message.sample_info.valid_data:  # else it says that a publisher has ended
                        self.hear(f"/{topic.removeprefix('rt/')}", message)


class DdsSink:
    """Publishes each status as ROS 2 messages: see `as_messages`.

    Args:
        address, domain: as of `Dds`.

    Raises:
        InputError: as of `Dds`.
    """

    def __init__(self, address: str, domain: int) -> None:
        self._participant = _Participant(f"dds://{address}:{domain}", "sink", address, domain).own
        self._writers = dict[str, Any]()

    def show(self, status: Status) -> None:
        """Publish it."""
        from cyclonedds.core import Policy, Qos
        from cyclonedds.pub import DataWriter
        from cyclonedds.topic import Topic
        from cyclonedds.util import duration

        # As ROS 2 publishes: who asks for reliable messages gets them.
        usual = Qos(Policy.Reliability.Reliable(duration(milliseconds=100)), Policy.History.KeepLast(10))
        for topic, message in as_messages(status):
            if topic not in self._writers:
                of_topic = Topic(self._participant, f"rt{topic}", type(message))
                self._writers[topic] = DataWriter(self._participant, of_topic, usual)
            self._writers[topic].write(message)

    def close(self) -> None:
        """Its topics end."""
        self._writers.clear()
