// SPDX-License-Identifier: Apache-2.0
/// Types of single render settings: choices, and regions of an image. Kernels include this header
/// instead of settings.h, so that a new setting does not rebuild them.
#pragma once

#include <cstddef>
#include <cstdint>

namespace wavecomb {

enum class SamplerKind : uint8_t { kSobol, kIndependent };
enum class FilterKind : uint8_t { kBox, kGaussian, kBlackmanHarris };

/// Returns the default full width of a pixel filter in pixels. The width is 1 for the box filter,
/// and 3 for the Gaussian (sigma 1/2, as in pbrt) and the Blackman-Harris window (as in Cycles).
constexpr float default_filter_width(FilterKind kind) {
  return kind == FilterKind::kBox ? 1.f : 3.f;
}

enum class IntegratorKind : uint8_t { kWavefront, kReference };
/// Use of pilot renders. With `kAuto`, pilot renders before the first pass decide about path
/// guiding if `Settings::guiding` is `kAuto`, and about light paths if `Settings::transport` is
/// `kAuto`. With `kPlain`, there are no pilot renders, and settings that are `kAuto` turn off path
/// guiding and light paths.
enum class Quality : uint8_t { kAuto, kPlain };
/// Light transport method. With `kPath`, all paths start at the camera. With `kLight`, a light path
/// is traced for each camera path, and both are combined by multiple importance sampling
/// (docs/light-paths.md). `kBdpt` also connects vertices of camera paths to vertices of light
/// paths. `kAuto` uses `kLight` if a pilot render predicts a gain, and `kPath` otherwise
/// (light_paths/render/transport_choice.h).
enum class Transport : uint8_t { kPath, kLight, kAuto, kBdpt };
/// Treatment of fireflies, which are very bright and rare samples: keep their full weight, or
/// reduce it (film/cascades.h).
enum class Firefly : uint8_t { kKeep, kReweight };
/// Method of selecting a light to sample at a vertex: by power, or with a light tree
/// (light/sampling/tree_choice.h). `kAuto` uses a light tree if the scene has enough lights for a
/// tree to reduce noise.
enum class LightSelection : uint8_t { kAuto, kTree, kPower };
/// Weights with which lights are selected. `kCalibrated` uses the contribution of each light to the
/// image, which is measured before the first pass (render/pilots/light_calibration.h). `kPower`
/// uses the power of each light.
enum class LightWeights : uint8_t { kCalibrated, kPower };
/// Method of Russian roulette (path/steps/survive.h). `kAuto` uses `kEfficient` in renders with
/// path guiding, and `kThroughput` in other renders.
enum class RouletteKind : uint8_t { kAuto, kOff, kThroughput, kCostAware, kEfficient };
/// Sorting of rays before traversal.
enum class RayOrder : uint8_t { kSlot, kMorton, kMortonOctant, kDirection, kAuto };
/// Source of the shading costs of materials. `kAuto` uses measured costs for the shading order, and
/// the fixed cost model for Russian roulette, so that images are reproducible.
enum class CostSource : uint8_t { kAuto, kMeasured, kModel };
/// Whether rays are passed to Embree in packets or one at a time.
enum class Traversal : uint8_t { kPackets, kSingle };
/// Texture filtering method. With `kAuto`, hits of camera rays use full filtering, and hits after
/// bounces read one random texel (docs/decisions/one-texel.md). With `kWhole`, all hits use full
/// filtering.
enum class TextureFilter : uint8_t { kAuto, kWhole };
/// Distribution of light splats over pixels. With `kFiltered`, a light splat contributes to all
/// pixels around it, with the weights of the pixel filter. With `kPixel`, it contributes to only
/// one of these pixels, chosen at random in proportion to the weights. This increases noise, but
/// makes the noise of different pixels independent, as denoisers expect. `kAuto` means `kPixel` if
/// the render stores the denoiser's guides, else `kFiltered`.
enum class LightSplats : uint8_t { kAuto, kFiltered, kPixel };
/// Distribution of a render's samples over pixels (render/passes/allotment.h).
enum class Allocate : uint8_t { kEven, kError, kEfficiency };
/// Path guiding, with a guiding field that is trained before the first pass
/// (render/pilots/guiding_training.h). `kAuto` turns path guiding on if a pilot render predicts a
/// gain and no light paths are used.
enum class Guiding : uint8_t { kAuto, kOn, kOff };
/// Whether queued hits are moved in memory into shading order, or read by index. `kAuto` means
/// `kOff`, which is faster.
enum class Materialize : uint8_t { kAuto, kOn, kOff };

/// Upper limits of the width and height of an image, and of the number of pixels.
inline constexpr uint32_t kMaxSize = 65535;
inline constexpr uint32_t kMaxPixels = 1u << 28;

/// Rectangle of pixels with the columns x0 to x1 - 1 and the rows y0 to y1 - 1. Row 0 is at the top
/// of the image.
struct Region {
  uint32_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;

  bool contains(uint32_t x, uint32_t y) const { return x >= x0 && x < x1 && y >= y0 && y < y1; }
  uint32_t width() const { return x1 - x0; }
  uint32_t height() const { return y1 - y0; }
  uint64_t pixels() const { return uint64_t{width()} * height(); }
  bool operator==(const Region&) const = default;
  /// Returns the row-major index of a pixel within the region.
  size_t index(uint32_t x, uint32_t y) const { return size_t{y - y0} * width() + (x - x0); }
};

}  // namespace wavecomb
