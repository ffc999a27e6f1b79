# SPDX-License-Identifier: Apache-2.0
"""Compare the albedo of UsdPreviewSurface in several implementations.

    .venv/bin/python benchmarks/preview_surface.py
    .venv/bin/python benchmarks/preview_surface.py --roughness 0.2 --base 1 --markdown

For each cosine of the viewing angle, prints the fraction of light that a surface in a white furnace
reflects:

- wavecomb: rendered from USD, one bounce;
- uncoupled: the earlier model, whose diffuse base is dimmed by the *smooth* interface's
  reflectance;
- glslfx: numerical integral of Storm's shader in OpenUSD (previewSurface.glslfx);
- MaterialX: the node graph of the MaterialX library (usd_preview_surface.mtlx), a Lambertian base
  times 1 - E, where E is the rough interface's albedo with Schlick's reflectance;
- Mitsuba's principled and roughplastic, integrated numerically if Mitsuba is installed.

Integrals are sums over 512 x 512 directions. docs/decisions/preview-surface.md quotes the results.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import wavecomb

Array = NDArray[np.float64]
COUNT = 512
COSINES = (0.1, 0.15, 0.2, 0.3, 0.5, 0.8, 1.0)


class Directions:
    """Directions of the upper hemisphere, in equal steps of cos^2 and azimuth."""

    def __init__(self) -> None:
        u, phi = np.meshgrid(
            (np.arange(COUNT) + 0.5) / COUNT, 2.0 * np.pi * (np.arange(COUNT) + 0.5) / COUNT
        )
        z, r = np.sqrt(u), np.sqrt(1.0 - u)
        self.wi = np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1)

    def albedo(self, value: Callable[[Array, Array], Array], z: float) -> float:
        """Return the albedo at cosine z, where `value` is the BSDF f(wo, wi)."""
        wo = np.array((np.sqrt(1.0 - z * z), 0.0, z))
        return float(np.pi * value(wo, self.wi).mean())


def exact(c: Array, ior: float) -> Array:
    """Fresnel reflectance of a dielectric."""
    t = np.sqrt(1.0 - (1.0 - c * c) / ior**2)
    return 0.5 * (((ior * c - t) / (ior * c + t)) ** 2 + ((c - ior * t) / (c + ior * t)) ** 2)


def schlick(c: Array, ior: float) -> Array:
    """Schlick's approximation of the Fresnel reflectance."""
    f0 = ((1.0 - ior) / (1.0 + ior)) ** 2
    return f0 + (1.0 - f0) * (1.0 - c) ** 5


def half(wo: Array, wi: Array) -> tuple[Array, Array]:
    """Cosines of the half vector with the normal and with wo."""
    h = wo + wi
    h = h / np.linalg.norm(h, axis=-1, keepdims=True)
    return h[..., 2], np.clip(h @ wo, 0.0, 1.0)


def ggx(wo: Array, wi: Array, alpha: float, fresnel: Callable[[Array], Array]) -> Array:
    """Return the GGX BRDF D G2 F / (4 z_o z_i) with height-correlated masking."""
    nh, oh = half(wo, wi)
    a2 = alpha * alpha
    d = a2 / (np.pi * (nh * nh * (a2 - 1.0) + 1.0) ** 2)
    zo, zi = wo[2], wi[..., 2]
    s = [np.sqrt(z * z + a2 * (1.0 - z * z)) for z in (zo, zi)]
    return fresnel(oh) * d * 0.5 / (zo * s[1] + zi * s[0])


def uncoupled(base: float, roughness: float, ior: float) -> Callable[[Array, Array], Array]:
    """Return the earlier BSDF, whose base has the factor (1 - F(o)) (1 - F(i)) / (1 - F_avg)."""
    z = np.sqrt((np.arange(4096) + 0.5) / 4096)
    mean = float(exact(z, ior).mean())

    def value(wo: Array, wi: Array) -> Array:
        through = (1.0 - exact(wo[2], ior)) * (1.0 - exact(wi[..., 2], ior)) / (1.0 - mean)
        return base / np.pi * through + ggx(wo, wi, roughness**2, lambda c: exact(c, ior))

    return value


def materialx(
    base: float, roughness: float, ior: float, directions: Directions
) -> Callable[[Array, Array], Array]:
    """Return the BSDF of MaterialX: generalized_schlick_bsdf over oren_nayar_diffuse_bsdf."""
    alpha = roughness**2

    def value(wo: Array, wi: Array) -> Array:
        specular = ggx(wo, wi, alpha, lambda c: schlick(c, ior))
        lost = np.pi * ggx(wo, directions.wi, alpha, lambda c: schlick(c, ior)).mean()
        return base / np.pi * (1.0 - lost) + specular

    return value


def glslfx(base: float, roughness: float, ior: float) -> Callable[[Array, Array], Array]:
    """Return the BSDF of evaluateLight in previewSurface.glslfx, without metal and clearcoat."""
    epsilon = 0.001

    def value(wo: Array, wi: Array) -> Array:
        nh, oh = half(wo, wi)
        alpha = max(roughness, 0.001) ** 2
        reflected = schlick(oh, ior)
        d = (alpha**2 + epsilon) / (np.pi * (nh * nh * (alpha**2 - 1.0) + 1.0) ** 2)
        k = 0.5 * alpha
        zo, zi = wo[2], wi[..., 2]
        g = zo / (zo * (1.0 - k) + k) * zi / (zi * (1.0 - k) + k)
        return base / np.pi * (1.0 - reflected) + reflected * d * g / (4.0 * zo * zi + epsilon)

    return value


