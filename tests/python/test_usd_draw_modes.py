# SPDX-License-Identifier: Apache-2.0
"""Tests draw modes of models: the proxy geometry that is drawn, where, and for which models."""

import numpy as np
import OpenImageIO
import pytest
from usd_recorder import QUAD, load, said

MODEL = f"""
    float3[] extentsHint = [(-1, -2, -3), (1, 2, 5)]
    def Mesh "Inside" {{ {QUAD} }}
"""


def model(more="", kind="component", name="Car", meta=""):
    return f"""def Xform "{name}" (
        prepend apiSchemas = ["GeomModelAPI"]
        kind = "{kind}"
        {meta}
    ) {{ {MODEL}
        {more} }}"""


def cards(geometry, *textures):
    files = "\n".join(f"asset model:cardTexture{card} = @./card.png@" for card in textures)
    return f"""uniform token model:drawMode = "cards"
        uniform token model:cardGeometry = "{geometry}"
        float3 model:drawModeColor = (0.5, 0.25, 0.125)
        {files}"""


@pytest.fixture
def card(tmp_path):
    """An image whose left part is transparent."""
    image = OpenImageIO.ImageBuf(OpenImageIO.ImageSpec(2, 2, 4, "uint8"))
    image.set_pixels(
        OpenImageIO.ROI(0, 2, 0, 2), np.array([[[0, 0, 0, 0], [1, 0.5, 0, 1]]] * 2, np.float32)
    )
    assert image.write(str(tmp_path / "card.png"))


def test_cards_without_pictures_are_a_box_of_a_colour(tmp_path):
    scene, loaded = load(tmp_path, model(cards("box")))
    (mesh,) = scene.meshes
    assert mesh["name"] == "/Car" and len(mesh["indices"]) == 12
    assert not loaded.report.warnings and not loaded.report.unsupported
    assert "note: models drawn as cards: /Car" in said(loaded)
    points = mesh["positions"]
    assert np.allclose([points.min(axis=0), points.max(axis=0)], [(-1, -2, -3), (1, 2, 5)])
    a, b, c = points[mesh["indices"]].transpose(1, 0, 2)
    assert np.einsum("ij,ij->i", np.cross(a, b), c).sum() / 6 == pytest.approx(2 * 4 * 8)
    for number in np.unique(mesh["face_materials"]):
        assert np.allclose(scene.materials[number]["base_color"], (0.5, 0.25, 0.125))


def test_a_cross_has_the_axes_that_have_pictures(tmp_path, card):
    scene, loaded = load(tmp_path, model(cards("cross", "XPos", "YNeg", "YPos")))
    (mesh,) = scene.meshes
    assert len(mesh["indices"]) == 8 and not loaded.report.warnings
    corners = mesh["positions"][mesh["indices"]].reshape(4, 6, 3)
    uvs = mesh["uvs"]
    uvs = (uvs if uvs.ndim == 3 else uvs[mesh["indices"]]).reshape(4, 6, 2)
    flat = np.ptp(corners, axis=1).argmin(axis=1)
    assert sorted(flat.tolist()) == [0, 0, 1, 1] and np.abs(corners[flat == 0, :, 0]).max() < 1e-3
    for card_, right, way in ((0, 1, 1), (1, 0, -1), (2, 1, 1), (3, 0, 1)):
        # The third card shows the first image from behind, mirrored so that its right side stays.
        across, up = corners[card_, :, right], corners[card_, :, 2]
        low, high = across.min(), across.max()
        wanted = (across - low) / (high - low)
        assert np.allclose(uvs[card_, :, 0], wanted if way > 0 else 1 - wanted)
        assert np.allclose(uvs[card_, :, 1], (up + 3) / 8)
    assert len(scene.textures) >= 1


def test_bounds_and_origins_are_lines(tmp_path):
    text = model('uniform token model:drawMode = "bounds"')
    scene, _ = load(tmp_path, text + model('uniform token model:drawMode = "origin"', name="Pin"))
    box, pin = scene.mesh("Car"), scene.mesh("Pin")
    assert box["kind"] == pin["kind"] == "linear-tube"
    assert len(box["segments"]) == 12 and len(pin["segments"]) == 3
    lengths = np.linalg.norm(box["positions"][1::2] - box["positions"][::2], axis=1)
    assert sorted(lengths.round(5).tolist()) == [2] * 4 + [4] * 4 + [8] * 4
    assert np.allclose(pin["positions"][1::2], np.eye(3))


@pytest.mark.parametrize(
    ("group", "component", "drawn"),
    [
        ("", "", "Inside"),
        ('uniform token model:drawMode = "bounds"', "", "Car"),
        ('uniform token model:drawMode = "bounds"',
         'uniform token model:drawMode = "default"', "Inside"),
        ('uniform token model:drawMode = "bounds"',
         "uniform bool model:applyDrawMode = false", "Inside"),
        ('uniform token model:drawMode = "bounds"\nuniform bool model:applyDrawMode = true',
         "", "World"),
        ("", 'uniform token model:drawMode = "nonsense"', "Inside"),
    ],
)  # fmt: skip
def test_which_models_it_applies_to(tmp_path, group, component, drawn):
    text = f"""def Xform "World" (
        prepend apiSchemas = ["GeomModelAPI"]
        kind = "group"
    ) {{ {group}
        {model(component)} }}"""
    scene, loaded = load(tmp_path, text)
    (mesh,) = scene.meshes
    assert mesh["name"].endswith(drawn)
    assert bool(loaded.report.unsupported) == ("nonsense" in component)


def test_instances_of_models_and_siblings(tmp_path):
    lots = "\n".join(
        f"""def Xform "I{i}" (
            references = </Proto>
            instanceable = true
        ) {{ {'uniform token model:drawMode = "bounds"' if i else ""}
            double3 xformOp:translate = ({i}, 0, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"] }}"""
        for i in range(4)
    )
    text = f"""class Xform "Proto" (
        prepend apiSchemas = ["GeomModelAPI"]
        kind = "component"
    ) {{ {MODEL} }}
    def Xform "World" ( kind = "group" ) {{ {lots} }}"""
    scene, loaded = load(tmp_path, text)
    names = sorted(mesh["name"].rsplit("/", 1)[1] for mesh, _, _ in scene.world_meshes())
    assert names == ["I1", "I2", "I3", "Inside"] and not loaded.report.warnings
    assert scene.mesh("I3")["positions"][:, 0].max() == 4


def test_models_in_prototypes_and_values_of_other_types(tmp_path, card):
    wrong = cards("cross", "XPos").replace("float3 model:drawModeColor = (0.5, 0.25, 0.125)", "")
    wrong += '\nstring model:drawModeColor = "red"\nstring model:cardTextureYPos = "none"'
    text = f"""class Xform "Proto" ( kind = "group" ) {{ {model(wrong)} }}
    def "I" (
        references = </Proto>
        instanceable = true
    ) {{ }}
    def "J" (
        references = </Proto>
        instanceable = true
    ) {{ }}"""
    scene, loaded = load(tmp_path, text)
    names = [mesh["name"] for mesh, _, _ in scene.world_meshes()]
    assert names == ["/I/Car", "/I/Car"] and not loaded.report.warnings


def test_what_of_draw_modes_is_not_done(tmp_path, card):
    _, loaded = load(tmp_path, model(cards("fromTexture", "XPos")))
    assert "not supported: cards of geometry fromTexture (drawn as a cross): /Car" in said(loaded)
