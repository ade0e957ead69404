"""ROS 2 topics by Zenoh, as `rmw_zenoh` publishes them, without ROS."""

from __future__ import annotations

import json
import os
from threading import Event
from typing import Any

from lptn.basics.errors import InputError
from lptn.live.ros import OWN, READ, RosSource, ros_name, types_of_messages
from lptn.live.sources import LOOPBACK, one_line_if_refused

_ROUTER = 7447  # the port of Zenoh's routers, of that of rmw_zenoh, too


class Zenoh(RosSource):
    """Topics of JointState, DynamicJointState, Temperature, DiagnosticArray and LowState from a Zenoh router.

    Source: rmw_zenoh, docs/design.md: a topic's key is `DOMAIN/TOPIC/TYPE/HASH`, its payload a message in CDR.

    Args:
        address: of the router; '' for the one that the file named by `ZENOH_CONFIG` configures or else loopback.
        domain: number of the ROS domain.

    Raises:
        InputError: a package is not installed, or no router answers there.
    """

    def __init__(self, address: str, domain: int) -> None:
        super().__init__(f"zenoh://{address}:{domain}")
        self._domain = domain
        with one_line_if_refused(self.name, "source", "", "zenoh"):
            import zenoh

            types_of_messages()
        try:
            if address or "ZENOH_CONFIG" not in os.environ:
                config = zenoh.Config()
                config.insert_json5("mode", json.dumps("client"))
                config.insert_json5("scouting/multicast/enabled", "false")
                config.insert_json5("connect/endpoints", json.dumps([f"tcp/{address or LOOPBACK}:{_ROUTER}"]))
            else:
                config = zenoh.Config.from_env()
            self._session = zenoh.open(config)
        except zenoh.ZError as error:
            expected = "a router there: ros2 run rmw_zenoh_cpp rmw_zenohd"
            raise InputError(self.name, "source", str(error).partition(" at /")[0], expected) from error

    def run(self, stop: Event) -> None:
        def hear(sample: Any) -> None:
            _, *topic, kind, _ = str(sample.key_expr).split("/")
            if ros_name(kind) in READ and topic[0] != OWN:
                try:
                    message = types_of_messages().deserialize_cdr(sample.payload.to_bytes(), ros_name(kind))
                except Exception:  # of any kind, by what is wrong with the bytes
                    self.inbox.dropped += 1
                    return
                self.hear(f"/{'/'.join(topic)}", message)

        with self._session:
            self._session.declare_subscriber(f"{self._domain}/*/*/*/**", hear)
            stop.wait()
