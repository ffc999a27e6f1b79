# SPDX-License-Identifier: Apache-2.0
"""Tests scheduling policies in Python during real renders."""

from __future__ import annotations

import gc
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import wavecomb
from wavecomb.errors import WavecombError

Order = Callable[[Any, Any, Any], Any]

pytest.importorskip("wavecomb._core")


@pytest.fixture(scope="module")
def scene() -> Any:
    """Stripes of five materials (two of them textured) with two programs, under a uniform sky."""
    builder = wavecomb.SceneBuilder()
    rng = np.random.default_rng(1)
    textures = [
        builder.add_texture(rng.random((size, size, 3)).astype(np.float32), srgb=False, name=name)
        for size, name in ((16, "small"), (64, "large"))
    ]
    ids = []
    for i in range(5):
        use = {"base_color": {"texture": textures[i], "channel": "rgb"}} if i < 2 else {}
        ids.append(
            builder.add_material("diffuse" if i % 2 else "plastic", name=f"M{i}", textures=use)
        )
    for i in range(20):
        x = i - 10.0
        points = np.array([[x, -9, -5], [x + 1, -9, -5], [x + 1, 9, -4], [x, 9, -4]], np.float32)
        uvs = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
        triangles = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
        builder.add_to_group(
            0, builder.add_mesh(points, triangles, uvs=uvs, material=ids[i % 5], name=f"S{i}")
        )
    builder.add_light("dome", np.eye(4))
    builder.set_camera(np.eye(4), window=(-1, 1, -1, 1))
    return builder.build()


class Policy(wavecomb.SchedulingPolicy):
    """A policy that calls the given function."""

    def __init__(self, function: Order, name: str = "mine", columns: tuple[str, ...] = ()) -> None:
        self.function = function
        self.name = name
        self.columns = columns  # type: ignore[misc]

    def order(self, queue: Any, costs: Any, keys: Any) -> Any:
        return self.function(queue, costs, keys)


def render(scene: Any, policy: Any, **settings: Any) -> wavecomb.Picture:
    settings = {"threads": 2, "wave_size": 256, "costs": "model", **settings}
    return wavecomb.render(scene, size=(40, 30), spp=8, policy=policy, **settings)


def test_sees_what_is_documented(scene: Any) -> None:
    seen: list[tuple[Any, Any, Any]] = []

    def order(queue: Any, costs: Any, keys: Any) -> None:
        seen.append((queue, costs, keys))
        assert keys.flags.writeable
        assert (keys == 0).all()
        keys[:] = queue["material"]

    columns = ("throughput", "position_key", "texture_key")
    picture = render(scene, Policy(order, "watching", columns))
    assert picture.stats["settings"]["policy"] == "watching"
    assert wavecomb.compare(picture, render(scene, "none")).equal
    gc.collect()
    records = sum(len(queue["material"]) for queue, _, _ in seen)
    assert 0.99 < records / picture.stats["counts"]["records"] <= 1
    for queue, costs, keys in seen:
        n = len(queue["material"])
        assert keys.dtype == np.uint64
        assert keys.shape == (n,)
        assert (keys == queue["material"]).all()
        assert queue["program"].dtype == queue["material"].dtype == np.uint32
        assert queue["throughput"].dtype == np.float32
        assert all(len(queue[name]) == n for name in ("program", *columns))
        assert (queue["throughput"] > 0).all()
        assert queue["position_key"].max() < 1 << 30
        assert queue["texture_key"].max() < 1 << 25
        assert queue["material"].max() < 5
        assert 0 <= queue["depth"] <= 8
        assert not queue["material"].flags.writeable
        texture = queue["material_texture"]
        assert texture[:5].tolist() == [0, 1, *3 * [0xFFFFFFFF]]
        size = queue["material_texture_bytes"]
        assert size[1] > size[0] > 0
        assert (size[2:] == 0).all()
        assert (queue["material_graph"] == 0xFFFFFFFF).all()
        assert costs["material_ns"].shape == texture.shape
        assert costs["texture_ns"].shape == (2,)
        assert costs["mean_ns"] > 0


def test_columns_come_only_when_asked_for(scene: Any) -> None:
    def order(queue: Any, costs: Any, keys: Any) -> bool:
        assert set(queue) == {
            *("program", "material", "depth", "throughput"),
            *("material_texture", "material_texture_bytes", "material_graph"),
        }
        return False

    render(scene, Policy(order, columns=("throughput",)))


def bits(x: Any) -> Any:
    """Returns the bits of nonnegative floats, which have the same order."""
    return np.asarray(x, np.float32).view(np.uint32).astype(np.uint64)


