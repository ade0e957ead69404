"""A fleet's results as a table, a row for each robot."""

from __future__ import annotations

import io
from pathlib import Path

import pandas as pd

from lptn.files import write_whole
from lptn.fleet.each import Fleet
from lptn.fleet.work import Outcome


def table_of(fleet: Fleet) -> pd.DataFrame:
    """One row a robot: status, errors [K], warnings, then value and standard error of each parameter in SI units.

    A standard error is missing where the logs don't determine the parameter; all numbers of a robot that failed are.
    """
    names = list(dict.fromkeys(name for each in fleet.outcomes for name in each.parameters))
    return pd.DataFrame([_row(each, names) for each in fleet.outcomes])


def write_tables(fleet: Fleet, folder: Path) -> None:
    """Write `fleet.csv` and `fleet.parquet`, each whole."""
    table = table_of(fleet)
    write_whole(folder / "fleet.csv", table.to_csv(index=False))
    binary = io.BytesIO()
    table.to_parquet(binary, index=False)
    write_whole(folder / "fleet.parquet", binary.getvalue())


def _row(outcome: Outcome, names: list[str]) -> dict[str, object]:
    row: dict[str, object] = {
        "robot": outcome.robot,
        "fitted": outcome.status in ("fitted", "unchanged"),
        "converged": outcome.converged,
        "search": outcome.result.get("status"),
        "rmse": outcome.rmse,
        "rmse_holdout": _number(outcome.result.get("rmse_holdout")),
        "logs": len(outcome.result.get("data", ())),
        "warnings": "; ".join(outcome.result.get("warnings", ())),
        "message": outcome.message,
    }
    for name in names:
        found = outcome.parameters.get(name, {})
        row[name] = _number(found.get("value"))
        row[f"{name}.error"] = _number(found.get("error"))
    return row


def _number(value: float | None) -> float:
    return float("nan") if value is None else value
