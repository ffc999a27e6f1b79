# SPDX-License-Identifier: Apache-2.0
"""Tests visibility by kind of ray, holdouts and alpha."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from usd_recorder import load, said, write

import wavecomb
from wavecomb.cli import main

SIZE, SPP = (32, 24), 16
STAGE = """#usda 1.0
( upAxis = "Y" )
def Camera "Cam" {
    float focalLength = 30
    double3 xformOp:translate = (0, 2, 8)
    float3 xformOp:rotateXYZ = (-12, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}
def RectLight "Key" {
    float inputs:intensity = 20
    float3 xformOp:rotateXYZ = (-90, 0, 0)
    double3 xformOp:translate = (0, 5, 0)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}
def Mesh "Floor" {
    point3f[] points = [(-4, -1, -3), (-4, -1, 3), (4, -1, 3), (4, -1, -3)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
}
def Xform "Set" {
    def Xform "Group" (
        KIND
    ) {
        def Sphere "Ball" { SAYS }
    }
}
"""


def _text(says: str = "", kind: str = "") -> str:
    return STAGE.replace("SAYS", says).replace("KIND", kind)


def _render(folder: Path, says: str = "", **options: Any) -> wavecomb.Picture:
    return wavecomb.render(
        write(folder, _text(says)), size=SIZE, spp=SPP, aovs=["alpha", "depth", "crypto_object"],
        # The brightness of the image, which changes with visibility, affects shadow roulette.
        shadow_roulette="off", **options,
    )  # fmt: skip


def _covered(picture: wavecomb.Picture, name: str) -> np.ndarray[Any, Any]:
    from wavecomb.image import cryptomatte

    pairs = picture.aovs["crypto_object"]
    return cryptomatte.matte(pairs, wavecomb._core.crypto_id(name))


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> wavecomb.Picture:
    return _render(tmp_path_factory.mktemp("plain"))


def test_alpha_is_what_is_covered(plain: wavecomb.Picture) -> None:
    alpha = plain.aovs["alpha"]
    assert alpha.min() == 0 and alpha.max() == 1
    covered = sum(_covered(plain, name) for name in ("/Floor", "/Set/Group/Ball", "/Key"))
    np.testing.assert_allclose(alpha, covered, atol=1e-6)


def test_a_holdout_is_a_hole(plain: wavecomb.Picture, tmp_path: Path) -> None:
    held = _render(tmp_path, holdouts=["/Set"])
    ball = _covered(plain, "/Set/Group/Ball")
    hole, rest = ball == 1, ball == 0
    assert hole.any() and (held.aovs["alpha"][hole] == 0).all() and not held.beauty[hole].any()
    assert np.isinf(held.depth[hole]).all()
    np.testing.assert_array_equal(held.beauty[rest], plain.beauty[rest])
    by_stage = _render(tmp_path, "bool primvars:arnold:matte = 1")
    assert by_stage.beauty.tobytes() == held.beauty.tobytes()


def test_the_camera_sees_through_it(plain: wavecomb.Picture, tmp_path: Path) -> None:
    unseen = _render(tmp_path, "bool primvars:arnold:visibility:camera = 0")
    rest = _covered(plain, "/Set/Group/Ball") == 0
    np.testing.assert_array_equal(unseen.beauty[rest], plain.beauty[rest])
    assert not _covered(unseen, "/Set/Group/Ball").any()


def test_it_casts_no_shadow(plain: wavecomb.Picture, tmp_path: Path) -> None:
    bright = _render(tmp_path, "int primvars:ri:attributes:visibility:transmission = 0")
    floor = _covered(plain, "/Floor") == 1
    assert bright.beauty[floor].sum() > 1.02 * plain.beauty[floor].sum()
    np.testing.assert_array_equal(bright.aovs["alpha"], plain.aovs["alpha"])


def test_bounces_pass_it_by(plain: wavecomb.Picture, tmp_path: Path) -> None:
    passed = _render(tmp_path, 'string primvars:karma:object:rendervisibility = "primary|shadow"')
    np.testing.assert_array_equal(passed.aovs["alpha"], plain.aovs["alpha"])
    floor = _covered(plain, "/Floor") == 1
    assert 0.5 < passed.beauty[floor].sum() / plain.beauty[floor].sum() < 0.999


@pytest.mark.parametrize("says", ["bool primvars:wavecomb:holdout = 1",
                                  "bool primvars:wavecomb:visibility:camera = 0"])  # fmt: skip
def test_every_schedule_gives_the_same_bits(says: str, tmp_path: Path) -> None:
    first = _render(tmp_path, says)
    for schedule in ({"integrator": "reference"}, {"threads": 1, "wave_size": 64}):
        other = _render(tmp_path, says, **schedule)
        for name in ("alpha", "crypto_object"):
            assert other.aovs[name].tobytes() == first.aovs[name].tobytes(), (schedule, name)
        assert other.beauty.tobytes() == first.beauty.tobytes(), schedule


@pytest.mark.parametrize(
    ("says", "rays"),
    [
        ("bool primvars:wavecomb:visibility:shadow = 0", {"shadow": False}),
        ("int primvars:ri:attributes:visibility:indirect = 0", {"bounces": False}),
        ("bool primvars:wavecomb:visibility:camera = 0\\n"
         "int primvars:ri:attributes:visibility:camera = 1\\n"
         'string primvars:karma:object:rendervisibility = "*"',
         {"camera": False, "shadow": True, "bounces": True}),
        ("int primvars:ri:attributes:trace:holdout = 1", {"holdout": True}),
        ("int primvars:karma:object:holdoutmode = 2", {"holdout": True}),
        ('string primvars:karma:object:rendervisibility = "-primary"',
         {"camera": False, "shadow": True, "bounces": True}),
        ('string primvars:karma:object:rendervisibility = "-diffuse-reflect & -refract"',
         {"camera": True, "shadow": True, "bounces": False}),
        ("\\n".join(f"bool primvars:arnold:visibility:{one} = 0" for one in (
            "diffuse_reflect", "specular_reflect", "diffuse_transmit", "specular_transmit")),
         {"bounces": False}),
    ],
)  # fmt: skip
def test_what_renderers_author(says: str, rays: dict[str, bool], tmp_path: Path) -> None:
    builder, _ = load(tmp_path, _text(says.replace("\\n", "\n")))
    assert builder.visibility == [("/Set/Group/Ball", rays)]


def test_what_is_not_supported_is_listed(tmp_path: Path) -> None:
    says = "bool primvars:arnold:visibility:diffuse_reflect = 0"
    builder, loaded = load(tmp_path, _text(says))
    assert builder.visibility == [("/Set/Group/Ball", {"bounces": True})]
    assert "visibility by kinds of bounces" in said(loaded)


def test_it_holds_inside_of_instances(tmp_path: Path) -> None:
    text = """#usda 1.0
    class "Tree" {
        def Sphere "Leaves" { bool primvars:arnold:visibility:camera = 0 }
        def Cube "Trunk" {}
    }
    def Camera "Cam" {
        double3 xformOp:translate = (0, 0, 30)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Xform "A" ( instanceable = true; references = </Tree> ) {
        double3 xformOp:translate = (-3, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Xform "B" ( instanceable = true; references = </Tree> ) {
        double3 xformOp:translate = (3, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        bool primvars:wavecomb:holdout = 1
    }
    """
    picture = wavecomb.render(write(tmp_path, text), size=(32, 16), spp=8,
                              aovs=["alpha", "crypto_object"])  # fmt: skip
    assert set(picture.manifests["crypto_object"]) == {"/A/Trunk"}
    assert picture.aovs["alpha"][:, :16].max() == 1 and picture.aovs["alpha"][:, 16:].max() == 0


def test_a_holdout_that_is_not_there(tmp_path: Path) -> None:
    stage = write(tmp_path, _text())
    result = CliRunner().invoke(
        main,
        ["render", str(stage), "-o", str(tmp_path / "a.exr"), "--holdout", "/No", "--spp", "1"],
    )
    assert result.exit_code == 2
    assert "--holdout /No: there is no such prim" in result.stderr
