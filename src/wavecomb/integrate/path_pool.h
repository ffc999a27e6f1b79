// SPDX-License-Identifier: Apache-2.0
/// The path slots of a wave.
#pragma once

#include "wavecomb/core/fields.h"
#include "wavecomb/core/sampler.h"
#include "wavecomb/core/soa.h"
#include "wavecomb/core/vec.h"

namespace wavecomb {

/// What the rows of paths and of shadow rays begin with.
template <typename F>
struct RayHead {
  Vec3<F> o, d;
  WAVECOMB_FIELDS(o, d)
};

/// A path between two vertices: what every vertex reads, and writes anew for the next ray.
template <typename F>
struct PathRow {
  Vec3<F> o, d;  ///< the ray to be traced
  Color<F> throughput;
  F pdf;                      ///< density of the bounce that made the ray; 0: delta or camera; less
                              ///< than that: below a surface, to walk there
  F eta_scale;                ///< product of eta^2 of the interfaces crossed, for roulette
  F cone_width, cone_spread;  ///< ray cone at the origin: width in scene units, angle in radians;
                              ///< below a surface the width has the bits of its normal;
                              ///< of a path from a light the latter is PathState::ratio
  SampleKey<F> key;
  UInt<F> receiver;  ///< LightReceiver::normal of the vertex that made the ray; below a surface,
                     ///< object_of what it is below
  WAVECOMB_FIELDS(o, d, throughput, pdf, eta_scale, cone_width, cone_spread, key, receiver)
};

/// What paths of some scenes keep beside: read where the scene asks for it.
template <typename F>
struct PathColdRow {
  F time;        ///< of the shutter, in [0, 1)
  UInt<F> link;  ///< PathState::link
  F importance;  ///< PathState::importance
  WAVECOMB_FIELDS(time, link, importance)
};

/// Bits of InsideRow::crossed below the material: whether the bounce and the shadow ray lead to the
/// other side of the surface, and whether that is its inner one.
enum Crossing : uint32_t { kBounceCrosses = 1, kShadowCrosses = 2, kEnters = 4 };
inline constexpr uint32_t kCrossingBits = 3;

/// What a path is inside of, where it knows: four bounds at most, by placed_geometry and material,
/// the last entered last; kNothing from the first that is not there (medium/interiors.h).
template <typename F>
struct InsideRow {
  UInt<F> place_0, place_1, place_2, place_3, material_0, material_1, material_2, material_3;
  UInt<F> place;    ///< of the vertex: placed_geometry
  UInt<F> crossed;  ///< what it has found: Crossing, and the material
  F outer;          ///< PathState::outer and medium of the vertex
  UInt<F> medium;
  WAVECOMB_FIELDS(place_0, place_1, place_2, place_3, material_0, material_1, material_2,
                  material_3, place, crossed, outer, medium)
};

/// A path's shadow ray, of which it has one at most at each vertex.
template <typename F>
struct ShadowRow {
  Vec3<F> o, d;
  F tfar;
  Color<F> direct;  ///< what the path gets where nothing is in the way
  UInt<F> group;    ///< light group of `direct`, or kNoGroup
  UInt<F> set;      ///< VertexResult::shadow_set
  WAVECOMB_FIELDS(o, d, tfar, direct, group, set)
};

/// What the shadow queue takes of such a row.
template <typename F>
struct ShadowHead {
  Vec3<F> o, d;
  F tfar;
  Color<F> direct;
  WAVECOMB_FIELDS(o, d, tfar, direct)
};

/// Radiance of a path, or of a part of it.
template <typename F>
struct RadianceRow {
  Color<F> sum;
  WAVECOMB_FIELDS(sum)
};
inline constexpr size_t kRadianceWords = kRowWords<RadianceRow>;

static_assert(kRowWords<PathRow> == 16 && kRowWords<ShadowRow> == 16, "a cache line each");
static_assert(kIsHead<RayHead, PathRow> && kIsHead<RayHead, ShadowRow>);

/// A path slot is one (pixel, sample) for life. Its state is a row of one cache line, which shading
/// reads, and writes anew for the next ray; its shadow ray is another row. Whatever order hits are
/// shaded in, each touches its own lines and no other's (docs/decisions/path-rows.md).
///
/// Contract: owned by one wave.
class PathPool {
 public:
  PathPool() = default;
  /// `cold`: paths keep a PathColdRow. `joined`: and PathState::ratio. `knows`: and an InsideRow.
  /// `shaded`: and VertexResult::shade. `split`: and PathState::diffuse.
  PathPool(size_t capacity, bool cold, bool joined = false, bool knows = false, bool shaded = false,
           bool split = false)
      : rows_(1, capacity * (kRowWords<PathRow> + kRowWords<ShadowRow> + kRadianceWords)),
        cold_(cold ? SoaBlock(1, capacity * kRowWords<PathColdRow>) : SoaBlock()),
        ratios_(joined ? SoaBlock(1, capacity) : SoaBlock()),
        inside_(knows ? SoaBlock(1, capacity * kRowWords<InsideRow>) : SoaBlock()),
        shades_(shaded ? SoaBlock(1, capacity * kRadianceWords) : SoaBlock()),
        diffuse_(split ? SoaBlock(1, capacity * kRadianceWords) : SoaBlock()) {
    paths = rows_.floats(0);
    shadows = paths + capacity * kRowWords<PathRow>;
    radiance = shadows + capacity * kRowWords<ShadowRow>;
    this->cold = cold ? cold_.floats(0) : nullptr;
    ratio = joined ? ratios_.floats(0) : nullptr;
    inside = knows ? inside_.floats(0) : nullptr;
    shades = shaded ? shades_.floats(0) : nullptr;
    diffuse = split ? diffuse_.floats(0) : nullptr;
  }

  float* paths = nullptr;     ///< PathRow
  float* shadows = nullptr;   ///< ShadowRow
  float* radiance = nullptr;  ///< RadianceRow
  float* cold = nullptr;      ///< PathColdRow; null where no path has one
  float* ratio = nullptr;     ///< PathState::ratio; null where no paths start at lights
  float* inside = nullptr;    ///< InsideRow; null where nobody knows
  float* shades = nullptr;    ///< RadianceRow of VertexResult::shade; null where shadows are black
  float* diffuse = nullptr;   ///< RadianceRow of PathState::diffuse; null: no light asks for it
  size_t bytes() const {
    return rows_.bytes() + cold_.bytes() + ratios_.bytes() + inside_.bytes() + shades_.bytes() +
           diffuse_.bytes();
  }

 private:
  SoaBlock rows_, cold_, ratios_, inside_, shades_, diffuse_;
};

/// Adds c to the active lanes' rows of radiance, which are distinct.
template <typename F>
WAVECOMB_INLINE void add_radiance(float* radiance, const UInt<F>& row, const Color<F>& c,
                                  const Mask<F>& active) {
  RadianceRow<F> r = load_row<RadianceRow, F>(radiance, row, active);
  r.sum += c;
  store_row<RadianceRow, F>(radiance, row, r, active);
}

}  // namespace wavecomb