def mitsuba_albedos(
    base: float, roughness: float, ior: float, directions: Directions
) -> dict[str, list[float]]:
    """Return the albedos of Mitsuba's principled and roughplastic for each view cosine."""
    try:
        import mitsuba as mi
    except ImportError:
        return {}
    mi.set_variant("scalar_rgb")
    color = {"type": "rgb", "value": [base] * 3}
    models = {
        "Mitsuba principled": {"base_color": color, "roughness": roughness, "eta": ior},
        "Mitsuba roughplastic": {
            "diffuse_reflectance": color, "alpha": roughness**2, "distribution": "ggx",
            "int_ior": ior, "ext_ior": 1.0, "nonlinear": True,
        },
    }  # fmt: skip
    out = {}
    step = 8  # use every eighth direction, as each takes a separate Mitsuba call
    wi = directions.wi[::step, ::step].reshape(-1, 3)
    for name, inputs in models.items():
        bsdf = mi.load_dict({"type": name.split()[1], **inputs})
        context = mi.BSDFContext()
        found = []
        for z in COSINES:
            si = mi.SurfaceInteraction3f()
            si.t = 1.0
            si.wi = [float(np.sqrt(1.0 - z * z)), 0.0, z]
            # eval gives f cos
            sums = [bsdf.eval(context, si, [float(x) for x in w])[0] / w[2] for w in wi]
            found.append(float(np.pi * np.mean(sums)))
        out[name] = found
    return out


def rendered(base: float, roughness: float, ior: float, spp: int) -> list[float]:
    """Render a plane under a uniform sky at each view cosine, by a camera with a narrow view."""
    found = []
    for z in COSINES:
        eye = 20.0 * np.array((0.0, z, np.sqrt(1.0 - z * z)))
        back, right = eye / 20.0, np.array((1.0, 0.0, 0.0))
        rows = [*right, 0, *np.cross(back, right), 0, *back, 0, *eye, 1]
        text = ", ".join(
            "(" + ", ".join(f"{x:.12g}" for x in rows[4 * i : 4 * i + 4]) + ")" for i in range(4)
        )
        stage = f"""#usda 1.0
(
    upAxis = "Y"
)
def DomeLight "Sky"
{{
    float inputs:intensity = 1
}}
def Camera "Camera" {{
    float focalLength = 5000
    float horizontalAperture = 1
    float verticalAperture = 1
    matrix4d xformOp:transform = ({text})
    uniform token[] xformOpOrder = ["xformOp:transform"]
}}
def Material "M" {{
    token outputs:surface.connect = </M/S.outputs:surface>
    def Shader "S" {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = ({base}, {base}, {base})
        float inputs:roughness = {roughness}
        float inputs:ior = {ior}
        token outputs:surface
    }}
}}
def Mesh "Plane" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {{
    point3f[] points = [(-99, 0, 99), (99, 0, 99), (99, 0, -99), (-99, 0, -99)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    rel material:binding = </M>
}}
"""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "plane.usda"
            path.write_text(stage)
            picture = wavecomb.render(
                path, size=(16, 16), spp=spp, max_depth=1, filter="box", filter_width=1.0
            )
        found.append(float(picture.beauty.mean()))
    return found


def table(base: float, roughness: float, ior: float, spp: int = 1024) -> dict[str, list[float]]:
    """Return the albedos of each model at the view cosines of COSINES."""
    directions = Directions()
    formulas = {
        "uncoupled": uncoupled(base, roughness, ior),
        "glslfx": glslfx(base, roughness, ior),
        "MaterialX": materialx(base, roughness, ior, directions),
    }
    return {
        "wavecomb": rendered(base, roughness, ior, spp),
        **{k: [directions.albedo(f, z) for z in COSINES] for k, f in formulas.items()},
        **mitsuba_albedos(base, roughness, ior, directions),
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--base", type=float, nargs="+", default=[0.2, 1.0])
    parser.add_argument("--roughness", type=float, nargs="+", default=[0.3, 0.4, 0.6])
    parser.add_argument("--ior", type=float, default=1.5)
    parser.add_argument("--spp", type=int, default=1024)
    parser.add_argument("--markdown", action="store_true", help="print Markdown tables")
    args = parser.parse_args()
    for base in args.base:
        for roughness in args.roughness:
            rows = table(base, roughness, args.ior, args.spp)
            head = [f"base {base:g}, roughness {roughness:g}", *(f"{z:g}" for z in COSINES)]
            lines = [head, *([k, *(f"{x:.3f}" for x in v)] for k, v in rows.items())]
            if args.markdown:
                lines.insert(1, ["---"] * len(head))
                print("\n".join("| " + " | ".join(x) + " |" for x in lines))
            else:
                for line in lines:
                    print(f"{line[0]:<28}" + "".join(f"{x:>8}" for x in line[1:]))
            print()


if __name__ == "__main__":
    main()
