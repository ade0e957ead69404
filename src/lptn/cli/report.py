"""The command `lptn report`: the whole story on one page."""

from __future__ import annotations

from pathlib import Path

from lptn.cli import options
from lptn.cli.improve import improve


def report(
    model: Path,
    /,
    *logs: Path,
    output: options.Output,
    data: options.Data = options.DATA,
    test: options.Test = None,
    jobs: options.Jobs = 1,
) -> None:
    """Write the whole analysis as one HTML file.

    Logs, fit, where the model fails, what is missing, errors on held-out data.

    Example: lptn report leg.toml monday.parquet --holdout friday.parquet -o story.html
    """
    improve(model, *logs, data=data, test=test, report=output, jobs=jobs)
