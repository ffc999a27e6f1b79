# SPDX-License-Identifier: Apache-2.0
"""Tests light filters, and shadows with a colour or a maximum distance."""

from __future__ import annotations

import numpy as np
import pytest
from test_usd_material import write_image
from usd_recorder import load, said

import wavecomb
from wavecomb.usd import load_stage

CAMERA = """def Camera "Cam" { float focalLength = 20
    float horizontalAperture = 20
    float verticalAperture = 20
    double3 xformOp:translate = (0, 0, 4)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


def quad(name, half, z, body="", x=0.0):
    return f"""def Mesh "{name}" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
        point3f[] points = [({x - half}, {-half}, {z}), ({x + half}, {-half}, {z}),
            ({x + half}, {half}, {z}), ({x - half}, {half}, {z})]
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        {body}
    }}
    """


def lamp(kind, body, z=4.0, api='"ShadowAPI", "ShapingAPI"'):
    return f"""def {kind} "Lamp" (prepend apiSchemas = [{api}]) {{
        float inputs:intensity = 10
        {body}
        double3 xformOp:translate = (0, 0, {z})
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
    """


FLOOR = quad("Floor", 3, 0)
POINT = "float inputs:radius = 0.001\nbool inputs:normalize = true"


def picture(tmp_path, text, spp=4, size=16, **settings):
    path = tmp_path / "s.usda"
    path.write_text("#usda 1.0\n" + CAMERA + text)
    settings = {"max_depth": 1, "seed": 2, "filter": "box", "filter_width": 1.0, **settings}
    stage = load_stage(path, lights="hidden")
    return np.array(wavecomb.render(stage.scene, size=(size, size), spp=spp, **settings).beauty)


# ---- shadows -------------------------------------------------------------------------------------

UNSEEN = "bool primvars:wavecomb:visibility:camera = 0"


def shaded(tmp_path, shadow, blocker=True, **settings):
    text = FLOOR + lamp("SphereLight", POINT + "\n" + shadow, 100)
    return picture(
        tmp_path, text + (quad("Blocker", 0.6, 1, UNSEEN) if blocker else ""), **settings
    )


def test_shadows_have_the_colour_that_is_asked_for(tmp_path):
    shadow = "color3f inputs:shadow:color = (0.25, 0, 0.5)"
    free, dark = shaded(tmp_path, shadow, False), shaded(tmp_path, shadow)
    black = shaded(tmp_path, "")
    within = (black == 0).all(axis=2)
    assert 4 < within.sum() < 100 and (free > 0).all()
    assert dark[within] == pytest.approx(free[within] * (0.25, 0, 0.5), rel=1e-5)
    outside = (black == free).all(axis=2)
    assert (dark[outside] == free[outside]).all() and outside.sum() > 100


def test_shadows_end_at_their_distance(tmp_path):
    free = shaded(tmp_path, "", False)
    near = shaded(tmp_path, "float inputs:shadow:distance = 0.9")
    far = shaded(tmp_path, "float inputs:shadow:distance = 1.1")
    assert near == pytest.approx(free, rel=1e-5)
    assert (far == shaded(tmp_path, "")).all()


@pytest.mark.parametrize(("gamma", "strength"), [(1, 0.5), (2, 0.25)])
def test_shadows_fade_before_their_distance(tmp_path, gamma, strength):
    shadow = f"""float inputs:shadow:distance = 1.5
        float inputs:shadow:falloff = 1
        float inputs:shadow:falloffGamma = {gamma}"""
    free = shaded(tmp_path, "", False, spp=256)
    dark = shaded(tmp_path, shadow, spp=256)
    within = (shaded(tmp_path, "") == 0).all(axis=2)
    share = dark[within].mean() / free[within].mean()
    assert share == pytest.approx(1 - strength, abs=0.02)


def test_one_picture_whatever_the_schedule(tmp_path):
    shadow = """color3f inputs:shadow:color = (0.25, 0, 0.5)
        float inputs:shadow:distance = 1.5
        float inputs:shadow:falloff = 1"""
    pictures = [
        shaded(tmp_path, shadow, max_depth=3, **settings)
        for settings in ({}, {"integrator": "reference"}, {"wave_size": 64, "policy": "material"})
    ]
    assert all((one == pictures[0]).all() for one in pictures)


# ---- filters -------------------------------------------------------------------------------------


def barn(body, z):
    return f"""def PxrBarnLightFilter "Barn" {{
        {body}
        double3 xformOp:translate = (0, 0, {z})
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
    """


def test_a_barn_before_a_point_is_a_window(tmp_path):
    light = lamp("SphereLight", POINT + "\nrel light:filters = </Barn>")
    window = barn("float inputs:width = 0.5\nfloat inputs:height = 1", 3)
    free = picture(tmp_path, FLOOR + lamp("SphereLight", POINT))
    lit = picture(tmp_path, FLOOR + light + window)
    shares = lit[:, :, 0] / free[:, :, 0]
    # A pixel is 0.25 wide. The window at a quarter of the distance lights an area of 2 x 4.
    middle = shares[:, 8]
    assert middle == pytest.approx(np.ones(16), abs=1e-4)
    assert shares[8, :4] == pytest.approx(np.zeros(4), abs=1e-6)
    assert shares[8, 4:12] == pytest.approx(np.ones(8), abs=1e-4)
    assert shares[8, 12:] == pytest.approx(np.zeros(4), abs=1e-6)


def black(name, x0, x1, y0, y1, z):
    corners = [(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)]
    return f"""def Mesh "{name}" {{
        point3f[] points = {corners}
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        color3f[] primvars:displayColor = [(0, 0, 0)]
        {UNSEEN}
    }}
    """


GLOSSY = """def Material "Gloss" {
    token outputs:surface.connect = </Gloss/S.outputs:surface>
    def Shader "S" { uniform token info:id = "UsdPreviewSurface"
        float inputs:roughness = 0.35
        float inputs:metallic = 0.5
        token outputs:surface
    }
}
"""


@pytest.mark.parametrize("transport", ["path", "light"])
def test_a_barn_before_a_rect_is_four_boards(tmp_path, transport):
    """Light samples, bounces and light paths through a barn door, compared with real geometry."""
    floor = GLOSSY + quad("Floor", 3, 0, "rel material:binding = </Gloss>")
    size = "float inputs:width = 2\nfloat inputs:height = 2"
    window = barn("float inputs:width = 0.8\nfloat inputs:height = 1.6", 3)
    boards = (
        black("L", -9, -0.4, -9, 9, 3) + black("R", 0.4, 9, -9, 9, 3)
        + black("B", -9, 9, -9, -0.8, 3) + black("T", -9, 9, 0.8, 9, 3)
    )  # fmt: skip
    kept = {"spp": 256, "size": 8, "transport": transport}
    filtered = picture(
        tmp_path, floor + lamp("RectLight", size + "\nrel light:filters = </Barn>") + window, **kept
    )
    built = picture(
        tmp_path, floor + lamp("RectLight", size) + boards, **{**kept, "transport": "path"}
    )
    assert built.mean() > 0.02
    assert filtered.mean() == pytest.approx(built.mean(), rel=0.02)
    assert filtered[2:6, 2:6].mean() == pytest.approx(built[2:6, 2:6].mean(), rel=0.02)


def test_a_cookie_throws_its_picture(tmp_path):
    pixels = np.zeros((2, 2, 3), np.uint8)
    pixels[0, 0] = (255, 0, 0)  # top left
    pixels[1, 1] = (0, 0, 255)
    write_image(tmp_path / "slide.png", pixels, "uint8")
    text = barn(
        'asset inputs:textureMap = @slide.png@\ntoken inputs:tileMode = "clamp"\n'
        "float inputs:width = 2\nfloat inputs:height = 2",
        3,
    ).replace("PxrBarnLightFilter", "PxrCookieLightFilter")
    light = lamp("SphereLight", POINT + "\nrel light:filters = </Barn>")
    got = picture(tmp_path, FLOOR + light + text)
    red, blue = got[:4, :4].sum(axis=(0, 1)), got[-4:, -4:].sum(axis=(0, 1))
    assert red[0] > 0 and red[1] == 0 and red[2] < 0.05 * red[0]
    assert blue[2] > 0 and blue[1] == 0 and blue[0] < 0.05 * blue[2]
    assert got[:2, -2:].max() < 0.15 * got.max()  # linear between texels


def test_decay_is_by_the_distance(tmp_path):
    light = lamp("SphereLight", POINT + "\nrel light:filters = </Decay>", 4)
    decay = """def LightFilter "Decay" { uniform token lightFilter:shaderId = "light_decay"
        bool inputs:use_far_atten = 1
        float inputs:far_start = 3
        float inputs:far_end = 5
    }"""
    free = picture(tmp_path, FLOOR + lamp("SphereLight", POINT, 4))
    got = picture(tmp_path, FLOOR + light + decay)
    x = (np.arange(16) - 7.5) * 0.25
    distance = np.sqrt(16 + x[:, None] ** 2 + x[None, :] ** 2)
    assert got[:, :, 0] / free[:, :, 0] == pytest.approx(
        np.clip(1 - (distance - 3) / 2, 0, 1), abs=0.02
    )


def test_doors_of_a_spot_are_by_its_cone(tmp_path):
    doors = """def ArnoldBarndoor "Doors" {
        float arnold:barndoor_left_top = 0.5
        float arnold:barndoor_left_bottom = 0.5
    }"""
    body = POINT + "\nfloat inputs:shaping:cone:angle = 40\nrel light:filters = </Doors>"
    got = picture(tmp_path, FLOOR + lamp("SphereLight", body) + doors)
    assert (got[:, :8] == 0).all() and (got[:, 8:] > 0).all()


KARMA = 'def LightFilter "{0}" {{ uniform token lightFilter:shaderId = "{1}"\n{2}\n}}\n'
CONE = POINT + "\nfloat inputs:shaping:cone:angle = 36.86989764584402"
"""A light cone whose bounding square is 6 wide at distance 4 and thus covers the floor."""


def test_karmas_doors_stand_on_the_light_or_before_it(tmp_path):
    own = "custom float barndoorleft = 0.5\ncustom float barndoorbottomedge = 0.5"
    with_own = picture(tmp_path, FLOOR + lamp("SphereLight", f"{CONE}\n{own}"), spp=16)
    body = "float inputs:left = 0.5\nfloat inputs:bottomedge = 0.5"
    doors = KARMA.format("Doors", "karma:kma_lfilter_barndoor", body)
    got = picture(
        tmp_path,
        FLOOR + lamp("SphereLight", f"{CONE}\nrel light:filters = </Doors>") + doors,
        spp=16,
    )
    assert (got == with_own).all()
    free = picture(tmp_path, FLOOR + lamp("SphereLight", CONE), spp=16)
    edge = picture(
        tmp_path,
        FLOOR + lamp("SphereLight", f"{CONE}\ncustom float barndoorbottomedge = 0.5"),
        spp=16,
    )
    assert edge.sum() < free.sum(), "an edge alone dims, too"
    lit = free[:, :, 0] > 0
    shares = got[:, :, 0] / np.where(lit, free[:, :, 0], 1)
    assert (shares[:, :8] == 0).all() and lit.sum() > 100
    y = (7.5 - np.arange(16)) * 0.25 + 3
    t = np.clip(y / 6 / 0.5, 0, 1)[:, None] * np.ones((1, 8))
    fade = t * t * (3 - 2 * t)
    assert shares[:, 8:][lit[:, 8:]] == pytest.approx(fade[lit[:, 8:]], abs=0.02)


def test_karmas_gobo_lies_over_the_cone(tmp_path):
    pixels = np.zeros((2, 2, 3), np.uint8)
    pixels[0, 0] = (255, 0, 0)  # top left
    write_image(tmp_path / "slide.png", pixels, "uint8")
    body = "asset inputs:texture = @slide.png@\ncolor3f inputs:tint = (0.5, 1, 1)"
    light = lamp("SphereLight", CONE + "\nrel light:filters = </Gobo>")
    got = picture(tmp_path, FLOOR + light + KARMA.format("Gobo", "kma_lfilter_gobo", body))
    free = picture(tmp_path, FLOOR + lamp("SphereLight", CONE))
    assert got[1:3, 1:3, 0].mean() / free[1:3, 1:3, 0].mean() == pytest.approx(0.5, rel=0.1)
    assert got[13:, 13:].max() < 0.01 * got.max() and got[:, :, 1:].max() == 0


@pytest.mark.parametrize("kind", ["SphereLight", "DomeLight", "DistantLight"])
def test_gels_multiply_all_light(tmp_path, kind):
    gel = KARMA.format(
        "Gel", "kma_lfilter_gel", "color3f inputs:tint = (1, 0.5, 0)\nfloat inputs:exposure = 1"
    )
    mult = """def PxrIntMultLightFilter "Mult" { float inputs:ri:light:intensity = 0.25
        float inputs:ri:light:saturation = 0
        float inputs:ri:light:diffuse = 0.5
    }"""
    body = POINT if kind == "SphereLight" else ""
    both = "\nrel light:filters = [</Gel>, </Mult>]"
    free = picture(tmp_path, FLOOR + lamp(kind, body))
    got = picture(tmp_path, FLOOR + lamp(kind, body + both) + gel + mult)
    grey = 0.5 * 0.5 * (0.2126 + 0.5 * 0.7152)
    lit = free[:, :, 0] > 0
    assert got[lit] / free[lit] == pytest.approx(np.full((lit.sum(), 3), grey), rel=1e-3)


def test_what_is_not_done_is_listed(tmp_path):
    _, loaded = load(
        tmp_path,
        """def RectLight "A" { rel light:filters = [</Rod>, </Gone>, </Barn>] }
        def DomeLight "B" { rel light:filters = </Rod> }
        def PxrRodLightFilter "Rod" {}
        def PxrBarnLightFilter "Barn" { token inputs:barnMode = "analytic"
            float inputs:radius = 0.2
            uniform bool collection:filterLink:includeRoot = 0
            pathExpression collection:filterLink:membershipExpression = "//hero"
        }""",
    )
    listed = [finding.what for finding in loaded.report.unsupported]
    assert listed == [
        "light filter PxrRodLightFilter",
        "filterLink (light is filtered everywhere)",
        "analytic light barns (as physical ones)",
        "round corners of light barns (square)",
        "light filters of dome lights",
    ]
    assert "light filter /Gone does not exist" in said(loaded)


def test_filters_are_placed_with_their_lights(tmp_path):
    """In an instance, the filter moves with the light."""
    proto = """class "P" {
        def SphereLight "L" { rel light:filters = </P/Barn> }
        def PxrBarnLightFilter "Barn" { double3 xformOp:translate = (0, 0, -2)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }
    }
    """
    for name, x in (("I", 3), ("J", 5)):
        proto += f"""def Xform "{name}" (references = </P>
            instanceable = true) {{ double3 xformOp:translate = ({x}, 0, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }}
        """
    scene, _ = load(tmp_path, proto)
    assert [light["filter"] for light in scene.lights] == [0, 1]
    assert [f[0][3, :3].tolist() for f in scene.filters] == [[3, 0, -1], [5, 0, -1]]
