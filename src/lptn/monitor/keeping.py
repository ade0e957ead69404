"""A calibration kept in a file, so that healthy logs need to be studied only once."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from lptn.errors import InputError
from lptn.files import write_whole
from lptn.model import Model
from lptn.model_mistakes import expectation, found_in, sentence
from lptn.monitor.calibration import Calibration
from lptn.noise import Noise
from lptn.online import ModelError

Size = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Time = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid")


class _Limits(_Strict):
    offset: list[Time]
    drift: list[Time]


class _Noise(_Strict):
    white: list[Size]
    step: list[Size]


class _Error(_Strict):
    heat: Size | dict[str, Size]
    heat_time: Time
    change: Size | dict[str, Size]
    bias: Size | dict[str, Size]
    air: Size
    inputs: dict[str, Size]


class _File(_Strict):
    nodes: list[str]
    healthy_hours: Size
    limits: _Limits
    still: list[Size]
    noise: _Noise
    model_error: _Error


def keep(calibration: Calibration, nodes: Sequence[str], path: Path) -> None:
    """Write a calibration as JSON, whole or not at all."""
    write_whole(path, json.dumps(calibration.as_json(nodes), indent=2) + "\n")


def kept(path: Path, model: Model) -> Calibration:
    """Read a calibration of a model.

    Raises:
        InputError: the file can't be read, is not a calibration, or is one of another model.
    """
    try:
        found = _File.model_validate_json(path.read_bytes())
    except OSError as error:
        expected = "a file written with --healthy before"
        raise InputError(path, "calibration", error.strerror or "no file", expected) from error
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "calibration"
        stands = sentence(first["msg"]) if first["type"] == "json_invalid" else found_in(first)
        expected = "JSON" if first["type"] == "json_invalid" else expectation(first)
        raise InputError(path, place, stands, f"{expected}, as `lptn monitor --healthy` writes it") from error
    lists = (found.still, found.noise.white, found.noise.step, found.limits.offset, found.limits.drift)
    same = all(len(each) == len(model.nodes) for each in lists)
    if found.nodes != model.nodes or not same or not set(found.model_error.inputs) <= set(model.inputs):
        expected = f"those of the model: {', '.join(model.nodes)}"
        raise InputError(path, "nodes", ", ".join(found.nodes) or "none", expected)
    return Calibration(
        Noise(np.array(found.noise.white), np.array(found.noise.step)),
        ModelError(**found.model_error.model_dump()),
        np.array([found.limits.offset, found.limits.drift]),
        np.array(found.still),
        found.healthy_hours,
    )
