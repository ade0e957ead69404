"""The command `lptn trade`: which motor, which gear, how much heat sink."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter as Option

from lptn import report as drawn
from lptn.cli import options
from lptn.cli.terminal import progress, show_table, show_written, write_json

_BEST = 5  # choices in the answer; the details have all


def trade(
    study: Path,
    /,
    *,
    details: options.Details = False,
    json: Annotated[Path | None, Option(name=["--json", "--output", "-o"])] = None,
    plot: options.Picture = None,
    diagram: Path | None = None,
    report: options.HtmlReport = None,
) -> None:
    """Solve a trade study of motor, gear and cooling.

    Best designs, what limits them, the Pareto front, sensitivities.

    Example: lptn trade u8.toml --json result.json --plot study.png

    Args:
        json: JSON file for the result.
        diagram: File for the torque-speed-time diagram: how long each torque can be held at each speed (PNG, SVG, PDF).
    """
    from lptn.planners.trade import load_study, solve_study
    from lptn.planners.trade.answer import as_json, headline, remarks, summary, table
    from lptn.report.text import for_people

    options.check_outputs(json, report, pictures=[plot, diagram], inputs=(study,))
    asked = load_study(study)
    options.check_outputs(json, report, pictures=[plot, diagram], inputs=asked.files)
    with progress("reading") as say:
        result = solve_study(asked, say)
    if not result.designs:
        raise result.infeasible()
    from lptn.planners.trade import figures

    options.write_figure(diagram, lambda: figures.torque_speed_figure(result))
    (choice, *numbers), *rows = table(result, brief=not details)
    heads = [choice, *(for_people(head if head == "active constraints" else f">{head}") for head in numbers)]
    show_table(heads, rows, headline(result), None if details else _BEST)
    for remark in remarks(result) if details else summary(result):
        print(for_people(remark))
    options.write_figure(plot, lambda: figures.study_figure(result))
    options.write_page(report, lambda: drawn.trade_html(result))
    if json is not None:  # its maps and curves take as long as the study
        write_json(json, as_json(result))
    show_written({"open it in a browser": report})
