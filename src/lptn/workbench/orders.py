"""What the page may ask for: each order is one button, with what it says checked before anything is done."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, TypeAdapter, model_validator


class _Said(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Plain(_Said):
    """Orders that say all by their name."""

    what: Literal["fit", "diagnose", "improve", "undo", "redo", "use_all", "report", "fmu"]


class Open(_Said):
    """Open an example, where no files were given."""

    what: Literal["example"]
    name: Literal["tclab", "leg"]


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


class Back(_Said):
    """Go on from a branch that was left."""

    what: Literal["back"]
    number: int = Field(ge=0)


class Keep(_Said):
    """Add the steps that a search had found when it was stopped; the session orders it, no page does."""

    what: Literal["keep"] = "keep"
    steps: tuple[tuple[str, str], ...]


Order = Plain | Open | Add | Try | Cut | Set | Back
order: TypeAdapter[Order] = TypeAdapter(Annotated[Order, Field(discriminator="what")])
"""Checks what the page sent."""


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
    """Which lines plots want: of nodes in one run, from a time to another, at most so many points each."""

    segment: str
    node: list[str] = Field(min_length=1, max_length=1000)
    start: FiniteFloat | None = None
    stop: FiniteFloat | None = None
    points: int = Field(default=1500, ge=10, le=20000)
    attempt: str = ""  # the name of a model that was tried
