"""The command `lptn plan`: torque, speeds or loads that keep a robot within its temperature limits."""

from __future__ import annotations

from itertools import accumulate
from math import ceil
from pathlib import Path
from typing import Annotated

from lptn import report as drawn
from lptn.cli import options
from lptn.cli.terminal import progress, show_written, write_json

_LINES, _COLUMNS = 14, 80  # of a plan in the answer; the details and the table have all


def plan(
    model: Path,
    task: Path,
    /,
    *,
    output: Annotated[Path | None, options.WRITES] = None,
    details: options.Details = False,
    json: options.Json = None,
    plot: options.Picture = None,
    report: options.HtmlReport = None,
    emit_c: Path | None = None,
) -> None:
    """Plan torque, speeds or loads within limits.

    A task file states what is planned, and the temperature limits.

    Example: lptn plan quadruped.toml track.toml -o plan.csv --json plan.json --plot plan.png

    Args:
        output: Table to write the plan to: .csv or .parquet.
        emit_c: Folder for the controller step as C code for the robot.
    """
    from lptn.basics.tables import write_table
    from lptn.identify.data import load_model
    from lptn.planners.tasks import check_folder, kind_of, load_task

    options.check_outputs(json, report, tables=[output], pictures=[plot], inputs=(model, task))
    table = load_task(task)
    kind = kind_of(table, str(task))
    check_folder(emit_c, kind, str(task))
    asked = kind.read(table, str(task), load_model(model).model)
    with progress("planning"):
        answer = kind.run(asked)
    lines = answer.text().splitlines()
    ends = list(accumulate(max(1, ceil(len(line) / _COLUMNS)) for line in lines))
    kept = len(lines) if details or ends[-1] <= _LINES else sum(end < _LINES for end in ends)
    print(*lines[:kept], *([f"and {len(lines) - kept} more lines: --details"] if kept < len(lines) else []), sep="\n")
    if output is not None:
        write_table(output, answer.table())
    options.write_figure(plot, answer.figure)
    options.write_page(report, lambda: drawn.plan_html(answer, f"{model.stem}: {task.stem}"))
    write_json(json, answer.as_json())
    if emit_c is not None and kind.emit_c is not None:
        kind.emit_c(asked, emit_c)
    show_written({"the plan": output, kind.c_code: emit_c, "open it in a browser": report})
