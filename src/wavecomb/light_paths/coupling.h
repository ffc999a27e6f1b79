// SPDX-License-Identifier: Apache-2.0
/// Coupling of camera paths to light paths, which is a joint transport (path/joint_transport.h).
#pragma once

#include "wavecomb/aov/path_aovs.h"
#include "wavecomb/light_paths/buffers.h"
#include "wavecomb/light_paths/context.h"
#include "wavecomb/light_paths/join.h"

namespace wavecomb {

/// Couples a packet of camera path vertices to light paths. The coupling includes light paths in
/// the MIS weights of camera paths, offers connections to vertices of light paths, and stores
/// points for merging with light paths. It has no effect in renders without light paths.
template <typename F>
class LightPathCoupling {
 public:
  LightPathCoupling(const LightPathContext& context, const LightPathBuffers& buffers)
      : context_(context), buffers_(buffers) {}

  WAVECOMB_INLINE void load(const UInt<F>& slot, uint32_t depth, uint32_t max_depth,
                            const Mask<F>& active, PathState<F>& state) {
    if (!context_.is_active()) [[likely]]
      return;
    state.ratio = gather<F>(buffers_.ratios, slot, active);
    awaits_merge_ = Mask<F>(gather<UInt<F>>(buffers_.awaits_merge, slot, active) != 0u);
    merge_point_.stored = Mask<F>(false);
    if (context_.connects) [[unlikely]]
      offer_ = offer_for<F>(buffers_.vertices, slot, depth, max_depth, active);
  }

  template <typename V>
  WAVECOMB_INLINE F emission_weight(const V& v, const UInt<F>& light, const Mask<F>& known,
                                    const F& light_pdf, const F& weight) const {
    if (!context_.is_active() || v.depth == 0) [[likely]]
      return weight;
    const PathState<F>& path = v.path;
    const F density = emission_density<F>(v.scene.lights, light, path.o, path.dir, v.t, known);
    return joint_bounce_weight<F>(path.pdf, light_pdf, not_(Mask<F>(path.pdf > 0.f)),
                                  F(path.ratio * density));
  }

  template <typename Bsdf, typename V, typename Interaction>
  WAVECOMB_INLINE void begin(const V& v, const Interaction& at, const Frame<F>& frame) {
    if constexpr (Bsdf::kOnSurface) {
      if (!context_.is_active()) [[likely]]
        return;
      joint_ = joint_vertex<Bsdf, F>(context_, v, at, frame, awaits_merge_);
      if (context_.merges()) {
        merge_point_.stored = v.active & joint_.merges;
        merge_point_.row = {at.s.p,
                            sqrt(joint_.radius2),
                            -v.path.dir,
                            pack_normal<F>(at.s.ng),
                            clean<F>(at.throughput, 0.f),
                            UInt<F>(v.depth)};
      }
    }
  }

  template <typename Context>
  WAVECOMB_INLINE F light_weight(const Context& c, const LightConnection<F>& to_light,
                                 const Vec3<F>& wi, const F& p_bounce, const F& weight) const {
    if constexpr (Context::Program::kOnSurface)
      if (context_.is_active()) [[unlikely]]
        return joint_light_weight(c, joint_, to_light, wi, p_bounce);
    return weight;
  }

  template <typename Context>
  WAVECOMB_INLINE void offer(const Context& c) {
    if constexpr (Context::Program::kOnSurface)
      if (context_.connects) [[unlikely]]
        offer_connection(c, joint_, offer_);
  }

  template <typename Context>
  WAVECOMB_INLINE void bounce(const Context& c, const Vec3<F>& world, const BsdfSample<F>& b,
                              PathState<F>& next) {
    if constexpr (Context::Program::kOnSurface)
      if (context_.is_active()) [[unlikely]]
        next.ratio = next_ratio(c, joint_, context_.merge_scale > 0.f, world, b, awaits_merge_);
  }

  WAVECOMB_INLINE void store(const UInt<F>& slot, const PathState<F>& next, const Mask<F>& alive,
                             const PathAovs& aovs, const Mask<F>& active) const {
    if (!context_.is_active()) [[likely]]
      return;
    scatter<F>(buffers_.ratios, select(awaits_merge_, F(0.f), next.ratio), slot, alive);
    const Mask<UInt<F>> awaits(awaits_merge_);
    scatter<UInt<F>>(buffers_.awaits_merge, select(awaits, UInt<F>(1u), UInt<F>(0u)), slot, alive);
    if (any(merge_point_.stored))
      store_row<MergePoint, F>(buffers_.merge_points.rows, slot, merge_point_.row,
                               merge_point_.stored);
    if (!context_.connects) return;
    store_row<ConnectionRow, F>(buffers_.vertices.connections, slot, offer_.row, active);
    if (aovs.expressions())
      buffers_.aovs.offer<F>(slot, aovs.expressions().template states<F>(slot, active),
                             offer_.scattering, active);
  }

 private:
  const LightPathContext& context_;
  const LightPathBuffers& buffers_;
  JointVertex<F> joint_;  ///< density ratio R (join.h) at the vertex
  /// Lanes whose bounces so far were all deltas, so that light paths may be merged at the next
  /// vertex with a non-delta lobe.
  Mask<F> awaits_merge_;
  /// Connection that the vertex offers, if camera paths connect to light paths.
  ConnectionOffer<F> offer_;
  MergePointOffer<F> merge_point_;  ///< merge point of the vertex, if light paths are merged
};

/// Joint transport with light paths (path/joint_transport.h).
struct LightPaths {
  using Context = LightPathContext;
  using Buffers = LightPathBuffers;
  template <typename F>
  using Coupling = LightPathCoupling<F>;
};

}  // namespace wavecomb
