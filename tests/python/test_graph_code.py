# SPDX-License-Identifier: Apache-2.0
"""Tests value graphs: operations, folding, registers, and agreement with NumPy."""

from __future__ import annotations

import random

import numpy as np
import pytest
from graph_reference import FORMULAS, evaluate

from wavecomb import _core
from wavecomb.usd.graphs import values
from wavecomb.usd.graphs.surface_parameters import linear
from wavecomb.usd.graphs.values import (
    INPUTS,
    POINT_SIZE,
    Expressions,
    GraphTooLarge,
    assemble,
    is_constant,
    numbers,
)

CONTINUOUS = [c for c in FORMULAS if c not in ("modulo", "less", "equal", "floor", "sign")]
JUMPS = ["modulo", "less", "floor", "sign"]
ARITY = {c: f.__code__.co_argcount for c, f in FORMULAS.items() if hasattr(f, "__code__")}
ARITY |= {"min": 2, "max": 2, "atan2": 2, "abs": 1, "floor": 1, "sign": 1, "sin": 1, "cos": 1}


def points(count, seed=1, reach=3.0):
    rng = np.random.default_rng(seed)
    return rng.uniform(-reach, reach, (count, POINT_SIZE)).astype(np.float32)


def run(value, at, lanes=1):
    return assemble(dict(enumerate(value))).run(at, lanes)


def check(value, at, rtol=2e-4, atol=2e-4, part=1.0):
    """Compares a value with NumPy; packet and scalar evaluation must give the same bits."""
    scalar, packet = run(value, at, 1), run(value, at, 16)
    assert scalar.tobytes() == packet.tobytes()
    expected = evaluate(value, at)
    close = np.isclose(scalar, expected, rtol=rtol, atol=atol).all(axis=1)
    assert close.mean() >= part, (scalar[~close][:3], expected[~close][:3], at[~close][:3])


@pytest.mark.parametrize("code", sorted(FORMULAS))
def test_operations_by_component(code):
    make = Expressions()
    operands = [make.input(name) for name in ("position", "normal", "view")][: ARITY[code]]
    at = points(997)
    if code == "equal":
        at[::2, 9:12] = at[::2, 3:6]
    # Single precision may fall on the other side of a discontinuity.
    check(make.op(code, *operands), at, part=0.999 if code in JUMPS else 1.0)


def test_extremes_are_what_they_are_said_to_be():
    make = Expressions()
    x, y = make.input("position")[:1], make.input("normal")[:1]
    at = np.zeros((4, POINT_SIZE), np.float32)
    at[:, 3], at[:, 9] = (1, 0, -2, -2), (0, 0, 2, -1)
    value = (
        tuple(make.op(code, x, y)[0] for code in ("divide", "modulo", "power", "atan2"))
        + make.op("log", x)
        + make.op("sqrt", x)
    )
    result = run(value, at)
    assert np.isfinite(result).all()
    assert result[:, 0].tolist() == [0, 0, -1, 2]
    assert result[:, 1].tolist() == [0, 0, 0, 0]
    assert result[:, 2].tolist() == [1, 1, 0, 0]
    assert result[1, 3] == 0 and result[1, 5] == 0 and result[2, 5] == 0


@pytest.mark.parametrize(
    ("code", "place", "widths", "number", "rest"),
    [
        ("noise2", "uv", (1, 2, 3, 4), 0, ()),
        ("noise3", "position", (1, 2, 3, 4), 0, ()),
        ("fractal3", "position", (1, 2, 3, 4), 3, ((2.1,), (0.4,))),
        ("cell2", "uv", (1, 3), 0, ()),
        ("cell3", "position", (1, 3), 0, ()),
        ("worley2", "uv", (1, 2, 3), 0, ((0.9,),)),
        ("worley3", "position", (1, 2, 3), 0, ((0.7,),)),
        ("worley2", "uv", (1,), 1, ((0.9,),)),
        ("worley3", "position", (1,), 1, ((0.7,),)),
    ],
)
def test_noise(code, place, widths, number, rest):
    at = points(501, reach=20.0)
    for width in widths:
        make = Expressions()
        value = make.op(
            code, make.input(place), *(numbers(*v) for v in rest), number=number, width=width
        )
        # Points on the edge of a cell may belong to its neighbour.
        check(value, at, rtol=1e-3, atol=1e-3, part=0.995)
        assert run(value, at).std() > 0.05


def test_vectors_and_colours():
    make = Expressions()
    p, n = make.input("position"), make.input("normal")
    at = points(500)
    check(make.op("dot", p, n), at)
    check(make.op("cross", p, n), at)
    check(make.op("dot", p[:2], n[1:]), at)
    at[:, 3:6] = np.abs(at[:, 3:6])
    check(make.op("rgbtohsv", p), at)
    at[:, 3:6] /= 3
    check(make.op("hsvtorgb", p), at)
    back = make.op("hsvtorgb", make.op("rgbtohsv", p))
    assert np.allclose(run(back, at), at[:, 3:6], atol=1e-5)
    inputs = tuple(make.input(name)[0] for name in INPUTS)
    check(inputs, at)


def random_value(rng, make, leaves, size, codes):
    """Returns a graph of `size` operations on vectors of all widths, with swizzles."""
    values = list(leaves)
    for _ in range(size):
        code = rng.choice(codes)
        operands = [rng.choice(values) for _ in range(ARITY[code])]
        width = max(len(v) for v in operands)
        mixed = [
            tuple(rng.choice(v) for _ in range(width)) if rng.random() < 0.5 or len(v) > 1 else v
            for v in operands
        ]
        value = make.op(code, *mixed)
        # Small values keep rounding errors small.
        values.append(make.op("clamp", value, numbers(-4.0), numbers(4.0)))
    return values[-1] + values[-2][:1]


