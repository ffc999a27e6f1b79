# SPDX-License-Identifier: Apache-2.0
"""Values that are sums of others times numbers."""

from __future__ import annotations

from collections.abc import Callable

from wavecomb.usd.graphs.node import Node, Part, nodes_of

Linear = tuple[dict[tuple[Node, int], float], float]


def linear(part: Part, is_leaf: Callable[[Node], bool]) -> Linear | None:
    """A part as a sum of components of leaves times numbers, and a number; None where it is not."""
    known: dict[tuple[Node, int], Linear | None] = {}

    def of(one: Part) -> Linear | None:
        return ({}, one) if isinstance(one, float) else known[one]

    for node in nodes_of([part]):
        for i in range(node.results):
            if is_leaf(node):
                known[node, i] = {(node, i): 1.0}, 0.0
            elif node.code in _LINEAR:
                known[node, i] = _combined(node.code, *(of(value[i]) for value in node.operands))
            else:
                known[node, i] = None
    return of(part)


def _combined(code: str, a: Linear | None, b: Linear | None) -> Linear | None:
    if a is None or b is None:
        return None
    if code == "multiply" and not a[0]:
        return _scaled(b, a[1])
    if code == "multiply":
        return None if b[0] else _scaled(a, b[1])
    if code == "divide":
        return None if b[0] or b[1] == 0.0 else _scaled(a, 1.0 / b[1])
    return _sum(a, b, 1.0 if code == "add" else -1.0)


_LINEAR = ("add", "subtract", "multiply", "divide")


def _scaled(a: Linear, scale: float) -> Linear:
    return {leaf: k * scale for leaf, k in a[0].items()}, a[1] * scale


def _sum(a: Linear, b: Linear, sign: float) -> Linear:
    terms = dict(a[0])
    for leaf, k in b[0].items():
        terms[leaf] = terms.get(leaf, 0.0) + sign * k
    return terms, a[1] + sign * b[1]
