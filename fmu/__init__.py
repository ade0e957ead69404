"""The FMU room: the exporter and its C wrapper live here; installed as `lptn.fmu`."""
