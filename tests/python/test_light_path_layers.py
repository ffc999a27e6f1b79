# SPDX-License-Identifier: Apache-2.0
"""Tests direct and indirect layers, light groups and expressions with light paths."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wavecomb
from wavecomb.scenes import write_scene

_core = pytest.importorskip("wavecomb._core")

SIZE, SPP = (32, 24), 4
PARTITIONS = {
    "lobes": {"a": "C[LO]", "b": "C<RD>.*", "c": "C<RG>.*", "d": "C<RS>.*", "e": "C<T.>.*"},
    "bounces": {"f": "C[LO]", "g": "C.[LO]", "h": "C..[LO]", "i": "C.{3,}[LO]"},
    "order": {"j": "C[^D]*[LO]", "k": "C[^D]*D[^D]*[LO]", "l": "C[^D]*D[^D]*D.*[LO]"},
    "ends": {"m": "C.*<L.'key'>", "n": "C.*[^<L.'key'>]"},
    "first": {"o": "C.*D[LO]", "p": "C.*[^D][LO]", "q": "C[LO]"},
}
ASKED = {name: text for partition in PARTITIONS.values() for name, text in partition.items()}
LAYERS = ("emission", "direct", "indirect", "light_groups", "techniques")


@pytest.fixture(scope="module")
def stages(caustics: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Loaded stages, each with a light group ``key``."""
    from pxr import Sdf, Usd

    folder = tmp_path_factory.mktemp("layers")
    mixed = folder / "mixed.usdc"
    write_scene("mixed", mixed, triangles=12_000, teapot_level=6, texture_size=64)
    found = {}
    for name, path in (("caustics", caustics), ("mixed", mixed)):
        stage = Usd.Stage.Open(str(path))
        lamp = next(p for p in stage.Traverse() if "Light" in p.GetTypeName())
        group = lamp.CreateAttribute("primvars:wavecomb:lightGroup", Sdf.ValueTypeNames.String)
        group.Set("key")
        stage.Export(str(folder / f"{name}_key.usdc"))
        found[name] = wavecomb.load(folder / f"{name}_key.usdc")
    return found


def render(stage: Any, **settings: Any) -> wavecomb.Picture:
    aovs = [*LAYERS, *(f"lpe:{name}={text}" for name, text in ASKED.items())]
    plain: dict[str, Any] = {"size": SIZE, "spp": SPP, "transport": "light", "aovs": aovs}
    return wavecomb.render(stage, **(plain | settings))


def total(picture: wavecomb.Picture, names: Any) -> Any:
    return sum(picture.aovs[name].astype(np.float64) for name in names)


@pytest.mark.parametrize("transport", ["light", "bdpt"])
@pytest.mark.parametrize("name", ["caustics", "mixed"])
@pytest.mark.slow
def test_layers_add_up_and_leave_the_beauty(stages: Any, name: str, transport: str) -> None:
    plain = render(stages[name], transport=transport, aovs=[])
    found = render(stages[name], transport=transport)
    assert found.beauty.tobytes() == plain.beauty.tobytes()
    near = {"rtol": 2e-6, "atol": 2e-6 * float(found.beauty.max())}
    groups = [layer for layer in found.aovs if layer.startswith("light_")]
    assert len(groups) >= 2
    for names in (("emission", "direct", "indirect"), groups):
        np.testing.assert_allclose(total(found, names), found.beauty, **near, err_msg=str(names))
    for what, partition in PARTITIONS.items():
        layers = [f"lpe_{one}" for one in partition]
        np.testing.assert_allclose(total(found, layers), found.beauty, **near, err_msg=what)
    # Two definitions of the same layer agree.
    for other, expression in (("emission", "f"), ("direct", "g"), ("light_key", "m")):
        np.testing.assert_allclose(
            found.aovs[f"lpe_{expression}"], found.aovs[other], **near, err_msg=other
        )
    np.testing.assert_allclose(total(found, ("lpe_h", "lpe_i")), found.aovs["indirect"], **near)
    assert all(found.aovs[f"lpe_{one}"].max() > 0 for one in "bghjk")


WAYS: list[dict[str, Any]] = [
    {"lanes": 1, "threads": 1, "wave_size": 64, "policy": "random-runs"},
    {"policy": "material", "ray_order": "morton", "materialize": "on", "wave_size": 1000},
    {"integrator": "reference"},
    {"progressive": True, "threads": 2},
]


@pytest.mark.parametrize("transport", ["light", "bdpt"])
def test_layers_are_the_same_for_all_schedules(stages: Any, transport: str) -> None:
    first = render(stages["mixed"], transport=transport)
    for way in WAYS:
        other = render(stages["mixed"], transport=transport, **way)
        for name, layer in first.aovs.items():
            assert layer.tobytes() == other.aovs[name].tobytes(), (name, way)


def test_a_layer_is_the_same_alone(stages: Any) -> None:
    """Layers do not depend on other layers or on a crop; unrequested groups need no memory."""
    first = render(stages["caustics"])
    alone = render(stages["caustics"], aovs=["direct", "light_key", "lpe:k=" + ASKED["k"]])
    assert "light_other" not in alone.aovs
    for name in ("direct", "light_key", "lpe_k"):
        assert alone.aovs[name].tobytes() == first.aovs[name].tobytes(), name
    x0, y0, x1, y1 = region = (9, 5, 27, 22)
    part = render(stages["caustics"], region=region)
    for name in ("indirect", "light_key", "lpe_k"):
        got, want = part.aovs[name][y0:y1, x0:x1], first.aovs[name][y0:y1, x0:x1]
        assert got.tobytes() == want.tobytes(), name
    camera = render(stages["caustics"], transport="path", aovs=["direct", "light_key", "lpe:k=C.*"])
    film = [p.stats["memory_bytes"]["film"] for p in (alone, camera)]
    assert film[0] - film[1] == SIZE[0] * SIZE[1] * (4 * 48 + 4)


def test_light_paths_bring_what_expressions_say(stages: Any) -> None:
    """A caustic has a diffuse last vertex, and only glass or gold vertices before."""
    path = ["techniques", "lpe:caustic=CD[GS]+L", "lpe:rest=C[^D].*"]
    found = render(stages["caustics"], spp=16, aovs=path, light_aim="on")
    caustic = found.aovs["lpe_caustic"]
    assert caustic.mean() > 0.1 * found.aovs["by_light_paths"].mean()
    without = render(stages["caustics"], spp=16, aovs=path, transport="path").aovs["lpe_caustic"]
    assert np.median(caustic[caustic > 0]) > 0 and (caustic > 0).mean() > (without > 0).mean()
