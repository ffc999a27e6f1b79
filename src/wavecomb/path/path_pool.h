// SPDX-License-Identifier: Apache-2.0
/// Storage for the paths of a wave, one slot for each path.
#pragma once

#include <cstddef>

#include "wavecomb/core/rows/fields.h"
#include "wavecomb/core/rows/soa.h"
#include "wavecomb/core/sampler.h"
#include "wavecomb/core/vec.h"

namespace wavecomb {

/// Ray. PathRow and ShadowRow begin with the same fields.
template <typename F>
struct RayHead {
  Vec3<F> o, d;
  WAVECOMB_FIELDS(o, d)
};

/// Subsurface body that a ray enters to start a random walk.
template <typename F>
struct BodyEntry {
  UInt<F> body{0u};    ///< object_of() of the body
  UInt<F> normal{0u};  ///< packed normal at the entry, outwards
};

/// Stored state of a camera path between two vertices. Shading of a vertex reads the row and
/// replaces its contents by the next ray.
///
/// A ray that enters a subsurface body (enters_body()) uses neither a cone nor a receiver. The row
/// then stores the BodyEntry in the words of the cone and the receiver, and marks this layout by
/// the sign bit of `pdf`. Only the member functions use this encoding.
template <typename F>
struct PathRow {
  Vec3<F> o, d;  ///< the ray to trace
  Color<F> throughput;
  /// Density with which the ray's direction was sampled; 0 for a delta bounce or camera ray.
  F pdf;
  F eta_scale;                ///< product of eta^2 over all refractions of the path, for roulette
  F cone_width, cone_spread;  ///< ray cone at the origin: width in scene units, spread in radians
  SampleKey<F> key;
  UInt<F> receiver;  ///< LightReceiver::normal at the vertex where the ray starts
  WAVECOMB_FIELDS(o, d, throughput, pdf, eta_scale, cone_width, cone_spread, key, receiver)

