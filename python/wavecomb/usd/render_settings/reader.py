# SPDX-License-Identifier: Apache-2.0
"""Reads render settings of a stage and maps its render vars to AOVs.

A render var is recognised by the name that a renderer uses for it, or by its light path expression.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdRender

from wavecomb import _core
from wavecomb.errors import WavecombError
from wavecomb.run import aovs as aov_names
from wavecomb.run import expressions
from wavecomb.usd.materials.network import number, word
from wavecomb.usd.stage.report import LoadReport

CONFORMS = (
    "expandAperture",
    "cropAperture",
    "adjustApertureWidth",
    "adjustApertureHeight",
    "adjustPixelAspectRatio",
)
"""Values of UsdRender's aspectRatioConformPolicy."""


@dataclass(frozen=True)
class ProductSettings:
    """Values of render settings and one of their products; None means that a value is not authored.

    Attributes:
        settings: Path of the RenderSettings prim.
        product: Path of the RenderProduct prim.
        camera: Path of the camera prim.
        resolution: Width and height in pixels.
        pixel_aspect: Width of a pixel divided by its height.
        conform: One of ``CONFORMS``.
        data_window: (xmin, ymin, xmax, ymax) from 0 to 1 over the image, y up.
        purposes: Purposes of the geometry that is rendered.
        material_purposes: Purposes of material bindings in order of preference.
        motion_blur: Whether motion blur is enabled.
        depth_of_field: Whether depth of field is enabled.
        aovs: Names of layers in the syntax of ``--aov``.
        output: Name of the image file.
        start: Start time code of the stage.
    """

    settings: str | None = None
    product: str | None = None
    camera: str | None = None
    resolution: tuple[int, int] | None = None
    pixel_aspect: float = 1.0
    conform: str = CONFORMS[0]
    data_window: tuple[float, float, float, float] | None = None
    purposes: tuple[str, ...] | None = None
    material_purposes: tuple[str, ...] | None = None
    motion_blur: bool = True
    depth_of_field: bool = True
    aovs: tuple[str, ...] | None = None
    output: str | None = None
    start: float | None = None

    @property
    def first_frame(self) -> float:
        """Frame that is rendered by default; 1 if the stage has no start time code."""
        return 1.0 if self.start is None else self.start

    def region(self, width: int, height: int) -> tuple[int, int, int, int] | None:
        """Returns the pixels whose centres are in the data window as x0, y0, x1, y1.

        The y axis points down, and the end is excluded. Returns None if the data window contains
        all pixels.

        Raises:
            WavecombError: The window contains no pixel.
        """
        if self.data_window is None:
            return None
        left, low, right, high = self.data_window
        x0, x1 = (math.ceil(edge * width - 0.5) for edge in (left, right))
        y0, y1 = (math.ceil((1.0 - edge) * height - 0.5) for edge in (high, low))
        x0, y0, x1, y1 = max(x0, 0), max(y0, 0), min(x1, width), min(y1, height)
        if x0 >= x1 or y0 >= y1:
            raise WavecombError(
                f"{self.product or self.settings}: dataWindowNDC contains no pixel of the image; "
                "fix it or give --region"
            )
        return None if (x0, y0, x1, y1) == (0, 0, width, height) else (x0, y0, x1, y1)


MAX_PRODUCTS = 256
_PURPOSES = ("default", "render", "proxy", "guide")


def find_settings(
    stage: Usd.Stage, wanted: str | None, report: LoadReport
) -> UsdRender.Settings | None:
    """Returns the settings named ``wanted``, else the default settings or the only ones in /Render.

    Raises:
        WavecombError: There are no render settings of that path or name.
    """
    found = _all_settings(stage)
    if wanted is not None:
        if Sdf.Path.IsValidPathString(wanted) and wanted.startswith("/"):
            prim = stage.GetPrimAtPath(wanted)
            if prim and prim.IsA(UsdRender.Settings):
                return UsdRender.Settings(prim)
        named = [settings for settings in found if settings.GetPrim().GetName() == wanted]
        if len(named) == 1:
            return named[0]
        known = ", ".join(str(settings.GetPath()) for settings in found[:8]) or "none"
        raise WavecombError(f"--render-settings {wanted}: no such prim; the stage has: {known}")
    named_by_stage = UsdRender.Settings.GetStageRenderSettings(stage)
    if named_by_stage:
        return named_by_stage
    if path := stage.GetMetadata("renderSettingsPrimPath"):
        report.warn(f"renderSettingsPrimPath {path}: there are no render settings of that path")
    if len(found) > 1:
        report.note("several render settings and none named by the stage: none used")
    return found[0] if len(found) == 1 else None


def _all_settings(stage: Usd.Stage) -> list[UsdRender.Settings]:
    """Returns the settings under /Render, where OpenUSD requires them."""
    scope = stage.GetPrimAtPath("/Render")
    prims = Usd.PrimRange(scope) if scope else ()
    return [UsdRender.Settings(prim) for prim in prims if prim.IsA(UsdRender.Settings)]


