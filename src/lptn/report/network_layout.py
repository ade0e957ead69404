"""Where the nodes of a network stand in its drawing: neighbours near, chains as limbs, no two on one spot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, shortest_path

from lptn.basics.arrays import FloatArray, IntArray
from lptn.basics.places import class_of

Point = tuple[float, float]

_APART = 92.0  # px between the middles of two linked nodes
_WIDER = 1.4  # names are wider than high: distances across are stretched
_TIE = 1e-3  # share by which distances differ from node to node
_SWEEPS = 300  # of stress majorisation; it has long settled by then for some tens of nodes
_GAP = 30.0  # px between two boxes, so that links and marks have room
_PUSHES = 200


def places_of(names: Sequence[str], links: Sequence[tuple[str, str]], sizes: Mapping[str, Point]) -> dict[str, Point]:
    """The middles of the nodes' boxes [px]; the same network gives the same picture.

    Nodes that are linked are drawn together by stress majorisation, which makes distances in the picture like those in
    the network (Gansner, Koren and North, Graph Drawing by Stress Majorization, 2004). Parts that no link joins stand
    side by side, those of one class below each other.

    Args:
        names: of the nodes.
        links: pairs of them.
        sizes: width and height of each node's box [px].
    """
    number = {name: place for place, name in enumerate(names)}
    ends = np.array([[number[one], number[other]] for one, other in links], dtype=int).reshape(-1, 2)
    graph = csr_array((np.ones(len(ends)), ends.T), shape=(len(names), len(names)))
    count, parts = connected_components(graph, directed=False)
    steps = shortest_path(graph, directed=False, unweighted=True)
    boxes = np.array([sizes[name] for name in names])
    columns: dict[tuple[str, ...], list[tuple[IntArray, FloatArray]]] = {}  # nodes and their places, by class
    for part in range(count):
        nodes = np.flatnonzero(parts == part)
        wanted = _APART * steps[np.ix_(nodes, nodes)]
        points = _pushed_apart(_settled(_scaled(wanted), wanted) * [_WIDER, 1.0], boxes[nodes])
        columns.setdefault(tuple(class_of(names[node]) for node in nodes.tolist()), []).append((nodes, points))
    if len(columns) == 1:  # all alike: a row
        (alike,) = columns.values()
        columns = {(str(number),): [part] for number, part in enumerate(alike)}
    placed = np.zeros((len(names), 2))
    left = 0.0
    for column in columns.values():
        top, right = 0.0, left
        for nodes, points in column:
            low, high = (points - boxes[nodes] / 2).min(axis=0), (points + boxes[nodes] / 2).max(axis=0)
            placed[nodes] = points - low + [left, top]
            top += high[1] - low[1] + 2 * _GAP
            right = max(right, left + high[0] - low[0])
        left = right + 2 * _GAP
    return {name: (x, y) for name, (x, y) in zip(names, placed.tolist(), strict=True)}


def _scaled(wanted: FloatArray) -> FloatArray:
    """Points whose distances are nearly those wanted: classical scaling (Torgerson, 1952).

    Where limbs are alike, distances that differ a little by the nodes' numbers say which lies where.
    """
    number = np.arange(len(wanted))
    square = (wanted * (1 + _TIE * (number[:, None] + number))) ** 2
    centred = square - square.mean(axis=0) - square.mean(axis=1)[:, None] + square.mean()
    size, axes = np.linalg.eigh(-centred / 2)
    points = np.zeros((len(wanted), 2))
    points[:, : size.size] = (axes * np.sqrt(np.maximum(size, 0.0)))[:, :-3:-1]
    return points


def _settled(points: FloatArray, wanted: FloatArray) -> FloatArray:
    """Points whose distances are like those wanted, by stress majorisation with weights 1 / distance²; the longest
    extent lies across, and the first node left of the last and not below it.
    """
    weights = 1.0 / np.maximum(wanted, 1.0) ** 2
    np.fill_diagonal(weights, 0.0)
    laplacian = np.diag(weights.sum(axis=1)) - weights
    inverse = np.linalg.pinv(laplacian)
    for _ in range(_SWEEPS):
        apart = points[:, None, :] - points[None, :, :]
        distance = np.maximum(np.sqrt((apart**2).sum(axis=2)), 1e-9)
        pull = weights * wanted / distance
        points = inverse @ (np.diag(pull.sum(axis=1)) - pull) @ points
    points = points @ np.linalg.svd(points - points.mean(axis=0))[2].T
    return np.asarray(points * np.where(points[0] - points[-1] > 1e-6, -1.0, 1.0))


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
