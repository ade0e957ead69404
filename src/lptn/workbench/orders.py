"""What the page may ask for: each order is one button, with what it says checked before anything is done."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, JsonValue, TypeAdapter, model_validator

_Signal = Annotated[str, Field(min_length=1, max_length=300)]


class _Said(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Plain(_Said):
    """Orders that say all by their name."""

    what: Literal["fit", "diagnose", "improve", "undo", "redo", "use_all", "report", "fmu"]


class Open(_Said):
    """Open an example."""

    what: Literal["example"]
    name: Literal["tclab", "leg"]


class Recent(_Said):
    """Open what was open before, by the name of its folder."""

    what: Literal["recent"]
    name: str = Field(min_length=1, max_length=300)


class Leave(_Said):
    """Leave what is open, for the page that a workbench begins with."""

    what: Literal["leave"]


class Name(_Said):
    """At the desk: look at the files, take all guesses, remove a file, open the study."""

    what: Literal["look", "guesses", "remove", "begin"]
    name: str = Field(default="", max_length=5000)


class _OfLog(_Said):
    log: str = Field(max_length=5000)  # a path may be as long


class Job(_OfLog):
    """Say what a log is for."""

    what: Literal["job"]
    job: Literal["fit", "holdout", "test", "unused"]


class HoldOutAfter(_Said):
    """Hold out the end of each fitted log, from so many seconds after its start; `None` for none."""

    what: Literal["holdout_after"]
    seconds: FiniteFloat | None = Field(gt=0)


class Model(_Said):
    """Make the model file of the logs' columns, of a ready model, or of a URDF on the desk."""

    what: Literal["model"]
    source: str = Field(min_length=1, max_length=300)


class Entry(_Said):
    """Set one value of the model file; `None` takes it away."""

    what: Literal["entry"]
    keys: tuple[str | int, ...] = Field(min_length=2, max_length=6)
    value: JsonValue

    @model_validator(mode="after")
    def _of_the_model(self) -> Entry:
        if self.keys[0] not in ("nodes", "links", "effects"):
            raise ValueError("an entry of nodes, links or effects")
        return self


class Map(_OfLog):
    """Say what a column means, in which unit; nothing, where `key` is empty."""

    what: Literal["map"]
    column: str = Field(min_length=1, max_length=5000)
    key: str = Field(max_length=300)
    unit: str = Field(default="", max_length=50)


class Air(_OfLog):
    """Say how warm the air was throughout a run."""

    what: Literal["air"]
    value: FiniteFloat | Literal["start"]


class Rate(_OfLog):
    """Say how many rows a second a log has that has no times."""

    what: Literal["rate"]
    rate: FiniteFloat = Field(gt=0)


class Remedy(_OfLog):
    """Write the line that `check` proposes."""

    what: Literal["remedy"]
    line: str = Field(min_length=1, max_length=5000)


class _Effect(_Said):
    effect: str = Field(min_length=1, max_length=100)
    at: str = Field(min_length=1, max_length=300)


class Add(_Effect):
    """Add an effect, an answer of the last diagnosis or any other, and fit again."""

    what: Literal["add"]


class Try(_Effect):
    """Fit what `Add` would add, without adding it; `Add` then takes this fit."""

    what: Literal["try"]


class Cut(_Said):
    """Leave a stretch of a run out, hold it out, fit it alone, or use it again."""

    what: Literal["leave_out", "hold_out", "fit_on", "use_again"]
    run: str = Field(max_length=300)
    start: FiniteFloat
    stop: FiniteFloat

    @model_validator(mode="after")
    def _forwards(self) -> Cut:
        if self.stop <= self.start:
            raise ValueError("a stretch ends after it begins")
        return self


class Set(_Said):
    """Set a parameter's value or bounds, fix it or free it, and fit again."""

    what: Literal["set"]
    name: str = Field(min_length=1, max_length=300)
    value: FiniteFloat
    bounds: tuple[FiniteFloat | None, FiniteFloat | None]
    fixed: bool


class Against(_Said):
    """Draw what another study's model says of this one's logs; nothing, where no study is named."""

    what: Literal["against"]
    study: str = Field(max_length=300)


class Back(_Said):
    """Go on from a branch that was left."""

    what: Literal["back"]
    number: int = Field(ge=0)


class Mark(_Said):
    """What a person noted at a moment of a run."""

    run: str = Field(max_length=300)
    time: FiniteFloat  # s, in the log's clock
    text: str = Field(min_length=1, max_length=200)


class Note(_Said):
    """Write something on the study, in place of what stood there; what is not said stays."""

    what: Literal["note"] = "note"
    text: str = Field(default="", max_length=2000)
    tags: tuple[Annotated[str, Field(min_length=1, max_length=40)], ...] = Field(default=(), max_length=20)
    limits: dict[str, FiniteFloat] = Field(default={}, max_length=1000)  # degC, by node
    marks: tuple[Mark, ...] = Field(default=(), max_length=50)
    plots: tuple[Annotated[tuple[_Signal, ...], Field(max_length=20)], ...] = Field(default=(), max_length=20)


class Keep(_Said):
    """Add the steps that a search had found when it was stopped; the session orders it, no page does."""

    what: Literal["keep"] = "keep"
    steps: tuple[tuple[str, str], ...]


AtDesk = Name | Job | HoldOutAfter | Model | Entry | Map | Air | Rate | Remedy
"""What is done with the files that a study is made of."""
Order = Plain | Open | Recent | Leave | Note | Against | Add | Try | Cut | Set | Back | AtDesk
order: TypeAdapter[Order] = TypeAdapter(Annotated[Order, Field(discriminator="what")])
"""Checks what the page sent."""


class StateAsked(_Said):
    """What has changed since a version of the state?"""

    since: int = -1


class ResidualsAsked(_Said):
    """What do the errors of a node in a run look like?"""

    segment: str
    node: str


class SpecialAsked(ResidualsAsked):
    """What is special in a stretch of a run, at a node?"""

    start: FiniteFloat
    stop: FiniteFloat


class NetworkAsked(_Said):
    """What does the network look like at a moment of a run, by default when it is hottest?"""

    segment: str
    time: FiniteFloat | None = None


class LinesAsked(_Said):
    """Which lines plots want: of nodes in one run, and signals of it, from a time to another, so many points each."""

    segment: str
    node: list[str] = Field(default=[], max_length=1000)
    signal: list[str] = Field(default=[], max_length=400)
    start: FiniteFloat | None = None
    stop: FiniteFloat | None = None
    points: int = Field(default=1500, ge=10, le=20000)
    attempt: str = ""  # the name of a model that was tried
