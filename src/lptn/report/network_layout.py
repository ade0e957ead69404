"""Where the nodes of a network stand in its drawing: neighbours near, chains as limbs, no two on one spot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, shortest_path

from lptn.basics.arrays import FloatArray, IntArray
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
    number = {name: place for place, name in enumerate(names)}
    ends = np.array([[number[one], number[other]] for one, other in links], dtype=int).reshape(-1, 2)
    graph = csr_array((np.ones(len(ends)), ends.T), shape=(len(names), len(names)))
    count, parts = connected_components(graph, directed=False)
    steps = shortest_path(graph, directed=False, unweighted=True)
    boxes = np.array([sizes[name] for name in names])
    columns: dict[tuple[str, ...], list[tuple[IntArray, FloatArray]]] = {}  # nodes and their places, by class
    for part in range(count):
        nodes = np.flatnonzero(parts == part)
        inside = steps[np.ix_(nodes, nodes)]
        points = _settled(_tree(graph[nodes][:, nodes], inside), _APART * inside)
        points = _pushed_apart(_level(points) * [_WIDER, 1.0], boxes[nodes])
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


def _tree(graph: csr_array, steps: FloatArray) -> FloatArray:
    """Nodes on circles around the one nearest to all; each has as wide a sector as there are nodes beyond it."""
    middle = int(np.argmin(steps.sum(axis=1)))
    order, above = breadth_first_order(graph, middle, directed=False)
    weight = np.ones(len(order))
    for node in order[:0:-1]:
        weight[above[node]] += weight[node]
    width, begin, free = np.full(len(order), 2 * np.pi), np.zeros(len(order)), np.zeros(len(order))
    for node in order[1:]:
        parent = above[node]
        width[node] = width[parent] * weight[node] / (weight[parent] - 1)
        begin[node] = free[node] = free[parent]
        free[parent] += width[node]
    turn = begin + width / 2
    return np.asarray(_APART * steps[middle][:, None] * np.column_stack([np.cos(turn), np.sin(turn)]))


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
