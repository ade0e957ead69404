"""Times as people write them: dates, clocks of the day, durations."""

from __future__ import annotations

import pandas as pd

# Hours, minutes and seconds; or minutes and seconds, which only a fraction tells from hours and minutes.
_CLOCK = (
    r"\s*(?:(?P<hours>\d+):(?P<of_hour>\d\d):(?P<seconds>\d\d(?:[.,]\d*)?)|(?P<minutes>\d+):(?P<rest>\d\d[.,]\d+))\s*"
)
# The year last: 23.11.2026 14:05:03, 11/23/2026 2:05:03 PM.
_YEAR_LAST = (
    r"\s*(?P<one>\d{1,2})(?P<sign>[./-])(?P<two>\d{1,2})[./-](?P<year>\d{4})[T ,]+"
    r"(?P<hour>\d{1,2}):(?P<minute>\d\d)(?::(?P<second>\d\d(?:[.,]\d*)?))?\s*(?P<half>[aApP])?\.?[mM]?\.?\s*"
)


def times_of(series: pd.Series) -> pd.Series | None:
    """Text in which every cell is a time, as durations in s or as dates; `None` for other text.

    Either a date as ISO 8601 writes it, in UTC if it names no zone; a date with the year last; or a time such as
    0:12:30 or 12:30.5. Of a date with the year last nothing may tell the day from the month. With points the day comes
    first. With strokes it is what makes the log the shorter: there is no 23rd month, from one midnight to the next no
    month passes, and while the date stays both are the same.
    """
    if not len(series):
        return None
    text = series.astype("str")
    clock = text.str.extract(f"^{_CLOCK}$").apply(_numbers)
    seconds = 3600 * clock["hours"] + 60 * clock["of_hour"] + clock["seconds"]
    seconds = seconds.fillna(60 * clock["minutes"] + clock["rest"])
    if not seconds.isna().any():
        return seconds
    dates = pd.to_datetime(series, errors="coerce", utc=True, format="ISO8601")
    if not dates.isna().any():
        return dates
    parts = text.str.extract(f"^{_YEAR_LAST}$")
    numbers = parts[["one", "two", "year", "hour", "minute"]].apply(_numbers)
    if numbers.isna().to_numpy().any():
        return None
    half = parts["half"].str.lower()
    hours = numbers["hour"].where(half.isna(), numbers["hour"] % 12) + 12 * (half == "p")
    of_day = pd.to_timedelta(3600 * hours + 60 * numbers["minute"] + _numbers(parts["second"]).fillna(0.0), unit="s")
    orders = [("one", "two")] if (parts["sign"] == ".").all() else [("one", "two"), ("two", "one")]
    days = [numbers.rename(columns={day: "day", month: "month"})[["year", "month", "day"]] for day, month in orders]
    readings = [pd.to_datetime(parts, errors="coerce", utc=True) + of_day for parts in days]
    whole = (dates for dates in readings if not dates.isna().any())
    return min(whole, key=lambda dates: dates.max() - dates.min(), default=None)


def _numbers(column: pd.Series) -> pd.Series:
    return column.str.replace(",", ".").astype("float64")
