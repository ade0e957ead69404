"""Where the nodes of a network stand in its drawing: neighbours near, chains as limbs, no two on one spot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.places import class_of

Point = tuple[float, float]

_APART = 92.0  # px between the middles of two linked nodes
_WIDER = 1.4  # names are wider than high: distances across are stretched
_SWEEPS = 300  # of stress majorisation; it has long settled by then for some tens of nodes
_GAP = 30.0  # px between two boxes, so that links and marks have room
_PUSHES = 200


def places_of(names: Sequence[str], links: Sequence[tuple[str, str]], sizes: Mapping[str, Point]) -> dict[str, Point]:
    """The middles of the nodes' boxes [px]; the same network gives the same picture.

    Nodes that are linked are drawn together by stress majorisation, which makes distances in the picture like those in
    the network (Gansner, Koren and North, Graph Drawing by Stress Majorization, 2004). It starts from a tree around
    the node nearest to all others, so that limbs point outward. Parts that no link joins stand side by side, those
    of one class below each other.

    Args:
        names: of the nodes.
        links: pairs of them.
        sizes: width and height of each node's box [px].
    """
    columns: dict[tuple[str, ...], list[dict[str, Point]]] = {}
    for part in _parts(names, links):
        inside = [link for link in links if link[0] in part]
        columns.setdefault(tuple(class_of(name) for name in part), []).append(_part(part, inside, sizes))
    if len(columns) == 1:  # all alike: a row
        (alike,) = columns.values()
        columns = {(str(number),): [part] for number, part in enumerate(alike)}
    placed: dict[str, Point] = {}
    left = 0.0
    for column in columns.values():
        top, right = 0.0, left
        for points in column:
            low, high = _extent(points, sizes)
            for name, (x, y) in points.items():
                placed[name] = (x - low[0] + left, y - low[1] + top)
            top += high[1] - low[1] + 2 * _GAP
            right = max(right, left + high[0] - low[0])
        left = right + 2 * _GAP
    return placed


def _parts(names: Sequence[str], links: Sequence[tuple[str, str]]) -> list[list[str]]:
    """Nodes that links join, directly or through others."""
    root = {name: name for name in names}

    def found(name: str) -> str:
        while root[name] != name:
            name = root[name]
        return name

    for one, other in links:
        root[found(other)] = found(one)
    parts: dict[str, list[str]] = {}
    for name in names:
        parts.setdefault(found(name), []).append(name)
    return list(parts.values())


def _part(names: Sequence[str], links: Sequence[tuple[str, str]], sizes: Mapping[str, Point]) -> dict[str, Point]:
    """Nodes that hang together, around their middle."""
    if len(names) == 1:
        return {names[0]: (0.0, 0.0)}
    near = {name: [other for link in links for other in link if name in link and other != name] for name in names}
    steps = np.array([_steps_from(name, names, near) for name in names])
    points = _settled(_tree(names, near, steps), _APART * steps)
    points = _level(points) * [_WIDER, 1.0]
    return dict(zip(names, map(tuple, _pushed_apart(points, np.array([sizes[name] for name in names]))), strict=True))


def _steps_from(start: str, names: Sequence[str], near: Mapping[str, Sequence[str]]) -> list[float]:
    """How many links lie between a node and each of the others."""
    count, edge = {start: 0.0}, [start]
    while edge:
        edge = list(dict.fromkeys(other for name in edge for other in near[name] if other not in count))
        count |= dict.fromkeys(edge, max(count.values()) + 1)
    return [count[name] for name in names]


def _tree(names: Sequence[str], near: Mapping[str, Sequence[str]], steps: FloatArray) -> FloatArray:
    """Nodes on circles around the one nearest to all; each has as wide a sector as there are nodes beyond it."""
    middle = names[int(np.argmin(steps.sum(axis=1)))]
    below: dict[str, list[str]] = {name: [] for name in names}
    reached, order = {middle}, [middle]
    for name in order:
        for other in dict.fromkeys(near[name]):
            if other not in reached:
                reached.add(other)
                below[name].append(other)
                order.append(other)
    weight = dict.fromkeys(names, 1.0)
    for name in reversed(order):
        weight[name] += sum(weight[other] for other in below[name])
    points, sector = {middle: (0.0, 0.0)}, {middle: (0.0, 2 * np.pi)}
    for name in order:
        begin, end = sector[name]
        whole = sum(weight[other] for other in below[name])
        radius = _APART * (1 + steps[names.index(middle), names.index(name)])
        for other in below[name]:
            width = (end - sector[name][0]) * weight[other] / whole
            sector[other] = (begin, begin + width)
            points[other] = (radius * np.cos(begin + width / 2), radius * np.sin(begin + width / 2))
            begin += width
    return np.array([points[name] for name in names])


def _settled(points: FloatArray, wanted: FloatArray) -> FloatArray:
    """Points whose distances are like those wanted, by stress majorisation with weights 1 / distance²."""
    weights = 1.0 / np.maximum(wanted, 1.0) ** 2
    np.fill_diagonal(weights, 0.0)
    laplacian = np.diag(weights.sum(axis=1)) - weights
    inverse = np.linalg.pinv(laplacian)
    for _ in range(_SWEEPS):
        apart = points[:, None, :] - points[None, :, :]
        distance = np.maximum(np.sqrt((apart**2).sum(axis=2)), 1e-9)
        pull = weights * wanted / distance
        points = inverse @ (np.diag(pull.sum(axis=1)) - pull) @ points
    return points


def _level(points: FloatArray) -> FloatArray:
    """Turned so that the longest extent lies across, the first node left of the last and not below it."""
    points = points - points.mean(axis=0)
    _, size, axes = np.linalg.svd(points, full_matrices=True)
    if size.size > 1 and size[0] > 1.05 * size[1]:  # a round picture keeps the tree's directions
        points = points @ axes.T
    turned = points[0] - points[-1]
    if turned[0] > 1e-6:
        points = points * [-1.0, 1.0]
    if turned[1] > 1e-6:
        points = points * [1.0, -1.0]
    return np.asarray(points, dtype=float)


def _pushed_apart(points: FloatArray, sizes: FloatArray) -> FloatArray:
    """Boxes that touch are moved along the direction in which they overlap least."""
    points = points.copy()
    for _ in range(_PUSHES):
        moved = False
        for one in range(len(points)):
            for other in range(one):
                apart = points[one] - points[other]
                overlap = (sizes[one] + sizes[other]) / 2 + _GAP - np.abs(apart)
                if (overlap > 1e-6).all():
                    axis = int(np.argmin(overlap))
                    shift = 0.5 * overlap[axis] * (1.0 if apart[axis] >= 0 else -1.0)
                    points[one, axis] += shift
                    points[other, axis] -= shift
                    moved = True
        if not moved:
            break
    return points


def _extent(points: Mapping[str, Point], sizes: Mapping[str, Point]) -> tuple[FloatArray, FloatArray]:
    middles = np.array([points[name] for name in points])
    half = np.array([sizes[name] for name in points]) / 2
    return (middles - half).min(axis=0), (middles + half).max(axis=0)
