"""The command `lptn report`: the whole story on one page."""

from __future__ import annotations

from pathlib import Path

from lptn.cli.improve import improve
from lptn.cli.options import Holdout, HoldoutAfter, Jobs, Map, Output, Rate, Test


def report(
    model: Path,
    /,
    *logs: Path,
    output: Output,
    holdout: Holdout = None,
    holdout_after: HoldoutAfter = None,
    test: Test = None,
    jobs: Jobs = 1,
    map: Map = None,  # noqa: A002 - the option's name
    rate: Rate = None,
) -> None:
    """Write the whole analysis as one HTML file.

    Logs, fit, where the model fails, what is missing, errors on held-out data.

    Example: lptn report leg.toml monday.parquet --holdout friday.parquet -o story.html
    """
    improve(
        model,
        *logs,
        holdout=holdout,
        holdout_after=holdout_after,
        test=test,
        report=output,
        jobs=jobs,
        map=map,
        rate=rate,
    )