  Mask<F> enters_body() const { return pdf < 0.f; }
  /// Marks the rays in `lanes` as entering a subsurface body. Their `pdf` must be above 0.
  void set_entry(const Mask<F>& lanes, const BodyEntry<F>& entry) {
    pdf = select(lanes, F(-pdf), pdf);
    cone_width = select(lanes, bits_float<F>(entry.normal), cone_width);
    receiver = select(Mask<UInt<F>>(lanes), entry.body, receiver);
  }
  /// Returns the entry into the body, removes the mark, and sets the cone width to 0. The field
  /// `receiver` still holds the body, because the ray queries of the random walk read this field.
  BodyEntry<F> take_entry() {
    const BodyEntry<F> entry{receiver, float_bits<F>(cone_width)};
    pdf = abs(pdf);
    cone_width = F(0.f);
    return entry;
  }
};

/// Fields of the path state that only some scenes need.
template <typename F>
struct PathColdRow {
  F time;        ///< shutter time in [0, 1)
  UInt<F> link;  ///< PathState::link
  F importance;  ///< PathState::importance
  WAVECOMB_FIELDS(time, link, importance)
};

/// Lowest bits of MediumStackRow::crossed, whose other bits hold the material. `kBounceCrosses` and
/// `kShadowCrosses` mean that the bounce and the shadow ray continue on the other side of the
/// surface. `kEnters` means that the path arrived from outside.
enum Crossing : uint32_t { kBounceCrosses = 1, kShadowCrosses = 2, kEnters = 4 };
inline constexpr uint32_t kCrossingBits = 3;

/// Medium stack of a path: at most four entries, each an instance_geometry() and a material, in the
/// order in which the path entered them. kNoMaterial marks the unused entries at the end
/// (medium/nested/nested_media.h).
template <typename F>
struct MediumStackRow {
  UInt<F> object_0, object_1, object_2, object_3, material_0, material_1, material_2, material_3;
  UInt<F> object;   ///< instance_geometry() of the vertex
  UInt<F> crossed;  ///< Crossing bits and the material, set by shading
  F outer;          ///< PathState::outer and PathState::medium of the vertex
  UInt<F> medium;
  WAVECOMB_FIELDS(object_0, object_1, object_2, object_3, material_0, material_1, material_2,
                  material_3, object, crossed, outer, medium)
};

/// Stored shadow ray of a path. Each vertex has at most one shadow ray.
template <typename F>
struct ShadowRow {
  Vec3<F> o, d;
  F tfar;
  Color<F> direct;  ///< contribution if the ray is free
  UInt<F> group;    ///< light group of `direct`, or kNoGroup
  UInt<F> set;      ///< VertexResult::shadow_set
  WAVECOMB_FIELDS(o, d, tfar, direct, group, set)
};

/// First fields of ShadowRow. The shadow queue holds copies of these fields.
template <typename F>
struct ShadowHead {
  Vec3<F> o, d;
  F tfar;
  Color<F> direct;
  WAVECOMB_FIELDS(o, d, tfar, direct)
};

/// Radiance of a path, or one component of the radiance.
template <typename F>
struct RadianceRow {
  Color<F> sum;
  WAVECOMB_FIELDS(sum)
};
inline constexpr size_t kRadianceWords = kRowWords<RadianceRow>;

static_assert(kRowWords<PathRow> == 16 && kRowWords<ShadowRow> == 16, "a cache line each");
static_assert(kIsHead<RayHead, PathRow> && kIsHead<RayHead, ShadowRow>);

/// Path state of one wave. Each slot belongs to one sample of a pixel until its path ends. The
/// state of a path is a row of one cache line, and the shadow ray is a second row, so that shading
/// reads only the cache lines of the paths that it processes, in any order
/// (docs/decisions/path-rows.md).
///
/// Contract: owned by one wave.
class PathPool {
 public:
  PathPool() = default;
  /// Allocates `capacity` slots. Each flag adds an optional row: `cold` adds PathColdRow, `nested`
  /// adds MediumStackRow, `shaded` adds VertexResult::shadow_tint, `split` adds PathState::diffuse,
  /// and `clear` adds optical depths.
  PathPool(size_t capacity, bool cold, bool nested = false, bool shaded = false, bool split = false,
           bool clear = false)
      : rows_(1, capacity * (kRowWords<PathRow> + kRowWords<ShadowRow> + kRadianceWords)),
        cold_(cold ? SoaBlock(1, capacity * kRowWords<PathColdRow>) : SoaBlock()),
        medium_stacks_(nested ? SoaBlock(1, capacity * kRowWords<MediumStackRow>) : SoaBlock()),
        shadow_tints_(shaded ? SoaBlock(1, capacity * kRadianceWords) : SoaBlock()),
        diffuse_(split ? SoaBlock(1, capacity * kRadianceWords) : SoaBlock()),
        optical_depths_(clear ? SoaBlock(1, capacity) : SoaBlock()) {
    paths = rows_.floats(0);
    shadows = paths + capacity * kRowWords<PathRow>;
    radiance = shadows + capacity * kRowWords<ShadowRow>;
    this->cold = cold ? cold_.floats(0) : nullptr;
    medium_stacks = nested ? medium_stacks_.floats(0) : nullptr;
    shadow_tints = shaded ? shadow_tints_.floats(0) : nullptr;
    diffuse = split ? diffuse_.floats(0) : nullptr;
    optical_depths = clear ? optical_depths_.uints(0) : nullptr;
  }

  /// PathRow of each slot, or a row of the joint transport, which has the same size.
  float* paths = nullptr;
  float* shadows = nullptr;        ///< ShadowRow
  float* radiance = nullptr;       ///< RadianceRow
  float* cold = nullptr;           ///< PathColdRow, or null
  float* medium_stacks = nullptr;  ///< MediumStackRow; null without nested dielectrics
  float* shadow_tints =
      nullptr;  ///< RadianceRow of VertexResult::shadow_tint; null if shadows are black
  /// RadianceRow with PathState::diffuse of each slot; null if no light has diffuse or specular
  /// multipliers
  float* diffuse = nullptr;
  /// PresenceKeys::optical_depth of each slot; null without partly transparent surfaces
  uint32_t* optical_depths = nullptr;
  size_t bytes() const {
    return rows_.bytes() + cold_.bytes() + medium_stacks_.bytes() + shadow_tints_.bytes() +
           diffuse_.bytes() + optical_depths_.bytes();
  }

 private:
  SoaBlock rows_, cold_, medium_stacks_, shadow_tints_, diffuse_, optical_depths_;
};

/// Adds `c` to the rows of `radiance` with the indices `row`, in active lanes. The indices must
/// differ between lanes.
template <typename F>
WAVECOMB_INLINE void add_radiance(float* radiance, const UInt<F>& row, const Color<F>& c,
                                  const Mask<F>& active) {
  RadianceRow<F> r = load_row<RadianceRow, F>(radiance, row, active);
  r.sum += c;
  store_row<RadianceRow, F>(radiance, row, r, active);
}

}  // namespace wavecomb