def find_products(
    stage: Usd.Stage, settings: UsdRender.Settings | None, report: LoadReport
) -> list[UsdRender.Product]:
    """Returns the raster products of render settings, in their order."""
    found: list[UsdRender.Product] = []
    if settings is None:
        return found
    for path in settings.GetProductsRel().GetForwardedTargets()[:MAX_PRODUCTS]:
        product = UsdRender.Product(stage.GetPrimAtPath(path))
        if not product:
            report.warn("render product left out: there is no such prim", path)
            continue
        kind = word(product.GetProductTypeAttr().Get(), "raster")
        if kind == "raster":
            found.append(product)
        else:
            report.missing(f"render product of type {kind}", path)
    return found


def read_product_settings(
    stage: Usd.Stage, wanted: str | None, product: str | None, report: LoadReport
) -> list[ProductSettings]:
    """Returns the settings of each product to render; default settings if there are none.

    Args:
        stage: The stage.
        wanted: Path or name of render settings; None uses the default of ``find_settings``.
        product: Path or name of the only product to render; None renders all.
        report: Collects warnings and unsupported features.

    Raises:
        WavecombError: No settings or product have that path or name.
    """
    settings = find_settings(stage, wanted, report)
    products = find_products(stage, settings, report)
    if product is not None:
        chosen = [p for p in products if product in (str(p.GetPath()), p.GetPrim().GetName())]
        if len(chosen) != 1:
            known = ", ".join(str(p.GetPath()) for p in products[:8]) or "none"
            raise WavecombError(f"--product {product}: no such product; the stage has: {known}")
        products = chosen
    if settings is None:
        return [ProductSettings()]
    return [_read(stage, settings, p, report) for p in products or [None]]


def _read(
    stage: Usd.Stage,
    settings: UsdRender.Settings,
    product: UsdRender.Product | None,
    report: LoadReport,
) -> ProductSettings:
    """Returns the values of a product, or of the settings if the product does not author them."""
    prims = [p.GetPrim() for p in (product, settings) if p is not None]

    def value(name: str, good: Callable[[Any], bool]) -> Any:
        for prim in prims:
            attribute = prim.GetAttribute(name)
            if not attribute.HasAuthoredValue():
                continue
            got = attribute.Get()
            if good(got):
                return got
            report.warn(f"{name} of render settings is invalid: left out", prim.GetPath())
        return None

    resolution = value("resolution", _is_size)
    window = value("dataWindowNDC", _is_window)
    if window is not None:
        window = tuple(float(edge) for edge in window)
        if min(window[:2]) < 0 or max(window[2:]) > 1:
            where = product if product is not None else settings
            report.missing("overscan: dataWindowNDC beyond the image is cropped", where.GetPath())
    off = {
        name: bool(value(name, _is_switch))
        for name in ("disableMotionBlur", "instantaneousShutter", "disableDepthOfField")
    }
    aspect = value("pixelAspectRatio", lambda x: 0 < number(x, 0.0) <= 1e6)
    name = None if product is None else word(product.GetProductNameAttr().Get())
    color_space = settings.GetPrim().GetAttribute("renderingColorSpace")
    if color_space and word(color_space.Get()) not in ("", "lin_rec709_scene", "lin_rec709"):
        report.missing(f"renderingColorSpace {color_space.Get()}", settings.GetPath())
    return ProductSettings(
        settings=str(settings.GetPath()),
        product=None if product is None else str(product.GetPath()),
        camera=_camera(stage, prims, report),
        resolution=None if resolution is None else (int(resolution[0]), int(resolution[1])),
        pixel_aspect=1.0 if aspect is None else float(aspect),
        conform=value("aspectRatioConformPolicy", CONFORMS.__contains__) or CONFORMS[0],
        data_window=window,
        purposes=_tokens(settings.GetIncludedPurposesAttr(), _PURPOSES, report),
        material_purposes=_tokens(settings.GetMaterialBindingPurposesAttr(), None, report),
        motion_blur=not (off["disableMotionBlur"] or off["instantaneousShutter"]),
        depth_of_field=not off["disableDepthOfField"],
        aovs=None if product is None else _vars(stage, product, report),
        output=name or None,
    )


def _is_size(value: Any) -> bool:
    return hasattr(value, "__len__") and len(value) == 2 and min(value) >= 1


def _is_window(value: Any) -> bool:
    if not hasattr(value, "__len__") or len(value) != 4 or not np.isfinite(list(value)).all():
        return False
    return bool(value[0] < value[2] and value[1] < value[3])


def _is_switch(value: Any) -> bool:
    return isinstance(value, bool)


def _camera(stage: Usd.Stage, prims: Sequence[Usd.Prim], report: LoadReport) -> str | None:
    """Returns the first camera that render settings or products name."""
    for prim in prims:
        for path in UsdRender.SettingsBase(prim).GetCameraRel().GetForwardedTargets():
            camera = stage.GetPrimAtPath(path)
            if camera and camera.IsA(UsdGeom.Camera):
                return str(path)
            report.warn(f"render settings name {path}, which is not a camera", prim.GetPath())
    return None


