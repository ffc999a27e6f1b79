// SPDX-License-Identifier: Apache-2.0
/// The kernels of vertices that are compiled: which, in which lane widths, and what each gains.
/// CMake reads the rows of this table, too.
#pragma once

#include <cstdint>
#include <string_view>

#include "wavecomb/core/lane_types.h"

namespace wavecomb {

/// Rows X(kind, set, widths, reduced, gain). There is a compile unit for each member of the set and
/// each width, made of integrate/<kind>.lanes.cpp.in; sanitized builds compile those of a program
/// and a width together.
///
/// set: `programs` (WAVECOMB_PROGRAMS) or `variants` (all of kVariants that are of surfaces).
/// widths: `every` width of the build and scalar lanes, `ends` (scalar and the widest lanes),
/// `widest` (packets only), `scalar`.
/// reduced: widths in builds with WAVECOMB_REDUCED_KERNELS, which sanitized builds are. `none`:
/// they run `program` kernels in place of these. `first`: every width for the first program, scalar
/// lanes for the others, whose scalar kernels also shade waves of packets. Such builds send waves
/// through volumes in scalar lanes. gain: what scenes gain over the kernel that would
/// run in place of these; `-` and the reason where there is no such kernel.
///
/// The kernels of the table agree bit for bit: each knows of fewer features (features.h) or parts
/// of a material than another one, and the scene or the material has none of those.
///
/// Dropped, since one general kernel does: kernels for camera paths that are joined by light paths
/// (`program` has them under a flag), and plain kernels and variants for paths from lights.
#define WAVECOMB_KERNELS(X)                                                                       \
  X(program, programs, every, first, "-: general, and those of the reference integrator")         \
  X(light, programs, ends, scalar, "-: paths from lights, and those of the reference integrator") \
  X(plain, variants, widest, none, "time of a record: 0.73 (openpbr) to 0.96 (diffuse)")

/// Whether kernels of a kind are built in `lanes` lanes.
constexpr bool has_kernels(std::string_view kind, size_t lanes) {
  constexpr size_t kMost = WAVECOMB_MAX_LANES;
  const auto is_of = [&](std::string_view widths) {
    return widths == "every" || widths == "first" || (widths == "scalar" && lanes == 1) ||
           (widths == "ends" && (lanes == 1 || lanes == kMost)) ||
           (widths == "widest" && lanes > 1 && lanes == kMost);
  };
  constexpr bool kIsReduced = WAVECOMB_REDUCED_KERNELS;
#define WAVECOMB_ROW(name, set, widths, reduced, gain) \
  if (kind == #name) return is_of(kIsReduced ? #reduced : #widths);
  WAVECOMB_KERNELS(WAVECOMB_ROW)
#undef WAVECOMB_ROW
  return false;
}

/// Whether the general kernels of program `program` are built in `lanes` lanes.
constexpr bool has_program_kernels(size_t program, size_t lanes) {
  return !WAVECOMB_REDUCED_KERNELS || lanes == 1 || program == 0;
}

/// Whether waves of packets go through volumes in packets.
inline constexpr bool kHasVolumePackets = !WAVECOMB_REDUCED_KERNELS;

/// Whether there are plain kernels and least variants for packets of F.
template <typename F>
inline constexpr bool kHasPlain = has_kernels("plain", kWidth<F>);

/// Lanes of the kernels of paths from lights, whatever those of the wave are.
using LightLanes =
    Lanes<has_kernels("light", WAVECOMB_MAX_LANES) ? size_t{WAVECOMB_MAX_LANES} : size_t{1}>;

}  // namespace wavecomb
