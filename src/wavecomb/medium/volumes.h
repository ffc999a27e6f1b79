// SPDX-License-Identifier: Apache-2.0
/// What lies between surfaces: the volumes of a scene.
#pragma once

#include "wavecomb/integrate/media.h"
#include "wavecomb/material/program_list.h"
#include "wavecomb/medium/tracking.h"
#include "wavecomb/medium/volume_bsdf.h"

namespace wavecomb {

/// What integrate/media.h asks for.
class Volumes {
 public:
  static constexpr bool kAny = true, kShines = true;
  template <typename F>
  using Programs = AppendedProgram<wavecomb::Programs<F>, VolumeBsdf<F>>;

  /// `counts` gets what ways through them take.
  Volumes(const VolumeView& volumes, VolumeCounts& counts) : volumes_(volumes), counts_(counts) {}

  template <typename F>
  Flight<F> fly(const Passage<F>& p, const Color<F>& throughput, const Mask<F>& active) const {
    return fly_through<F>(volumes_, p, throughput, active, counts_);
  }

  template <typename F>
  Color<F> transmittance(const Passage<F>& p, const Mask<F>& active) const {
    return transmittance_through<F>(volumes_, Way<F>(p, VertexSet::kShadow, counts_), p.o, p.d, p.t,
                                    active);
  }

  bool shines() const { return volumes_.emits; }
  template <typename F>
  Color<F> emission(const Passage<F>& p, const Mask<F>& active) const {
    Color<F> sum(F(0.f));
    const Way<F> way(p, VertexSet::kFlight, counts_);
    for (uint32_t i = 0; i < volumes_.count; ++i)
      if (volumes_.volumes[i].emits) sum += emission_of<F>(volumes_, i, way, p.o, p.d, p.t, active);
    return sum;
  }

 private:
  const VolumeView volumes_;
  VolumeCounts& counts_;
};

}  // namespace wavecomb
