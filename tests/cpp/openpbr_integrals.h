// SPDX-License-Identifier: Apache-2.0
/// White furnace of OpenPBR by numerical integration of the model's formulas in double precision.
/// Rough interfaces use facet_integrals.h. The code uses no tables, fits or samplers of the shading
/// program. Colours are three numbers.
#pragma once

#include <array>
#include <memory>

#include "facet_integrals.h"
#include "wavecomb/material/openpbr_params.h"

namespace wavecomb::facet_integrals {

using Rgb = std::array<double, 3>;

/// Returns the response in linear Rec.709 to the spectrum cos(2 pi opd / lambda), where `opd` is an
/// optical path difference in nanometres. The result is 1 for a difference of 0 (Belcour and Barla
/// 2017, code that accompanies the paper).
inline Rgb film_response(double opd) {
  constexpr double kTau = 2 * std::numbers::pi;
  const auto raw = [](double nm) {
    const double phase = kTau * nm * 1e-9;
    const auto lobe = [phase](double value, double position, double variance) {
      return value * std::sqrt(kTau * variance) * std::cos(position * phase) *
             std::exp(-variance * phase * phase) / 1.0685e-7;
    };
    const double x = lobe(5.4856e-13, 1.6810e6, 4.3278e9) + lobe(9.7470e-14, 2.2399e6, 4.5282e9);
    const double y = lobe(4.4201e-13, 1.7953e6, 9.3046e9);
    const double z = lobe(5.2481e-13, 2.2084e6, 6.6121e9);
    return Rgb{3.2404542 * x - 1.5371385 * y - 0.4985314 * z,
               -0.9692660 * x + 1.8760108 * y + 0.0415560 * z,
               0.0556434 * x - 0.2040259 * y + 1.0572252 * z};
  };
  const Rgb at = raw(opd), still = raw(0);
  return {at[0] / still[0], at[1] / still[1], at[2] / still[2]};
}

/// Thin film on a base, computed as an Airy sum over the interference orders 0 to 3.
struct Film {
  double thickness, ior;

  /// Returns the reflectance of the film at cosine c. The arguments are the reflection amplitudes
  /// of the base inside the film.
  Rgb over(double c, const Rgb& base_s, const Rgb& base_p) const {
    const double grown = std::clamp(thickness / 30, 0.0, 1.0);
    const double eta = 1 + (ior - 1) * grown * grown * (3 - 2 * grown);
    const double t = fresnel(c, eta).cos_t;
    if (t <= 0) return {1, 1, 1};
    const double both = 2 * eta * thickness * t;
    const Rgb order[3] = {film_response(both), film_response(2 * both), film_response(3 * both)};
    const double s = (c - eta * t) / (c + eta * t), p = (eta * c - t) / (eta * c + t);
    Rgb all;
    for (size_t k = 0; k < 3; ++k) {
      const auto polarised = [&](double top, double bottom) {
        const double r12 = top * top, r23 = bottom * bottom, t121 = 1 - r12;
        const double rs = t121 * t121 * r23 / std::max(1 - r12 * r23, 1e-6);
        double sum = r12 + rs, c_m = rs - t121;
        for (const Rgb& o : order) sum += 2 * (c_m *= -top * bottom) * o[k];
        return sum;
      };
      all[k] = std::clamp(0.5 * (polarised(s, base_s[k]) + polarised(p, base_p[k])), 0.0, 1.0);
    }
    return all;
  }
  Rgb over_dielectric(double c, double base) const {
    const double grown = std::clamp(thickness / 30, 0.0, 1.0);
    const double eta = 1 + (ior - 1) * grown * grown * (3 - 2 * grown), relative = base / eta;
    const double t = fresnel(c, eta).cos_t, below = fresnel(t, relative).cos_t;
    double s = 1, p = 1;
    if (below > 0) {
      s = (t - relative * below) / (t + relative * below);
      p = (relative * t - below) / (relative * t + below);
    }
    return over(c, {s, s, s}, {p, p, p});
  }
  Rgb over_metal(double c, const Rgb& f) const {
    const Rgb root{std::sqrt(f[0]), std::sqrt(f[1]), std::sqrt(f[2])};
    return over(c, {-root[0], -root[1], -root[2]}, root);
  }
};

/// Colour as a function of a cosine, tabulated at 1025 points.
class Curve {
 public:
  template <typename Function>
  explicit Curve(Function f) : values_(kSteps + 1) {
    for (size_t i = 0; i <= kSteps; ++i)
      values_[i] = f(std::max(static_cast<double>(i), 1e-4) / kSteps);
  }
  double at(double c, size_t channel) const {
    const double x = std::clamp(c, 0.0, 1.0) * kSteps;
    const size_t i = std::min(static_cast<size_t>(x), kSteps - 1);
    const double t = x - static_cast<double>(i);
    return values_[i][channel] * (1 - t) + values_[i + 1][channel] * t;
  }

