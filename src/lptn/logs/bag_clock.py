"""One clock for the topics of a bag: header stamps where there are any, times of reception else."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lptn.arrays import IntArray
from lptn.logs.bag_messages import Stream

_APART = 1_000_000_000  # ns; no message is under way for so long
_BACK = 1_000_000_000  # ns by which a stamp may lie before the one before it: messages overtake each other


def one_clock(streams: Sequence[Stream]) -> tuple[list[IntArray], list[str]]:
    """For each topic the times of its messages, (n,) ns, and what was done.

    Topics without usable header stamps are put on the others' clock by the median difference between stamps and
    reception there.
    """
    stamped = [stream for stream in streams if _usable(stream.stamps)]
    notes = []
    if stamped:
        offset = int(np.median(np.concatenate([stream.stamps - stream.received for stream in stamped])))
        notes.append(f"time: from the header stamps of {_listed(stamped)}.")
        notes += _disagreeing(stamped)
    rest = [stream for stream in streams if not _usable(stream.stamps)]
    if rest:
        moved = f", moved by {offset / 1e9:.6g} s onto the header stamps' clock" if stamped else ""
        notes.append(f"time: of {_listed(rest)} the time of reception{moved}; no usable header stamps.")
    shift = offset if stamped else 0
    return [stream.stamps if stream in stamped else stream.received + shift for stream in streams], notes


def _disagreeing(stamped: Sequence[Stream]) -> list[str]:
    """What to say of topics whose stamps come from another clock than the first one's; nobody knows which is right."""
    ahead = [int(np.median(stream.stamps - stream.received)) for stream in stamped]
    return [
        f"time: the header stamps of {stream.topic} lie {(own - ahead[0]) / 1e9:+.4g} s from those of "
        f"{stamped[0].topic}, by the times of reception; two clocks, it seems, and nothing was moved."
        for stream, own in zip(stamped, ahead, strict=True)
        if abs(own - ahead[0]) > _APART
    ]


def _usable(stamps: IntArray) -> bool:
    return bool(stamps.size and stamps.max() > 0 and (np.diff(stamps) > -_BACK).all())


def _listed(streams: Sequence[Stream]) -> str:
    return ", ".join(stream.topic for stream in streams)
