"""Pictures of a co-simulation: the robot with its joints tinted by temperature, curves, and a short film."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from pathlib import Path

import matplotlib.pyplot as plt
import mujoco
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from PIL import Image, ImageDraw

from a1_cosim import FRAME_STEPS, Record
from a1_robot import TIME_STEP, build, joint_geoms
from a1_task import JOINTS, FloatArray

Pixels = npt.NDArray[np.uint8]

COLOURS = LinearSegmentedColormap.from_list("heat", ["#2456a6", "#2a9fb0", "#e8d23c", "#e07b20", "#b3121a"])
SIZE = (480, 640)  # pixels, height and width
BLUE, GREEN, RED, BLACK, GREY = "#1f5fa8", "#2a8a3c", "#c0282d", "#222222", "#777777"
TILES = 1.0  # m, after which the floor repeats
FILM_RATE = 12.5  # frames a second


class Studio:
    """Renders the robot of one record; use it in a `with` statement.

    Args:
        record: a run made with `film=True`.
        limit: temperature that is drawn in full red [degC]; the ambient is full blue.
    """

    def __init__(self, record: Record, limit: float) -> None:
        self._record = record
        self._model = build(record.setting.motor, record.setting.payload)
        self._data = mujoco.MjData(self._model)
        self._geoms = joint_geoms(self._model)
        self._scale = Normalize(record.setting.motor.ambient, limit, clip=True)
        self._renderer = mujoco.Renderer(self._model, *SIZE)
        self._camera = mujoco.MjvCamera()
        self._camera.distance, self._camera.azimuth, self._camera.elevation = 1.15, 125.0, -18.0

    def __enter__(self) -> Studio:
        return self

    def __exit__(self, *_: object) -> None:
        self._renderer.close()

    def picture(self, time: float) -> Pixels:
        """The robot at a time [s], shape (height, width, 3)."""
        record = self._record
        frame = min(round(time / (FRAME_STEPS * TIME_STEP)), len(record.frames) - 1)
        self._data.qpos[:] = record.frames[frame]
        self._data.qpos[0] %= TILES  # the floor is drawn near the origin only, and looks the same everywhere
        mujoco.mj_forward(self._model, self._data)
        self._model.geom_rgba[self._geoms] = COLOURS(self._scale(temperatures(record, time)))
        self._camera.lookat[:] = [self._data.qpos[0], self._data.qpos[1], 0.17]
        self._renderer.update_scene(self._data, self._camera)
        pixels: Pixels = self._renderer.render()
        return pixels


def temperatures(record: Record, time: float) -> FloatArray:
    """Joint temperatures at a time [degC], shape (12,)."""
    return record.temperature[min(int(np.searchsorted(record.time, time)), len(record.time) - 1)]


def overview(records: Sequence[Record], limit: float, path: Path, shots: Sequence[tuple[int, float]]) -> None:
    """Robots above, temperatures below, and MuJoCo's own one-node model beside the network.

    Args:
        records: the runs; the first is drawn blue, the second green, the third grey.
        limit: [degC].
        path: where the PNG goes.
        shots: which run is pictured at which time [s]; those runs need `film=True`.
    """
    figure = plt.figure(figsize=(9.6, 8.4), layout="constrained")
    above, middle, below = np.asarray(figure.subfigures(3, 1, height_ratios=[0.75, 1.0, 1.0]), dtype=object)
    _robots(above, records, limit, shots)
    _limits(middle, records, limit)
    _one_nodes(below, records[0], limit)
    figure.savefig(path, dpi=100)
    plt.close(figure)


def _robots(figure: Figure, records: Sequence[Record], limit: float, shots: Sequence[tuple[int, float]]) -> None:
    axes = figure.subplots(1, len(shots))
    for axis, (index, time) in zip(np.atleast_1d(axes), shots, strict=True):
        with Studio(records[index], limit) as studio:
            axis.imshow(studio.picture(time))
        hottest = temperatures(records[index], time).max()
        axis.set_title(f"{records[index].label}, {time:.0f} s: {hottest:.0f} °C", fontsize=9)
        axis.set_axis_off()
    ambient = records[0].setting.motor.ambient
    shade = ScalarMappable(Normalize(ambient, limit), COLOURS)
    figure.colorbar(shade, ax=axes, label="joint [°C]", extend="max", shrink=0.8, pad=0.01)


def _limits(figure: Figure, records: Sequence[Record], limit: float) -> None:
    hot, move = figure.subplots(1, 2)
    for record, colour in zip(records, (BLUE, GREEN, GREY), strict=False):
        hot.plot(record.time, np.max(record.temperature, axis=1), color=colour, label=record.label)
        move.plot(record.time, [position[0] for position in record.position], color=colour, label=record.label)
        if record.fell is not None:
            hot.plot(record.fell, record.temperature[-1].max(), "x", color=colour, ms=9, mew=2)
            move.plot(record.fell, record.way, "x", color=colour, ms=9, mew=2, label="the robot falls")
        _lying(hot, record)
    _limit_line(hot, limit)
    hot.set(xlabel="time [s]", ylabel="hottest joint [°C]")
    move.set(xlabel="time [s]", ylabel="way [m]")
    for axis in (hot, move):
        axis.legend(fontsize=8, frameon=False)


def _lying(axis: Axes, record: Record) -> None:
    down = np.array([command.activity == "rest" for command in record.command])
    if down.any():
        low, high = axis.get_ylim()
        axis.fill_between(record.time, low, high, where=down, color=GREEN, alpha=0.12, lw=0, label="lying down")
        axis.set_ylim(low, high)


def _one_nodes(figure: Figure, record: Record, limit: float) -> None:
    axes = figure.subplots(1, 3, sharey=True)
    for axis, joint in zip(axes, JOINTS[6:9], strict=True):
        axis.plot(record.time, record.joint(joint), color=BLUE, label="network of 13 nodes")
        axis.plot(record.time, record.joint(joint, "one_node"), "--", color=BLACK, label="MuJoCo's dcmotor, one node")
        axis.set_title(f"{joint}, {record.label}", fontsize=9)
        axis.set_xlabel("time [s]")
        _limit_line(axis, limit)
    axes[0].set_ylabel("temperature [°C]")
    axes[0].legend(fontsize=8, frameon=False)


def _limit_line(axis: Axes, limit: float) -> None:
    axis.axhline(limit, color=RED, lw=1, ls=":", label="limit")


def film(record: Record, limit: float, path: Path, scenes: Sequence[tuple[float, float]]) -> None:
    """Scenes of a run as an animated GIF, in real time, with the time and the hottest joint written on them.

    Args:
        record: a run made with `film=True`.
        limit: [degC].
        path: where the GIF goes.
        scenes: from when to when [s].
    """
    times = np.concatenate([np.arange(start, stop, 1 / FILM_RATE) for start, stop in scenes])
    images = []
    with Studio(record, limit) as studio:
        for time in times:
            image = Image.fromarray(studio.picture(time))
            text = f"{time:6.1f} s   hottest joint {temperatures(record, time).max():.1f} °C   limit {limit:.0f} °C"
            ImageDraw.Draw(image).text((12, SIZE[0] - 26), text, fill=BLACK, font_size=16)
            images.append(image)
    # One palette for all frames, or a joint's colour would jump from frame to frame.
    sample = Image.fromarray(np.vstack([np.asarray(image) for image in images[:: max(1, len(images) // 12)]]))
    palette = sample.quantize(256)
    images = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    images[0].save(path, save_all=True, append_images=images[1:], duration=1000 / FILM_RATE, loop=0)


def compared(records: dict[str, list[Record]], limit: float, path: Path) -> None:
    """The hottest joint and the base's height over time, a column for each scenario, a line for each controller.

    Args:
        records: by scenario.
        limit: of all joints [degC].
        path: the picture.
    """
    labels = [record.label for record in next(iter(records.values()))]
    # Every second line has gaps, so that one beneath it shows.
    looks = {label: {"color": f"C{k}", "ls": "-" if k % 2 else (0, (4, 3))} for k, label in enumerate(labels)}
    figure, axes = plt.subplots(2, len(records), figsize=(4.2 * len(records), 5.8), sharex="col", squeeze=False)
    for column, (name, runs) in enumerate(records.items()):
        upper, lower = axes[:, column]
        for record in runs:
            time, look = np.array(record.time), looks[record.label]
            upper.plot(time, np.array(record.temperature).max(axis=1), **look, label=record.label)
            height = np.array(record.position)[:, 2]
            lower.plot(time, height, **look)
            if record.fell is not None:
                lower.plot(time[-1], height[-1], "x", color=look["color"], ms=9, mew=2)
        upper.axhline(limit, color=BLACK, lw=1, ls="--")
        upper.set_title(name)
        lower.set_xlabel("time [s]")
    axes[0, 0].set_ylabel("hottest joint [degC]")
    axes[1, 0].set_ylabel("base's height [m]; × fell")
    handles, _ = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=ceil(len(labels) / 2), frameon=False)
    figure.tight_layout(rect=(0, 0.08, 1, 1))
    figure.savefig(path, dpi=120)
    plt.close(figure)