 private:
  static constexpr size_t kSteps = 1024;
  std::vector<Rgb> values_;
};

/// OpenPBR as docs/openpbr.md defines it, with a white coat, a white specular lobe and a smooth
/// diffuse lobe.
class OpenPbrModel {
 public:
  explicit OpenPbrModel(const OpenPbrParams<float>& p)
      : metal_(p.metallic),
        glass_((1 - metal_) * double{p.transmission_weight}),
        opaque_((1 - metal_) * (1 - double{p.transmission_weight})),
        ior_(p.ior),
        weight_(p.specular_weight),
        coat_(p.clearcoat),
        coat_roughness_(p.clearcoat_roughness),
        coat_ior_(std::max(double{p.coat_ior}, 1 / double{p.coat_ior})),
        darkening_(p.coat_darkening),
        fuzz_(p.fuzz_weight),
        fuzz_roughness_(p.fuzz_roughness),
        thin_(p.thin_walled > 0.5f),
        film_on_(p.film_weight) {
    const double r = double{p.roughness}, rough_coat = coat_roughness_;
    const double rougher =
        std::pow(std::min(std::pow(r, 4) + 2 * std::pow(rough_coat, 4), 1.0), 0.25);
    roughness_ = r + coat_ * (rougher - r);
    const double alpha = roughness_ * roughness_, narrow = 1 - double{p.anisotropy};
    smooth_ = alpha < 1e-3;
    const double along = std::min(alpha * std::sqrt(2 / (1 + narrow * narrow)), 1.0);
    ax_ = std::max(along, 1e-3);
    ay_ = std::max(along * narrow, 1e-3);
    base_ = {p.base_color.x, p.base_color.y, p.base_color.z};
    tint_ = {p.transmission_tint.x, p.transmission_tint.y, p.transmission_tint.z};
    edge_ = {p.specular_color.x, p.specular_color.y, p.specular_color.z};
    glass_ior_ = scaled(ior_);
    const double under = ior_ / (1 + coat_ * (double{p.coat_ior} - 1));
    gloss_ior_ = scaled(coat_ > 0 ? std::max(under, 1 / under) : std::max(ior_, 1 / ior_));
    if (film_on_ > 0) {
      const Film film{p.film_thickness, p.film_ior};
      over_metal_ = std::make_unique<Curve>([&](double c) { return film.over_metal(c, metal(c)); });
      over_gloss_ =
          std::make_unique<Curve>([&](double c) { return film.over_dielectric(c, gloss_ior_); });
      over_glass_ =
          std::make_unique<Curve>([&](double c) { return film.over_dielectric(c, glass_ior_); });
    }
  }

  /// Returns the radiance that the material reflects in a white furnace towards the direction with
  /// cosine z and azimuth phi. With `below`, the viewer is inside the material.
  Rgb seen(double z, double phi, bool below) const {
    const bool inside = below && glass_ > 0 && !thin_;
    const double eta = inside ? 1 / ior_ : ior_;
    const Seen facets(z, phi, smooth_ ? 0 : ax_, ay_, eta);
    const double white = facets.up([](double) { return 1.0; }), lost = (1 - white) / white;
    const double fuzz = inside ? 0 : fuzz_ * fuzz_albedo(z);
    const double coat = inside ? 0 : coat_ * coat_albedo(z, phi);
    const double covered = inside ? 0 : coat_;
    Rgb all;
    for (size_t k = 0; k < 3; ++k) {
      const auto filmed = [&](const std::unique_ptr<Curve>& film, double c, double bare) {
        return film ? bare + film_on_ * (film->at(c, k) - bare) : bare;
      };
      // Metal lobe.
      double base = metal_ * std::min(weight_, 1.0) * (1 + base_[k] * lost) *
                    facets.up([&](double c) { return filmed(over_metal_, c, metal(c)[k]); });
      // A dielectric interface over a diffuse base, which receives the transmitted light.
      const double f0 = fresnel(1, gloss_ior_).reflectance;
      const double gloss = (1 + f0 * lost) * facets.up([&](double c) {
        return filmed(over_gloss_, c, fresnel(c, gloss_ior_).reflectance);
      });
      base += opaque_ * (edge_[k] * gloss + base_[k] * (1 - gloss));
      if (glass_ > 0) base += glass_ * through(facets, eta, inside, white, k);
      const double dark = 1 + (inside ? 0 : darkening_) * (darkened(z, k) - 1);
      const double passes = (1 - covered) + dark * (covered - coat);
      all[k] = fuzz + (1 - fuzz) * (coat + passes * base);
    }
    return all;
  }

 private:
  class Seen {
   public:
    Seen(double z, double phi, double ax, double ay, double eta) : z_(z), eta_(eta) {
      if (ax > 0) rough_ = std::make_unique<SeenFacets>(z, phi, ax, ay, eta);
    }
    template <typename F>
    double up(F f) const {
      return rough_ ? rough_->up(f) : f(z_);
    }
    template <typename F>
    double mean(F f) const {
      if (rough_) return rough_->mean(f);
      return f(SeenFacets::Facet{z_, 1, fresnel(z_, eta_).cos_t > 0 ? 1.0 : 0.0});
    }

   private:
    double z_, eta_;
    std::unique_ptr<SeenFacets> rough_;
  };

