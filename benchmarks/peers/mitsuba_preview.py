# SPDX-License-Identifier: Apache-2.0
"""Wavecomb's UsdPreviewSurface as a BSDF of Mitsuba 3, in its vectorised variants.

The BSDF follows the formulas of program "principled" (docs/decisions/preview-surface.md), but
shares no code with it: albedos of rough interfaces are numerical integrals instead of polynomials,
and smooth interfaces have alpha 0.001 instead of delta lobes. Two uses:

- materials with opacity below 1: Mitsuba has no plugin that transmits light without refraction
  below a Fresnel reflection;
- all materials, if the same image is expected of both renderers (benchmarks/peers/brightness.py).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MIN_ALPHA = 1e-3
_Z_COUNT, _ROUGHNESS_COUNT, _SAMPLES = 64, 32, 1024
_LEAST = float(np.sqrt(MIN_ALPHA))


def schlick_weight(c: Array, ior: float) -> Array:
    """(1 - c)^5; the index has no effect."""
    return (1.0 - c) ** 5


def exact_weight(c: Array, ior: float) -> Array:
    """(F(c) - F(1)) / (1 - F(1)) of the exact reflectance F of a dielectric."""
    t = np.sqrt(1.0 - (1.0 - c * c) / ior**2)
    f = 0.5 * (((ior * c - t) / (ior * c + t)) ** 2 + ((c - ior * t) / (c + ior * t)) ** 2)
    f0 = ((ior - 1.0) / (ior + 1.0)) ** 2
    return (f - f0) / (1.0 - f0)


def visible_normals(z: float, alpha: float) -> tuple[Array, Array]:
    """Return o.h and G2 / G1 of visible GGX normals for a view of cosine z (Heitz, see ggx.h)."""
    k = np.arange(_SAMPLES)
    u, v = (k + 0.5) / _SAMPLES, (k * 0.6180339887498949) % 1.0
    o = np.array((np.sqrt(max(1.0 - z * z, 0.0)), 0.0, z))
    vh = o * (alpha, 1.0, 1.0)
    vh /= np.linalg.norm(vh)
    t1 = np.array((0.0, 1.0, 0.0))
    t2 = np.cross(vh, t1)
    r, phi = np.sqrt(u), 2.0 * np.pi * v
    p1, p2 = r * np.cos(phi), r * np.sin(phi)
    s = 0.5 * (1.0 + vh[2])
    p2 = (1.0 - s) * np.sqrt(np.maximum(1.0 - p1 * p1, 0.0)) + s * p2
    p3 = np.sqrt(np.maximum(1.0 - p1 * p1 - p2 * p2, 0.0))
    n = p1[:, None] * t1 + p2[:, None] * t2 + p3[:, None] * vh
    h = n * (alpha, alpha, 1.0)
    h[:, 2] = np.maximum(h[:, 2], 0.0)
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    oh = np.clip(h @ o, 0.0, 1.0)
    zi = 2.0 * oh * h[:, 2] - z

    def root(c: Array) -> Array:
        return np.sqrt(c * c + alpha * alpha * (1.0 - c * c))

    so, si = root(np.asarray(z)), root(zi)
    share = np.where(zi > 0.0, zi * (z + so) / (z * si + zi * so + 1e-30), 0.0)
    return oh, share


@dataclass(frozen=True)
class Albedos:
    """Integrals over visible normals, (roughness, cosine): sums of G2 / G1, and of it times w."""

    passed: Array
    exact: Array
    schlick: Array

    @staticmethod
    def means(table: Array) -> Array:
        """Return 2 int t(z) z dz by roughness; cosines are squares of equal steps."""
        u = (np.arange(_Z_COUNT) + 0.5) / _Z_COUNT
        return np.asarray((4.0 * table * u**3).mean(axis=1) / (4.0 * u**3).mean())


@cache
def albedos(ior: float) -> Albedos:
    """Tabulate the integrals for an index of refraction."""
    shape = (_ROUGHNESS_COUNT, _Z_COUNT)
    passed, exact, schlick = (np.empty(shape) for _ in range(3))
    for row in range(_ROUGHNESS_COUNT):
        roughness = _LEAST + (1.0 - _LEAST) * (row + 0.5) / _ROUGHNESS_COUNT
        for column in range(_Z_COUNT):
            z = ((column + 0.5) / _Z_COUNT) ** 2
            oh, share = visible_normals(z, roughness**2)
            passed[row, column] = share.mean()
            exact[row, column] = (share * exact_weight(oh, ior)).mean()
            schlick[row, column] = (share * schlick_weight(oh, ior)).mean()
    return Albedos(passed, exact, schlick)


def smooth_mean(ior: float) -> float:
    """Return 2 int w(c) c dc of the exact weight."""
    c = np.sqrt((np.arange(4096) + 0.5) / 4096)
    return float(exact_weight(c, ior).mean())


@dataclass
class _Surface:
    """Parameters of the hit points of one call."""

    alpha: Any
    roughness: Any
    f0: Any
    metallic: Any
    diffuse: Any
    multiple: Any
    lost_mean: Any
    mean: Any


@cache
def preview_surface(mi: ModuleType) -> Any:
    """Make the class of the BSDF for the current variant."""
    import drjit as dr

    class PreviewSurface(mi.BSDF):  # type: ignore[misc, name-defined]
        """See the module. Inputs are textures or numbers."""

        def __init__(self, inputs: dict[str, Any]) -> None:
            super().__init__(mi.Properties())
            self.inputs = inputs
            self.ior = float(max(inputs["ior"], 1.0 / inputs["ior"]))
            self.clearcoat = float(inputs["clearcoat"])
            self.coat_roughness = max(float(inputs["clearcoat_roughness"]), _LEAST)
            self.opacity = float(inputs["opacity"])
            table = albedos(self.ior)
            layers = (table.passed, table.exact, table.schlick)
            self.table = mi.Texture2f(mi.TensorXf(np.stack(layers, axis=-1).astype(np.float32)))
            means = np.stack([Albedos.means(t) for t in layers], axis=-1).astype(np.float32)
            self.means = mi.Texture1f(mi.TensorXf(means))
            self.smooth_mean = smooth_mean(self.ior)
            sides = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            components = [mi.BSDFFlags.GlossyReflection | sides]
            if self.opacity < 1.0:
                components.append(mi.BSDFFlags.Null | sides)
            self.m_components = components
            self.m_flags = components[0] | components[-1]

        def _color(self, name: str, si: Any, active: Any) -> Any:
            return self.inputs[name].eval(si, active)

        def _number(self, name: str, si: Any, active: Any) -> Any:
            value = self.inputs[name]
            return mi.Float(value) if isinstance(value, float) else value.eval_1(si, active)

        def _albedos(self, z: Any, roughness: Any) -> Any:
            row = (roughness - _LEAST) / (1.0 - _LEAST)
            return self.table.eval(mi.Point2f(dr.sqrt(dr.maximum(z, 0.0)), row))

        def _surface(self, si: Any, active: Any) -> _Surface:
            base = self._color("base_color", si, active)
            metallic = self._number("metallic", si, active)
            roughness = dr.clip(self._number("roughness", si, active), _LEAST, 1.0)
            f0 = dr.lerp(mi.Color3f(((self.ior - 1.0) / (self.ior + 1.0)) ** 2), base, metallic)
            passed, exact, schlick = self.means.eval(
                mi.Point1f((roughness - _LEAST) / (1.0 - _LEAST))
            )
            lost = 1.0 - passed
            f = f0 + (1.0 - f0) * dr.lerp(mi.Float(self.smooth_mean), 1.0 / 21.0, metallic)
            multiple = f * f * (1.0 - lost) / (1.0 - f * lost)
            mean = f0 * passed + (1.0 - f0) * dr.lerp(exact, schlick, metallic) + multiple * lost
            diffuse = base * (1.0 - metallic) * self.opacity
            return _Surface(roughness**2, roughness, f0, metallic, diffuse, multiple, lost, mean)

        def _specular(self, s: _Surface, z: Any) -> tuple[Any, Any]:
            """Albedo of the interface with multiple scattering, and the loss without it."""
            passed, exact, schlick = self._albedos(z, s.roughness)
            lost = 1.0 - passed
            one = s.f0 * passed + (1.0 - s.f0) * dr.lerp(exact, schlick, s.metallic)
            return one + s.multiple * lost, lost

        def _coat(self, z: Any) -> Any:
            passed, exact, _ = self._albedos(z, mi.Float(self.coat_roughness))
            f0 = ((self.ior - 1.0) / (self.ior + 1.0)) ** 2
            return self.clearcoat * (f0 * passed + (1.0 - f0) * exact)

        def _weight(self, c: Any, metallic: Any) -> Any:
            c = dr.clip(c, 0.0, 1.0)
            t = dr.sqrt(1.0 - (1.0 - c * c) / self.ior**2)
            p, s = (self.ior * c - t) / (self.ior * c + t), (c - self.ior * t) / (c + self.ior * t)
            f0 = ((self.ior - 1.0) / (self.ior + 1.0)) ** 2
            exact = (0.5 * (p * p + s * s) - f0) / (1.0 - f0)
            return dr.lerp(exact, (1.0 - c) ** 5, metallic)

        def _ggx(self, wo: Any, wi: Any, alpha: Any) -> tuple[Any, Any, Any]:
            """Return o.h, D G2 / (4 z_o), and the density of reflected visible normals."""
            h = dr.normalize(wo + wi)
            a2 = alpha * alpha
            d = a2 / (dr.pi * dr.square(h.z * h.z * a2 + h.x * h.x + h.y * h.y))
            so, si = (dr.sqrt(w.z * w.z + a2 * (w.x * w.x + w.y * w.y)) for w in (wo, wi))
            value = d * 0.5 * wi.z / dr.maximum(wo.z * si + wi.z * so, 1e-20)
            return dr.dot(wo, h), value, 0.5 * d / (wo.z + so)

        def _probabilities(self) -> tuple[float, float, float, float]:
            """Probabilities of cosine, specular, coat and straight samples."""
            straight = 0.6 * (1.0 - self.opacity)
            coat = 0.25 * (1.0 - straight) if self.clearcoat > 0.0 else 0.0
            rest = 0.5 * (1.0 - straight - coat)
            return rest, rest, coat, straight

        def _values(self, s: _Surface, wo: Any, wi: Any) -> tuple[Any, Any]:
            """Value times cosine, and density, for directions above the surface."""
            cosine, specular, coat, _ = self._probabilities()
            e_o, lost_o = self._specular(s, wo.z)
            e_i, lost_i = self._specular(s, wi.z)
            f = s.diffuse * (1.0 - e_o) * (1.0 - e_i) / dr.maximum(1.0 - s.mean, 1e-4)
            f += s.multiple * (lost_o * lost_i / dr.maximum(s.lost_mean, 1e-6))
            f *= wi.z / dr.pi
            oh, glossy, density = self._ggx(wo, wi, s.alpha)
            f += (s.f0 + (1.0 - s.f0) * self._weight(oh, s.metallic)) * glossy
            pdf = cosine * wi.z / dr.pi + specular * density
            if self.clearcoat > 0.0:
                f *= 1.0 - self._coat(dr.minimum(wo.z, wi.z))
                oh, glossy, density = self._ggx(wo, wi, mi.Float(self.coat_roughness**2))
                f0 = ((self.ior - 1.0) / (self.ior + 1.0)) ** 2
                f += self.clearcoat * (f0 + (1.0 - f0) * self._weight(oh, 0.0)) * glossy
                pdf += coat * density
            return f, pdf

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
            s = self._surface(si, active)
            side = dr.sign(si.wi.z)
            o = mi.Vector3f(si.wi.x, si.wi.y, dr.abs(si.wi.z))
            i = mi.Vector3f(wo.x, wo.y, wo.z * side)
            f, pdf = self._values(s, o, i)
            seen = mi.Bool(active) & (o.z > 0.0) & (i.z > 0.0)
            return mi.Color3f(f) & seen, dr.select(seen, pdf, 0.0)

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval_pdf(ctx, si, wo, active)[0]

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval_pdf(ctx, si, wo, active)[1]

        def sample(
            self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True
        ) -> tuple[Any, Any]:
            cosine, specular, coat, straight = self._probabilities()
            s = self._surface(si, active)
            side = dr.sign(si.wi.z)
            o = mi.Vector3f(si.wi.x, si.wi.y, dr.abs(si.wi.z))
            alpha = dr.select(sample1 < cosine + specular, s.alpha, self.coat_roughness**2)
            ggx = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha, alpha, True)
            normal, _ = ggx.sample(o, sample2)
            i = mi.reflect(o, normal)
            diffuse = sample1 < cosine
            i = dr.select(diffuse, mi.warp.square_to_cosine_hemisphere(sample2), i)
            f, pdf = self._values(s, o, i)
            passes = sample1 >= cosine + specular + coat
            valid = mi.Bool(active) & (o.z > 0.0) & (passes | ((i.z > 0.0) & (pdf > 0.0)))
            weight = f / dr.maximum(pdf, 1e-20)
            if straight > 0.0:
                through = (1.0 - self._specular(s, o.z)[0]) * (1.0 - self.opacity)
                if self.clearcoat > 0.0:
                    through *= 1.0 - self._coat(o.z)
                weight = dr.select(passes, through / straight, weight)
            out = dr.zeros(mi.BSDFSample3f)
            out.wo = dr.select(passes, -si.wi, mi.Vector3f(i.x, i.y, i.z * side))
            out.pdf = dr.select(passes, straight, pdf)
            out.eta = 1.0
            out.sampled_component = dr.select(passes, mi.UInt32(1), mi.UInt32(0))
            out.sampled_type = dr.select(
                passes,
                mi.UInt32(int(mi.BSDFFlags.Null)),
                mi.UInt32(int(mi.BSDFFlags.GlossyReflection)),
            )
            return out, mi.Color3f(weight) & valid

        def to_string(self) -> str:
            return "PreviewSurface[]"

    return PreviewSurface
