# SPDX-License-Identifier: Apache-2.0
"""The outline of a stage is checked as all is that comes from a sandbox: a stage, or one line."""

from __future__ import annotations

import copy
import json
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from parts import needs
from pxr import Sdf, Tf, Usd

from wavecomb.run.boxed.outline import digest, of_outline, read_outline
from wavecomb.run.boxed.wire import Refused, packed
from wavecomb.usd.stage.outline import MOST_NESTING, NOTHING
from wavecomb.usd.stage.outline_layer import NOWHERE, layer_of
from wavecomb.usd.stage.outline_of import outline_of

pytestmark = needs("wavecomb._core")

TEXT = """#usda 1.0
(
    defaultPrim = "World"
    upAxis = "Z"
)
def Xform "World" (
    variants = { string look = "a" }
    prepend variantSets = "look"
)
{
    variantSet "look" = {
        "a" {
        }
        "b" {
        }
    }
    def Xform "One" (
        instanceable = true
        prepend references = </Part>
    )
    {
    }
    def Xform "Two" (
        instanceable = true
        prepend references = </Part>
    )
    {
        token visibility = "invisible"
    }
    def PointInstancer "Dots"
    {
        int[] protoIndices = [0, 0, 0]
    }
}
class Xform "Part"
{
    def Sphere "Ball" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {
        rel material:binding = </Part/M>
        rel material:binding:preview = </Part/M> (
            bindMaterialAs = "strongerThanDescendants"
        )
    }
    def Material "M"
    {
        token outputs:surface.connect = </Part/M/S.outputs:surface>
        def Shader "S"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0.5, 0.25, 1)
            float[] inputs:knots = [0, 1]
            asset inputs:file = @/etc/a.usdz[b.png]@ (
                colorSpace = "raw"
            )
            matrix4d inputs:m = ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))
            int2 inputs:pair = (3, 4)
            bool inputs:on = 1
            token outputs:surface
        }
    }
    def RectLight "L"
    {
        float inputs:intensity = 4
        double3 xformOp:translate = (1, 2, 3)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
"""


@pytest.fixture(scope="module")
def good() -> tuple[dict[str, Any], list[Any]]:
    """The body of a message and its arrays."""
    layer = Sdf.Layer.CreateAnonymous("good.usda")
    layer.ImportFromString(TEXT)
    arrays: list[Any] = []
    outline = outline_of(Usd.Stage.Open(layer), Usd.TimeCode.EarliestTime())
    return json.loads(json.dumps(packed(of_outline(outline), arrays))), arrays


def built(value: Any, arrays: list[Any]) -> Usd.Stage:
    """The stage of a message."""
    outline = read_outline(value, arrays)
    return Usd.Stage.Open(layer_of(outline, Path("/no/stage.usda"), digest(outline)))


def test_what_is_in_it(good: tuple[dict[str, Any], list[Any]]) -> None:
    stage = built(*good)
    assert [one.GetName() for one in stage.GetPrimAtPath("/World").GetChildren()] == [
        "One", "Two", "Dots",
    ]  # fmt: skip
    shader = stage.GetPrimAtPath("/World/Two/M/S")
    assert shader.IsInstanceProxy()
    file = shader.GetAttribute("inputs:file")
    assert file.Get().path == NOWHERE + "/etc/a.usdz/b.png" and not file.Get().resolvedPath
    assert file.GetColorSpace() == "raw"
    assert shader.GetAttribute("inputs:diffuseColor").Get() == (0.5, 0.25, 1)
    assert list(shader.GetAttribute("inputs:knots").Get()) == [0, 1]
    assert shader.GetAttribute("inputs:pair").Get() == (3, 4)
    assert stage.GetPrimAtPath("/World/Two").GetAttribute("visibility").Get() == "invisible"
    ball = stage.GetPrimAtPath("/World/One/Ball")
    assert ball.GetRelationship("material:binding").GetTargets() == ["/World/One/M"]
    assert not ball.GetAttribute("points").HasAuthoredValue()


def change(body: dict[str, Any], arrays: list[Any], name: str, value: Any) -> None:
    """Another value in a message; of an array: its entries, or a whole one."""
    if isinstance(value, np.ndarray):
        arrays.append(value)
        value = {"array": len(arrays) - 1}
    elif name in body and isinstance(body[name], dict) and "array" in body[name]:
        at, new = value
        column = arrays[body[name]["array"]].copy()
        column[at] = new
        arrays.append(column)
        value = {"array": len(arrays) - 1}
    body[name] = value


def ids(*values: int) -> Any:
    return np.array(values, np.uint32)


def attribute(**other: Any) -> list[Any]:
    """An attribute of the first prim."""
    one = {"prim": 0, "name": "inputs:a", "type": "float", "uniform": False, "value": 1.0,
           "connections": [], "space": ""}  # fmt: skip
    return [list((one | other).values())]