CALM = ["add", "subtract", "multiply", "min", "max", "mix", "clamp", "abs", "sin", "cos"]


@pytest.mark.parametrize("seed", range(40))
def test_random_graphs_are_what_numpy_says(seed):
    rng = random.Random(seed)
    make = Expressions()
    leaves = [make.input(n) for n in ("uv", "position", "normal", "view")]
    leaves += [numbers(rng.uniform(-2, 2)), numbers(*(rng.uniform(-2, 2) for _ in range(3)))]
    leaves += [numbers(0.0), numbers(1.0), numbers(1.0, 0.0, 0.5, 1.0)]
    value = random_value(rng, make, leaves, rng.randrange(2, 40), CALM)
    check(value, points(100, seed), rtol=5e-3, atol=5e-3, part=0.97)


@pytest.mark.parametrize("seed", range(30))
def test_what_is_folded_is_what_would_be_computed(seed):
    """Constant folding gives the same bits as evaluation with inputs of the same values."""
    rng = random.Random(1000 + seed)
    at = points(1, seed)
    folding, computing = Expressions(), Expressions()
    names = ("position", "normal", "tangent", "view")
    columns = (3, 9, 15, 18)
    constants = [numbers(*at[0, c : c + 3]) for c in columns]
    size, state = rng.randrange(2, 30), rng.getstate()
    codes = [*CONTINUOUS, *JUMPS]
    folded = random_value(rng, folding, constants, size, codes)
    rng.setstate(state)
    open_value = random_value(rng, computing, [computing.input(n) for n in names], size, codes)
    assert is_constant(folded)
    result = run(open_value, at)[0]
    assert np.array_equal(np.float32(folded), result), (folded, result)


def test_what_needs_no_operation_has_none():
    make = Expressions()
    p = make.input("position")
    zero, one = numbers(0.0), numbers(1.0)
    assert make.op("add", p, zero) == p == make.op("multiply", one, p)
    assert make.op("multiply", p, zero) == numbers(0.0, 0.0, 0.0)
    assert make.op("mix", p, make.input("normal"), zero) == p
    assert make.op("select", one, p, zero) == p
    assert make.op("power", p, one) == p == make.op("divide", p, one)
    value = make.op("multiply", p, numbers(2.0, 0.0, 1.0))
    assert value[1] == 0.0 and value[2] == p[2]
    assert is_constant(make.op("add", numbers(1.0, 2.0), numbers(3.0)))
    assert make.op("add", numbers(1.0, 2.0), numbers(3.0)) == (4.0, 5.0)


def test_sums_that_fork_and_meet_are_short():
    """A value added to itself 60 times has 2^60 paths, but is evaluated once."""
    make = Expressions()
    uv = make.input("uv")
    value = uv
    for _ in range(60):
        value = make.op("add", value, value)
    terms, constant = linear(value[0], lambda node: node.code == "input")
    assert terms == {uv[0]: 2.0**60} and constant == 0.0
    deep = uv
    for _ in range(3000):
        deep = make.op("add", deep, numbers(0.5))
    assert linear(deep[1], lambda node: node.code == "input") == ({uv[1]: 1.0}, 1500.0)
    assert linear(make.op("sin", uv)[0], lambda node: node.code == "input") is None


def test_equal_operations_are_one_and_dead_ones_none():
    make = Expressions()
    p = make.input("position")
    a = make.op("sin", make.op("add", p, numbers(1.0)))
    b = make.op("sin", make.op("add", p, numbers(1.0)))
    make.op("noise3", p, width=3)
    graph = assemble(dict(enumerate(make.op("add", a, b))))
    assert graph.count == 4


def test_registers_are_used_again():
    make = Expressions()
    value = make.input("position")
    for i in range(400):
        value = make.op("sin", make.op("add", value, numbers(0.1 * i)))
    graph = assemble(dict(enumerate(value)))
    assert graph.count == 800
    top = np.frombuffer(graph.ops, values._OP)["to"].max()
    assert top < 12


def test_too_many_values_at_once_are_refused():
    make = Expressions()
    p = make.input("position")
    parts = [make.op("noise3", make.op("add", p, numbers(float(i))), width=3) for i in range(60)]
    with pytest.raises(GraphTooLarge, match="values at once"):
        assemble({i: value[0] for i, value in enumerate(parts)})


def test_programs_that_read_what_is_not_there_are_refused():
    builder = _core.SceneBuilder()
    make = Expressions()
    graph = assemble(dict(enumerate(make.op("sin", make.input("position")))))
    builder.add_graph(graph.ops, graph.constants, graph.images, graph.outputs)
    ops = np.frombuffer(graph.ops, values._OP)

    def changed(**fields):
        other = ops.copy()
        for name, value in fields.items():
            other[name][1] = value
        return other.tobytes()

    for bad, match in (
        (changed(code=200), "unknown operation"),
        (changed(width=9), "wrong size"),
        (changed(to=126), "too many values"),
        (changed(operands=50), "operand that does not exist"),
        (changed(operands=0x8000), "operand that does not exist"),
        (changed(to=1), "overwrites its operand"),
    ):
        with pytest.raises(ValueError, match=match):
            builder.add_graph(bad, graph.constants, graph.images, graph.outputs)
    with pytest.raises(ValueError, match="drives no parameter"):
        builder.add_graph(graph.ops, graph.constants, graph.images, [(4000, 0)])
    image = assemble({0: make.image(3, make.input("uv"), 1.0)[0]})
    with pytest.raises(ValueError, match="image that was never added"):
        builder.add_graph(image.ops, image.constants, image.images, image.outputs)
    with pytest.raises(ValueError, match="graph that was never added"):
        builder.add_material("openpbr", graph=7)
