"""What may stand in a model file: its tables and keys, checked by pydantic."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from lptn.parameters import Share

_MOST = 1e15  # beyond it no quantity of a robot lies, in whatever unit, and squares would overflow
Number = Annotated[float, Field(allow_inf_nan=False, strict=True, ge=-_MOST, le=_MOST)]


class Strict(BaseModel):
    model_config = ConfigDict(extra="forbid")


class ParameterTable(Strict):
    value: Number | None = None
    unit: str | None = None
    bounds: Annotated[list[Number], Field(min_length=2, max_length=2)] | None = None
    share: Share | None = None
    fixed: bool | None = None


Given = Number | ParameterTable


class ModelTable(Strict):
    name: str = "model"
    joints: list[str] = []
    ambient: str | Given | None = None
    step: Annotated[Number, Field(gt=0)] | None = None


class ElementTable(BaseModel):
    model_config = ConfigDict(extra="allow")
    kind: str


class NodeTable(Strict):
    capacity: Given | None = None
    temperature: str | Given | None = None
    element: ElementTable | None = None


class LinkTable(Strict):
    between: Annotated[list[str], Field(min_length=2, max_length=2)]
    resistance: Given | None = None
    perfect: bool = False


class EffectTable(BaseModel):
    model_config = ConfigDict(extra="allow")
    kind: str
    at: str
    share: Share | None = None
    run: Annotated[str, Field(min_length=1)] | None = None
    driven_by: Annotated[str, Field(pattern=r"^[^\s.~*?\[\]{}]+$")] | None = None


class FittedTable(Strict):
    value: Number
    error: float | None = None
    unit: str | None = None


class DataTable(Strict):
    file: str
    sha256: str


class FitTable(Strict):
    rmse: float | None = None
    status: str | None = None
    warnings: list[str] = []
    data: list[DataTable] = []
    parameters: dict[str, FittedTable] = {}


class File(Strict):
    model: ModelTable = ModelTable()
    columns: dict[str, Any] = {}
    nodes: dict[str, NodeTable] = {}
    links: list[LinkTable] = []
    effects: list[EffectTable] = []
    fit: FitTable = FitTable()
