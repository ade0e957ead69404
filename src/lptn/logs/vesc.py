"""Tables that VESC Tool and its kin write: where the quantities of a motor and its drive stand."""

from __future__ import annotations

from collections.abc import Collection

from lptn.logs.columns import ColumnSource

_DAY = 86_400_000  # ms, after which the clock begins anew
VESC = {
    "time": ColumnSource(("ms_today",), "ms", wrap=_DAY),
    "temperature.motor": ColumnSource(("temp_motor",), "degC"),
    "temperature.mosfet": ColumnSource(("temp_mos_max",), "degC"),
    "current.motor": ColumnSource(("d_axis_current", "q_axis_current")),
    "power.battery": ColumnSource(("input_voltage", "current_in"), how="product"),
    "speed.base": ColumnSource(("speed_meters_per_sec",)),
}
"""By quantity, in the units that VESC writes them in. Electrical turns a minute are no speed without the pole pairs."""
_ALWAYS = {"ms_today", "temp_motor", "temp_mos_max"}


def vesc_columns(names: Collection[str]) -> tuple[dict[str, ColumnSource], list[str]]:
    """What is known of a table of these columns, and a note on it; nothing of one that VESC Tool did not write."""
    there = set(names)
    if not there.issuperset(_ALWAYS):
        return {}, []
    known = {key: source for key, source in VESC.items() if there.issuperset(source.columns)}
    note = f"{', '.join(known)}: known by VESC's names"
    return known, [note + ('; its currents are peaks: amperes = "amplitude".' if "current.motor" in known else ".")]