def by_material(queue: Any, costs: Any, keys: Any) -> None:
    program, material = queue["program"].astype(np.uint64), queue["material"]
    keys[:] = (program << 56) | (bits(costs["material_ns"])[material] << 24) | material


def by_program(queue: Any, costs: Any, keys: Any) -> bool:
    keys[:] = queue["program"]
    return True


def by_texture(queue: Any, costs: Any, keys: Any) -> np.bool_:
    size = queue["material_texture_bytes"][queue["material"]]
    keys[:] = (queue["program"].astype(np.uint64) << 56) | size
    return np.bool_(True)


def by_locality(queue: Any, costs: Any, keys: Any) -> None:
    program, material = queue["program"].astype(np.uint64), queue["material"].astype(np.uint64)
    keys[:] = (program << 56) | (material << 32) | queue["texture_key"]


def not_at_all(queue: Any, costs: Any, keys: Any) -> bool:
    keys[:] = np.arange(keys.size)[::-1]
    return False


@pytest.mark.parametrize("materialize", ["on", "off"])
@pytest.mark.parametrize(
    ("name", "function", "columns"),
    [
        ("none", not_at_all, ()),
        ("program", by_program, ()),
        ("material", by_material, ()),
        ("texture", by_texture, ()),
        ("texture-locality", by_locality, ("texture_key",)),
    ],
)
def test_equals_the_same_policy_in_cpp(
    scene: Any, name: str, function: Order, columns: tuple[str, ...], materialize: str
) -> None:
    # Coherence is measured on every 17th queue of a worker, so one thread makes it reproducible.
    settings = {"threads": 1, "materialize": materialize}
    theirs = render(scene, name, **settings)
    ours = render(scene, Policy(function, columns=columns), **settings)
    assert wavecomb.compare(ours, theirs).equal
    assert ours.stats["coherence"] == theirs.stats["coherence"]
    assert ours.stats["counts"] == theirs.stats["counts"]
    assert ours.stats["lane_utilisation"] == theirs.stats["lane_utilisation"]


class Mishap(Exception):
    pass


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize("calls", [0, 7])
def test_exceptions_come_out(scene: Any, threads: int, calls: int) -> None:
    left = [calls]

    def order(queue: Any, costs: Any, keys: Any) -> None:
        left[0] -= 1
        if left[0] < 0:
            raise Mishap(f"after {calls}")

    with pytest.raises(Mishap, match=f"after {calls}"):
        render(scene, Policy(order), threads=threads)
    assert wavecomb.compare(render(scene, "program"), render(scene, "none")).equal


def wrong_shape(queue: Any, costs: Any, keys: Any) -> None:
    keys[:] = np.zeros(keys.size + 1)


def wrong_name(queue: Any, costs: Any, keys: Any) -> None:
    keys[:] = queue["colour"]


def writes_inputs(queue: Any, costs: Any, keys: Any) -> None:
    queue["material"][:] = 0


def returns_keys(queue: Any, costs: Any, keys: Any) -> Any:
    return np.zeros(keys.size)


def returns_number(queue: Any, costs: Any, keys: Any) -> Any:
    return 1


def stops(queue: Any, costs: Any, keys: Any) -> Any:
    raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("function", "error", "says"),
    [
        (wrong_shape, ValueError, "could not broadcast"),
        (wrong_name, KeyError, "colour"),
        (writes_inputs, ValueError, "read-only"),
        (returns_keys, ValueError, "policy mine: order.. returned a ndarray; it must fill keys"),
        (returns_number, ValueError, "order.. returned a int; it must fill keys"),
        (stops, KeyboardInterrupt, None),
    ],
)
def test_mistakes_come_out(scene: Any, function: Order, error: Any, says: str) -> None:
    with pytest.raises(error, match=says):
        render(scene, Policy(function))


def test_base_class_and_odd_objects(scene: Any) -> None:
    with pytest.raises(NotImplementedError):
        render(scene, wavecomb.SchedulingPolicy())
    with pytest.raises(WavecombError, match="column 'colour' is not known"):
        render(scene, Policy(by_program, columns=("colour",)))
    with pytest.raises(WavecombError, match="policy object: name must be a string"):
        render(scene, object())


def test_keys_left_alone_keep_arrival(scene: Any) -> None:
    def order(queue: Any, costs: Any, keys: Any) -> None:
        keys = queue["material"]  # noqa: F841, the beginner's slip: nothing is written

    plain = render(scene, "none", threads=1)
    picture = render(scene, Policy(order), threads=1)
    assert wavecomb.compare(picture, plain).equal
    assert picture.stats["coherence"] == plain.stats["coherence"]
