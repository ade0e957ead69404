"""What may stand in a mission's task file: its tables and keys, checked by pydantic, converted to SI."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from lptn.model.file import Number, Strict

from ..values import Celsius, ExtraMass, Length, Seconds, Speed
from .activities import GivesUp

NotNegative = Annotated[Number, Field(ge=0)]
Pieces = Annotated[int, Field(ge=1, le=12, strict=True)]


class TaskTable(Strict):
    kind: Literal["mission"] = "mission"
    name: str = "mission"
    ambient: Celsius = 25.0
    start: Any = None  # a temperature, or one for each of some patterns of nodes
    deadline: Seconds | None = None
    longest_rest: Annotated[Number, Field(ge=0, le=86400)] = 900.0
    carry: ExtraMass = 0.0
    gives_up: GivesUp = "deadline"


class ActivityTable(Strict):
    do: str
    distance: Length | None = None
    duration: Any = None
    speed: Any = None
    load: Any = None
    pieces: Pieces | None = None


class LogTable(Strict):
    file: str
    load: ExtraMass = 0.0
    start: NotNegative = 0.0
    end: Annotated[Number, Field(gt=0)] | None = None


class GaitTable(BaseModel):
    """Further keys are quantities (`torque`, `velocity`, `power`, …): for each pattern of places a table."""

    model_config = ConfigDict(extra="allow")
    speeds: Annotated[list[Speed], Field(min_length=1, max_length=12)] | None = None
    loads: Annotated[list[ExtraMass], Field(min_length=1, max_length=12)] = [0.0]
    logs: Annotated[list[LogTable], Field(min_length=1)] | None = None
    window: Annotated[Number, Field(ge=2, le=600)] = 10.0


class File(Strict):
    task: TaskTable
    limits: Annotated[dict[str, Celsius], Field(min_length=1)]
    activities: Annotated[list[ActivityTable], Field(min_length=1, max_length=24)]
    gaits: dict[str, GaitTable]
    columns: dict[str, Any] = Field(default_factory=dict)


class Between(BaseModel):
    """A number, or the least and the greatest."""

    speed: Speed | Annotated[list[Speed], Field(min_length=2, max_length=2)] | None = None
    load: ExtraMass | Annotated[list[ExtraMass], Field(min_length=2, max_length=2)] | None = None
    duration: Seconds | Annotated[list[NotNegative], Field(min_length=2, max_length=2)] | None = None
