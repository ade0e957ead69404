"""The command `lptn simulate`: a log's temperatures as the model predicts them."""

from __future__ import annotations

from pathlib import Path

from lptn.cli import options
from lptn.cli.terminal import progress, show_written, write_json


def simulate(
    model: Path,
    log: Path,
    /,
    *,
    output: options.Output,
    json: options.Json = None,
    columns: options.Columns = options.COLUMNS,
) -> None:
    """Predict a log's temperatures, and write them.

    The file is a log itself, .csv or .parquet. Starting temperatures are estimated from the first readings; readings in
    the first row alone fix them.

    Example: lptn simulate fitted.toml friday.parquet -o predicted.csv
    """
    options.check_outputs(json, tables=[output], inputs=(model, log))
    options.check_inputs(model, log)
    from lptn.identify.comparison import write_predictions
    from lptn.study import Study

    with progress("predicting"):
        predicted = Study(model, holdout=log, columns=columns.texts).compare()
        write_predictions(predicted, output)
    write_json(json, predicted.as_json())
    show_written({"predicted temperatures": output})
