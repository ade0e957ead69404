"""Faces without capacitance taken out of a heat balance, so that no algebraic loop is left in the model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca

_NEWTON_STEPS = 5  # of a law that is not linear at a face; each step squares the error


def without_faces(heat: Mapping[str, ca.SX], faces: Mapping[str, ca.SX], means: Sequence[ca.SX]) -> dict[str, ca.SX]:
    """Heat into each node with the temperatures of the faces, at which heat in equals heat out, put in.

    Where the heat at the faces is linear in their temperatures this is exact. Where it is not (radiation from a
    face), five Newton steps from the elements' mean temperatures take the place of the loop.

    Args:
        heat: heat into each node and face [W].
        faces: symbols of the faces' temperatures.
        means: for each face the mean temperature of its element, where Newton's steps start.
    """
    unknown = ca.vertcat(*faces.values())
    residual = ca.vertcat(*(heat[name] for name in faces))
    slope = ca.jacobian(residual, unknown)
    linear = not ca.depends_on(slope, unknown)
    found = ca.SX.zeros(len(faces)) if linear else ca.vertcat(*means)
    for _ in range(1 if linear else _NEWTON_STEPS):
        left, matrix = ca.substitute([residual, slope], [unknown], [found])
        found = found + _solved(-matrix, left)
    nodes = [name for name in heat if name not in faces]
    flows = ca.substitute(ca.vertcat(*(heat[name] for name in nodes)), unknown, found)
    return dict(zip(nodes, ca.vertsplit(flows), strict=True))


def _solved(matrix: ca.SX, side: ca.SX) -> ca.SX:
    """Solution of a symmetric positive definite system, by sparse LDLᵀ.

    It is definite because every face hangs on its element, and no element takes in work (`lptn.elements.axis`).
    """
    diagonal, upper, order = ca.ldl(matrix)
    return ca.ldl_solve(side, diagonal, upper, order)