def names(*found: str) -> Any:
    return np.frombuffer("\n".join(found).encode(), np.uint8)


CHAIN = MOST_NESTING + 1

BAD: list[tuple[dict[str, Any], str]] = [
    ({"extra": 1}, "a parameter 'extra'"),
    ({"holder": "a/b"}, "something for the name of a prim"),
    ({"names": np.frombuffer(b"\xff\xfe", np.uint8)}, "names that are no text"),
    ({"names": names("World")}, "columns of an outline that differ in length"),
    ({"names": names(*["a b"] * 14)}, "the name of a prim"),
    ({"parents": (1, 1)}, "prims that are in none before them"),
    ({"parents": (1, 9)}, "prims that are in none before them"),
    ({"parents": np.zeros(3, np.uint32)}, "columns of an outline that differ in length"),
    ({"parents": np.zeros(3, np.float32)}, "an array of float32"),
    ({"kind": (0, 99)}, "a kind of prims"),
    ({"kinds": [["no type", []]]}, "a type of prims"),
    ({"kinds": [["Xform", ["(bad)"]]]}, "a schema"),
    ({"specifier": (0, 3)}, "a specifier"),
    ({"prototype": (1, 7)}, "instances of what there is none of"),
    ({"prototypes": ids(0, 0)}, "prototypes that are no prims"),
    ({"prototypes": ids(999)}, "prototypes that are no prims"),
    ({"prototypes": ids(1)}, "prototypes that are in other prims"),
    ({"bound": np.full((1, 2), 99, np.uint32)}, "bindings of prims"),
    ({"bound": np.array([[0, 99]], np.uint32)}, "bindings to nothing"),
    ({"bound": np.zeros((1, 3), np.uint32)}, "bindings of prims"),
    ({"materials": ["World"]}, "something for a path"),
    ({"materials": ["/World{look=a}M"]}, "something for a path"),
    ({"materials": ["/a" * CHAIN]}, "something for a path"),
    ({"materials": ["/" + "a" * (1 << 17)]}, "a text that is none"),
    ({"attributes": attribute(prim=99)}, "of a prim that there is none of"),
    ({"attributes": attribute(prim=-1)}, "something for a whole number"),
    ({"attributes": attribute(name="in puts")}, "the name of a property"),
    ({"attributes": attribute(type="opaque")}, "a type of values"),
    ({"attributes": attribute(type="float[][]")}, "a type of values"),
    ({"attributes": attribute(value="1")}, "a value of type float"),
    ({"attributes": attribute(value=True)}, "a value of type float"),
    ({"attributes": attribute(value={"array": 0})}, "a value of type float"),
    ({"attributes": attribute(type="int", value=1.5)}, "a value of type int"),
    ({"attributes": attribute(type="int", value=1 << 40)}, "an outline that is no stage"),
    ({"attributes": attribute(type="int", value=1 << 80)}, "a value of type int"),
    ({"attributes": attribute(type="bool", value=1)}, "a value of type bool"),
    ({"attributes": attribute(type="color3f", value=[1, 2])}, "a value of type color3f"),
    ({"attributes": attribute(type="int2", value=[1.5, 2])}, "a value of type int2"),
    ({"attributes": attribute(type="matrix4d", value=[[1] * 4] * 4)}, "a value of type matrix4d"),
    ({"attributes": attribute(type="float[]", value=[1.0] * 257)}, "values of type float"),
    ({"attributes": attribute(type="float[]", value=[None])}, "values of type float"),
    ({"attributes": attribute(type="token", value="a\0b")}, "a value of type token"),
    ({"attributes": attribute(type="asset", value=["a"])}, "a value of type asset"),
    ({"attributes": attribute(connections=["../a"])}, "something for a path"),
    ({"attributes": attribute() * 2}, "an outline that is no stage"),
    ({"attributes": [[0]]}, "something for 7 values"),
    ({"relationships": [[0, "a", ["/A"], "strong"]]}, "something for a strength"),
    ({"variants": [[0, "look", ["a"], "}"]]}, "something for a variant"),
    ({"variants": [[0, "a=b", ["a"], "a"]]}, "something for a variant"),
    ({"variants": [[0, "", [], ""]]}, "something for a variant"),
    ({"counts": [[0, -1]]}, "something for a whole number"),
    ({"counts": [[77, 1]]}, "of a prim that there is none of"),
    ({"facts": {"subLayers": "evil.usda"}}, "layers in an outline"),
    ({"facts": {"subLayers": {"a": "evil.usda"}}}, "layers in an outline"),
    ({"facts": {"upAxis": ["Y"]}}, "something for values by name"),
    ({"facts": {"upAxis": 3}}, "an outline that is no stage"),
    ({"facts": {"noSuchFact": 3}}, "an outline that is no stage"),
    ({"files": [3]}, "something for a text"),
    ({"selected": [["/A", "s", "}"]]}, "something for a variant"),
]  # fmt: skip


