# SPDX-License-Identifier: Apache-2.0
"""Tests generated stages with plain UsdPreviewSurface materials, as other exporters write."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from parts import needs
from pxr import Sdf, Usd, UsdShade

import wavecomb
from wavecomb.scenes import SCENES, SceneError, write_scene
from wavecomb.scenes.authoring import materials as looks

SMALL = {"triangles": 12_000, "teapot_level": 4, "texture_size": 64, "texture_mb": 0.5}
NOT_PLAIN = {
    "heavy", "smoke", "clouds", "fog", "fur", "head", "candles", "drinks", "splats",
}  # fmt: skip
PLAIN = sorted(set(SCENES) - NOT_PLAIN)
NODES = {"UsdPreviewSurface", "UsdUVTexture", "UsdPrimvarReader_float2", "UsdTransform2d"}


@pytest.fixture(scope="module", params=PLAIN)
def plain_stage(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Usd.Stage:
    path = tmp_path_factory.mktemp("plain") / f"{request.param}.usdc"
    write_scene(request.param, path, plain=True, **SMALL)
    return Usd.Stage.Open(str(path))


def without_looks(stage: Usd.Stage) -> str:
    """Returns a stage as text, without its materials."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(stage.GetRootLayer())
    del layer.GetPrimAtPath("/World").nameChildren["Looks"]
    return str(layer.ExportToString())


@pytest.mark.slow
def test_no_program_and_the_metallic_workflow_only(plain_stage: Usd.Stage) -> None:
    materials = [prim for prim in plain_stage.Traverse() if prim.IsA(UsdShade.Material)]
    assert materials
    assert not any(prim.GetAttribute("wavecomb:program") for prim in materials)
    for prim in plain_stage.Traverse():
        if shader := UsdShade.Shader(prim):
            assert shader.GetIdAttr().Get() in NODES
            names = {made.GetBaseName() for made in shader.GetInputs()}
            assert names.isdisjoint({"useSpecularWorkflow", "specularColor"}), prim.GetPath()


@pytest.mark.slow
def test_all_else_is_as_in_the_ordinary_form(plain_stage: Usd.Stage, tmp_path: Path) -> None:
    path = tmp_path / Path(plain_stage.GetRootLayer().realPath).name
    write_scene(path.stem, path, **SMALL)
    assert without_looks(Usd.Stage.Open(str(path))) == without_looks(plain_stage)


@pytest.mark.slow
@needs("wavecomb._core")
def test_a_plain_stage_renders(plain_stage: Usd.Stage) -> None:
    loaded = wavecomb.load(plain_stage.GetRootLayer().realPath)
    assert not loaded.report.warnings
    assert {program for _, program in loaded.scene.materials} <= {"principled", "diffuse"}
    assert "principled" in {program for _, program in loaded.scene.materials}
    beauty = wavecomb.render(loaded, size=(32, 24), spp=4).beauty
    assert np.isfinite(beauty).all() and beauty.mean() > 0.002


def test_metals_keep_colour_and_roughness_and_glass_is_seen_through() -> None:
    gold = looks.plain(looks.GOLD)
    assert gold.program is None
    assert gold.inputs == {"diffuseColor": (1.00, 0.71, 0.29), "metallic": 1.0, "roughness": 0.16}
    clear, amber = looks.plain(looks.CLEAR_GLASS).inputs, looks.plain(looks.AMBER_GLASS).inputs
    assert clear["opacity"] == 0.0 and clear["ior"] == 1.5 and clear["roughness"] == 0.0
    assert amber["opacity"] == pytest.approx(0.4 * (1.0 - 0.22)) and amber["ior"] == 1.54
    chalk = looks.plain(looks.CHALK)
    assert chalk.inputs == {"diffuseColor": (0.76, 0.74, 0.70), "roughness": 1.0}
    assert looks.plain(looks.STEEL).textures == {"roughness": "brushed"}


@pytest.mark.parametrize(
    ("name", "options", "says"),
    [
        ("heavy", {}, "heavy has no plain form"),
        ("spread", {"shader_cost": 2.0}, "no plain form of a shader_cost above 1"),
    ],
)
def test_networks_have_no_plain_form(
    tmp_path: Path, name: str, options: dict[str, Any], says: str
) -> None:
    with pytest.raises(SceneError, match=re.escape(says)) as caught:
        write_scene(name, tmp_path / "a.usdc", plain=True, **options)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())
