"""Files of test benches of one rate, written by the packages that others write them with."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from lptn.basics.arrays import FloatArray

Columns = Mapping[str, FloatArray]
"""Columns by name, (rows,) each, `time` [s] among them."""


def write_mdf(path: Path, columns: Columns) -> None:
    from asammdf import MDF, Signal

    file = MDF(version="4.10")
    file.append([Signal(values, columns["time"], name=name) for name, values in columns.items() if name != "time"])
    file.save(path)
    file.close()


def write_tdms(path: Path, columns: Columns) -> None:
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(path) as writer:
        writer.write_segment([ChannelObject("log", name, values) for name, values in columns.items()])


def write_mat(path: Path, columns: Columns) -> None:
    from scipy.io import savemat

    savemat(path, dict(columns), do_compression=True)


def write_hdf5(path: Path, columns: Columns) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        for name, values in columns.items():
            file[name] = values


RECORDED: Mapping[str, Callable[[Path, Columns], None]] = {
    ".mf4": write_mdf,
    ".tdms": write_tdms,
    ".mat": write_mat,
    ".h5": write_hdf5,
}