@pytest.mark.parametrize(("other", "words"), BAD, ids=range(len(BAD)))
def test_what_is_no_outline_is_refused(
    good: tuple[dict[str, Any], list[Any]], other: dict[str, Any], words: str
) -> None:
    body, arrays = copy.deepcopy(good[0]), list(good[1])
    for name, value in other.items():
        change(body, arrays, name, value)
    with pytest.raises((Refused, ValueError), match=words) as caught:
        built(body, arrays)
    assert "\n" not in str(caught.value) and not isinstance(caught.value, Tf.ErrorException)


def test_parts_that_are_missing_are_named(good: tuple[dict[str, Any], list[Any]]) -> None:
    for name in good[0]:
        body = {key: value for key, value in good[0].items() if key != name}
        with pytest.raises(Refused, match=f"an outline without {name}$"):
            read_outline(body, good[1])
    for value in (None, [], 3, "x"):
        with pytest.raises(Refused, match="something for values by name"):
            read_outline(value, [])


def nested(count: int, prototypes: list[int], instances: dict[int, int]) -> tuple[Any, list[Any]]:
    """A message with chains of prims: a new one begins with each prototype."""
    parents = np.arange(count, dtype=np.uint32) - 1
    parents[[0, *prototypes]] = NOTHING
    of = np.full(count, NOTHING, np.uint32)
    for prim, prototype in instances.items():
        of[prim] = prototype
    zeros = np.zeros(count, np.uint32)
    body = {
        "holder": "H", "names": names(*(f"p{i}" for i in range(count))).tobytes(),
        "parents": parents, "kinds": [["Xform", []]], "kind": zeros,
        "specifier": zeros.astype(np.uint8), "hidden": zeros.astype(np.uint8), "prototype": of,
        "prototypes": ids(*prototypes), "bound": zeros[:0].reshape(0, 2), "materials": [],
        "attributes": [], "relationships": [], "variants": [], "counts": [], "facts": {},
        "files": [], "selected": [],
    }  # fmt: skip
    arrays: list[Any] = []
    return json.loads(json.dumps(packed(body, arrays))), arrays


def test_nesting_has_a_limit() -> None:
    assert built(*nested(MOST_NESTING, [], {})).GetPrimAtPath("/p0/p1")
    with pytest.raises(Refused, match="prims that are nested too deep"):
        read_outline(*nested(MOST_NESTING + 1, [], {}))
    assert built(*nested(300, [200], {199: 0})) if MOST_NESTING >= 300 else True
    with pytest.raises(Refused, match="instances that are nested too deep"):
        read_outline(*nested(400, [200], {199: 0}))


@pytest.mark.parametrize("instances", [{5: 0}, {5: 1, 8: 0}])
def test_prototypes_in_themselves_are_refused(instances: dict[int, int]) -> None:
    with pytest.raises(Refused, match="instances that are nested too deep"):
        read_outline(*nested(9, [3, 6], instances))


def test_doubles_among_siblings_are_refused() -> None:
    body, arrays = nested(3, [], {})
    change(body, arrays, "parents", ids(NOTHING, 0, 0))
    change(body, arrays, "names", names("a", "b", "b"))
    with pytest.raises(ValueError, match="an outline that is no stage"):
        built(body, arrays)


def test_any_change_makes_a_stage_or_one_line(good: tuple[dict[str, Any], list[Any]]) -> None:
    """Values of a good outline in other places, and bytes of its arrays that are others."""
    chance, seen = random.Random(19), set()
    odd = [None, -1, 0, 1 << 33, 1.5, "", "x", "/x", [], {}, [[]], True, float("nan"), "a" * 99]
    for _ in range(600):
        body, arrays = copy.deepcopy(good[0]), [one.copy() for one in good[1]]
        if chance.random() < 0.3:
            column = chance.choice([one for one in arrays if one.size])
            column.reshape(-1).view(np.uint8)[chance.randrange(column.nbytes)] = chance.randrange(
                256
            )
        else:
            place: Any = body
            while True:
                key = chance.choice(list(place)) if isinstance(place, dict) else None
                key = chance.randrange(len(place)) if key is None else key
                inner = place[key]
                if not isinstance(inner, (list, dict)) or not inner or chance.random() < 0.2:
                    place[key] = chance.choice(odd)
                    break
                place = inner
        try:
            built(body, arrays)
            seen.add("a stage")
        except (Refused, ValueError) as error:
            assert "\n" not in str(error) and not isinstance(error, Tf.ErrorException)
            seen.add(type(error).__name__)
    assert seen >= {"a stage", "Refused"}