  Rgb metal(double c) const {
    Rgb f;
    for (size_t k = 0; k < 3; ++k) {
      const double f0 = base_[k], schlick = std::pow(1 - c, 5);
      // At cosine 1 / 7, the reflectance is Schlick's value multiplied by the edge tint (Kutz et
      // al. 2021).
      const double at = f0 + (1 - f0) * std::pow(6.0 / 7, 5);
      const double b = at * (1 - edge_[k]) / (1.0 / 7 * std::pow(6.0 / 7, 6));
      f[k] = std::clamp(f0 + (1 - f0) * schlick - b * c * schlick * (1 - c), 0.0, 1.0);
    }
    return f;
  }

  /// Returns reflection plus transmission of glass, relative to white glass without a film;
  /// integrates over microfacets if the glass is anisotropic.
  double through(const Seen& facets, double eta, bool inside, double white, size_t k) const {
    const auto reflectance = [&](double c, double index) {
      const double t = fresnel(c, eta).cos_t;
      return !thin_ && t <= 0 ? 1 : fresnel(inside ? t : c, index).reflectance;
    };
    const auto with = [&](double c) {
      const double t = fresnel(c, eta).cos_t, bare = reflectance(c, glass_ior_);
      if (!over_glass_ || (!thin_ && t <= 0)) return bare;
      const double film = std::clamp(over_glass_->at(inside ? t : c, k), 1e-3, 1 - 1e-3);
      return bare + film_on_ * (film - bare);
    };
    if (thin_)
      return facets.up([&](double c) {
        const double r = with(c), wall = 2 * r / (1 + r);
        return edge_[k] * wall + tint_[k] * (1 - wall);
      }) / white;
    using Facet = SeenFacets::Facet;
    const bool brushed = ax_ != ay_ && !smooth_;
    const auto bare = [&](const Facet& f) {
      const double r = reflectance(f.cosine, ior_);
      return r * f.up + (1 - r) * f.down;
    };
    const double whole = brushed ? 1 : facets.mean(bare);
    return facets.mean([&](const Facet& f) {
      const double r = with(f.cosine), sum = r * f.up + (1 - r) * f.down;
      const double kept = sum > 0 ? (brushed ? 1 : bare(f)) / sum : 0;
      return kept * (edge_[k] * r * f.up + tint_[k] * (1 - r) * f.down);
    }) / whole;
  }

  double coat_albedo(double z, double phi) const {
    const double alpha = coat_roughness_ * coat_roughness_;
    const Seen facets(z, phi, alpha < 1e-3 ? 0 : alpha, alpha, coat_ior_);
    const double white = facets.up([](double) { return 1.0; });
    const double f0 = fresnel(1, coat_ior_).reflectance;
    return (1 + f0 * (1 - white) / white) *
           facets.up([&](double c) { return fresnel(c, coat_ior_).reflectance; });
  }

  /// Returns the darkening of the base by the coat, (1 - K) / (1 - K E) (OpenPBR, "Coat
  /// darkening").
  double darkened(double z, size_t k) const {
    const double smooth = fresnel(z, coat_ior_).reflectance;
    const double rough = 1 - (1 - mean_fresnel(coat_ior_)) / (coat_ior_ * coat_ior_);
    const double spread = opaque_ + (1 - opaque_) * roughness_;
    const double up = smooth + spread * (rough - smooth);
    const double e =
        std::min(base_[k] * std::min(weight_, 1.0) * metal_ + base_[k] * opaque_ + glass_, 1.0);
    return (1 - up) / (1 - up * e);
  }

  /// MaterialX's fit to the sheen model of Zeltner, Burley and Chiang, 2022.
  double fuzz_albedo(double x) const {
    const double y = std::clamp(fuzz_roughness_, 0.01, 1.0);
    const double s = y * (0.0206607 + 1.58491 * y) / (0.0379424 + y * (1.32227 + y));
    const double m =
        y * (-0.193854 + y * (-1.14885 + y * (1.7932 - 0.95943 * y * y))) / (0.046391 + y);
    const double o =
        y * (0.000654023 + (-0.0207818 + 0.119681 * y) * y) / (1.26264 + y * (-1.92021 + y));
    const double gauss =
        std::exp(-0.5 * std::pow((x - m) / s, 2)) / (s * std::sqrt(2 * std::numbers::pi));
    return std::clamp(gauss + o, 0.0, 1.0);
  }

  double scaled(double eta) const {
    const double root = (eta - 1) / (eta + 1);
    const double e = std::copysign(std::sqrt(std::min(weight_ * root * root, 0.66)), root);
    return (1 + e) / (1 - e);
  }

  double metal_, glass_, opaque_, ior_, weight_, coat_, coat_roughness_, coat_ior_, darkening_;
  double fuzz_, fuzz_roughness_;
  bool thin_, smooth_ = false;
  double film_on_, roughness_ = 0, ax_ = 0, ay_ = 0, glass_ior_ = 1, gloss_ior_ = 1;
  Rgb base_, tint_, edge_;
  std::unique_ptr<Curve> over_metal_, over_gloss_, over_glass_;
};

}  // namespace wavecomb::facet_integrals