def _tokens(
    attribute: Usd.Attribute, known: Sequence[str] | None, report: LoadReport
) -> tuple[str, ...] | None:
    if not attribute.HasAuthoredValue():
        return None
    names = tuple(map(str, attribute.Get() or ()))
    for name in names:
        if known is not None and name not in known:
            what = f"{attribute.GetName()} of render settings: no purpose {name!r}"
            report.warn(what, attribute.GetPrimPath())
    return tuple(name for name in names if known is None or name in known) or None


def _vars(
    stage: Usd.Stage, product: UsdRender.Product, report: LoadReport
) -> tuple[str, ...] | None:
    """Returns the AOVs of a product's vars in order; None if it lists no vars."""
    found: dict[str, None] = {}
    targets = product.GetOrderedVarsRel().GetForwardedTargets()
    for path in targets:
        var = UsdRender.Var(stage.GetPrimAtPath(path))
        if not var:
            report.warn("render var left out: there is no such prim", path)
            continue
        name = aov_of(var)
        if name is None:
            report.missing(f"render var {word(var.GetSourceNameAttr().Get())!r}", path)
        else:
            found[name] = None
    return tuple({"beauty": None, **found}) if targets else None


_NAMES = {
    "beauty": ("Ci", "C", "color", "rgb", "rgba", "RGB", "RGBA"),
    "albedo": ("diffuse_albedo", "Albedo"),
    "normal": ("N", "Nn", "Nworld", "normals"),
    "depth": ("z", "Z", "linearDepth", "cameraDepth"),
    "position": ("P", "Pworld", "__Pworld"),
    "uv": ("st", "UV", "texcoord"),
    "alpha": ("a", "A", "Alpha"),
    "instance_id": ("instanceId", "id"),
    "material_id": ("materialId",),
    "samples": ("sampleCount", "samplecount"),
    "cost": ("cpuTime", "cputime"),
    "crypto_object": ("CryptoObject", "cryptoObject", "cryptomatte_object"),
    "crypto_material": ("CryptoMaterial", "cryptoMaterial", "cryptomatte_material"),
    "crypto_asset": ("CryptoAsset", "cryptoAsset", "cryptomatte_asset"),
    "crypto": ("cryptomatte", "Cryptomatte"),
}
_AOV_OF = {other: name for name, others in _NAMES.items() for other in others}

_EVENTS = {
    "beauty": (".*",),
    "emission": ("",),
    "direct": (".", "<..>", "<.*>"),
    "indirect": ("..+", "...*", ".{2,}", "<..><..>+"),
}
_PARTS = {events: name for name, all_events in _EVENTS.items() for events in all_events}
"""Maps the light path events between the camera and the light to the name of the AOV."""

_LIGHT = r"(?:\[<L\.>O\]|\[LO\]|\[OL\]|\(L\|O\)|<L\.>|L)"
_EXPRESSION = re.compile(rf"C(?P<events>.*?){_LIGHT}")
_GROUP = re.compile(r"C(?P<events>.*?)<L\.?'(?P<group>[^']+)'>")


def aov_of(prim: UsdRender.Var) -> str | None:
    """Returns the AOV of a render var in the syntax of ``--aov``; None if it is not supported."""
    name = word(prim.GetSourceNameAttr().Get())
    kind = word(prim.GetSourceTypeAttr().Get(), "raw")
    if kind == "lpe" or name.startswith(("lpe:", "color lpe:")):
        return _of_expression(name.rpartition("lpe:")[2], prim.GetPrim().GetName())
    if kind == "primvar" or name.startswith("primvars:"):
        return "uv" if name.removeprefix("primvars:") in ("st", "uv") else None
    if name in aov_names.names() or name == "crypto" or name.startswith(aov_names.LIGHT):
        return name
    if name not in _AOV_OF and name in expressions.NAMED:
        return expressions.spelled(expressions.PREFIX + name)
    return _AOV_OF.get(name)


def _of_expression(text: str, name: str) -> str | None:
    """Returns the AOV of a light path expression; None if it is invalid.

    All other expressions become custom AOVs that are named after their render vars.

    >>> [_of_expression(text, "a") for text in ("C.*", "C<..>[<L.>O]", "C.*<L.'key'>", "C<RD>L")]
    ['beauty', 'direct', 'light_key', 'lpe:a=C<RD>L']
    """
    text = "".join(text.split())
    if text == "C.*":
        return "beauty"
    group = _GROUP.fullmatch(text)
    if group is not None and group["events"] == ".*":
        return aov_names.LIGHT + group["group"]
    whole = _EXPRESSION.fullmatch(text)
    if whole is not None and whole["events"] in _PARTS:
        return _PARTS[whole["events"]]
    aov = expressions.as_aov(text, name)
    try:
        _core.Settings(aovs=[aov]).check()
    except _core.Error:
        return None
    return aov
