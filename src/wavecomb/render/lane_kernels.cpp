// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/lane_kernels.h"

#include <algorithm>
#include <string>

#include "wavecomb/core/error.h"
#include "wavecomb/reference/reference.h"
#include "wavecomb/wave/kernels/kernel_matrix.h"
#include "wavecomb/wave/wave_integrator.h"

namespace wavecomb {

namespace {
template <size_t W>
LaneKernels kernels_of() {
  return {&run_wave<W>, &run_wave_in_volumes < kHasVolumePackets ? W : 1 >, &time_material<W>};
}
}  // namespace

LaneKernels lane_kernels(uint32_t lanes) {
  switch (lanes) {
#ifdef WAVECOMB_HAS_LANES_1
    case 1:
      return kernels_of<1>();
#endif
#ifdef WAVECOMB_HAS_LANES_4
    case 4:
      return kernels_of<4>();
#endif
#ifdef WAVECOMB_HAS_LANES_8
    case 8:
      return kernels_of<8>();
#endif
#ifdef WAVECOMB_HAS_LANES_16
    case 16:
      return kernels_of<16>();
#endif
    default:
      return {};
  }
}

std::vector<uint32_t> lane_widths() {
  std::vector<uint32_t> widths;
  for (uint32_t w : {1u, 4u, 8u, 16u})
    if (lane_kernels(w).run) widths.push_back(w);
  return widths;
}

uint32_t choose_lanes(uint32_t wanted) {
  const std::vector<uint32_t> built = lane_widths();
  if (wanted == 0) return built.back();
  if (std::find(built.begin(), built.end(), wanted) != built.end()) return wanted;
  std::string list;
  for (uint32_t w : built) list += (list.empty() ? "" : ", ") + std::to_string(w);
  throw Error("lanes is " + std::to_string(wanted) + ", which the " + library_name() +
              " library has no kernels for; it has " + list +
              ". A build with WAVECOMB_LANE_WIDTHS=all (make build LANES=all) has every width that "
              "its CPU can run.");
}

std::unique_ptr<Integrator> make_integrator(IntegratorKind kind, const WaveContext& context,
                                            uint32_t lanes, uint32_t threads, uint32_t wave_size) {
  if (kind == IntegratorKind::kReference)
    return std::make_unique<ReferenceIntegrator>(context, threads);
  const LaneKernels kernels = lane_kernels(lanes);
  return std::make_unique<WaveIntegrator>(
      context, context.has_media() ? kernels.run_in_volumes : kernels.run, lanes, threads,
      wave_size);
}

const char* library_name() {
  return WAVECOMB_LIBRARY;
}

}  // namespace wavecomb
