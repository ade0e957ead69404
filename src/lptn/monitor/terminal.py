"""What `lptn monitor` says."""

from __future__ import annotations

from rich.table import Table

from lptn.monitor.alarms import Alarm
from lptn.monitor.monitoring import Monitoring, Watched
from lptn.terminal import out

_UNITS = {"offset": "K", "drift": "K/s"}


def show_monitoring(found: Monitoring) -> None:
    """A line for each sensor with an alarm: what both detectors say of it, and when."""
    table = Table(box=None, header_style="bold", pad_edge=False)
    for column in ("run", "sensor", "fault", "size", "since", "statistical", f"over {found.threshold:g} K"):
        table.add_column(column, no_wrap=True, overflow="fold")
    for watched in found.runs:
        for cells in _rows(watched):
            table.add_row(*cells)
    if table.row_count:
        out.print(table)
        out.print("Times are in s of each log's clock. The fault is named from some minutes behind the alarm, too.")
    quiet = [watched for watched in found.runs if not (watched.direct or watched.statistical)]
    for watched in quiet:
        node = max(watched.largest, key=watched.largest.__getitem__)
        text = f"{watched.scene.run.name}: no alarm; largest residual {watched.largest[node]:.3g} K, {node}."
        out.print(text, markup=False)
    calibration = found.calibration
    if calibration.hours:
        out.print(f"The statistical detector's limits come from {calibration.hours:.3g} h of healthy logs.")
    else:
        out.print(
            "The statistical detector's limits are guesses: give the logs that the model was fitted on as --healthy."
        )


def _rows(watched: Watched) -> list[list[str]]:
    direct = {alarm.node: alarm for alarm in watched.direct}
    statistical = {alarm.node: alarm for alarm in watched.statistical}
    rows = []
    for node in dict.fromkeys(alarm.node for alarm in (*watched.statistical, *watched.direct)):
        best = statistical.get(node) or direct[node]
        size = "" if best.size is None else f"{best.size:+.2g} {_UNITS[best.kind]}"
        times = [_time(alarms.get(node)) for alarms in (statistical, direct)]
        rows.append([watched.scene.run.name, node, best.kind, size, f"{best.onset:.0f} s", *times])
    return rows


def _time(alarm: Alarm | None) -> str:
    return "–" if alarm is None else f"{alarm.time:.0f} s"
