// SPDX-License-Identifier: Apache-2.0
/// Table of the compiled vertex kernels, with their lane widths and the reason why each kernel
/// exists. CMake also reads the rows of the table.
#pragma once

#include <cstdint>
#include <string_view>

#include "wavecomb/core/lanes/types.h"

namespace wavecomb {

/// The rows of the table have the form X(kind, set, widths, reduced, gain). Each program or variant
/// in `set` has one compile unit for each lane width. The compile units are generated from
/// <kind>.lanes.cpp.in. Sanitized builds compile all units of a program and a width together.
///
/// `set` is `programs` (WAVECOMB_PROGRAMS) or `variants` (the members of kVariants for surfaces).
/// `widths` is `every` (all widths of the build, and scalar lanes), `ends` (scalar and the widest
/// lanes), `widest` (packets only) or `scalar`.
///
/// `reduced` lists the widths in builds with WAVECOMB_REDUCED_KERNELS, such as sanitized builds.
/// With `none`, reduced builds run `program` kernels instead. With `first`, the first program has
/// kernels of every width. All other programs have only scalar kernels, which then also shade the
/// packets of waves. Reduced builds trace waves through volumes in scalar lanes. `gain` states the
/// measured benefit over the kernel that would run without this row, or `-` and a reason if there
/// is no such kernel.
///
/// All kernels give bit-identical results. A kernel that lacks a feature (features.h) runs only for
/// scenes and materials that do not use this feature.
///
/// Camera paths that are combined with light paths have no separate kernels, since `program`
/// kernels handle them by a flag. Light paths have no plain kernels or variants, since one general
/// kernel is enough.
#define WAVECOMB_KERNELS(X)                                                                       \
  X(program, programs, every, first, "-: general, and those of the reference integrator")         \
  X(light, programs, ends, scalar, "-: paths from lights, and those of the reference integrator") \
  X(plain, variants, widest, none, "time of a record: 0.73 (openpbr) to 0.96 (diffuse)")

/// Returns whether the kernels of a row of the table are built for packets of `lanes` lanes.
constexpr bool has_kernels(std::string_view kind, size_t lanes) {
  constexpr size_t kMax = WAVECOMB_MAX_LANES;
  const auto is_of = [&](std::string_view widths) {
    return widths == "every" || widths == "first" || (widths == "scalar" && lanes == 1) ||
           (widths == "ends" && (lanes == 1 || lanes == kMax)) ||
           (widths == "widest" && lanes > 1 && lanes == kMax);
  };
  constexpr bool kIsReduced = WAVECOMB_REDUCED_KERNELS;
#define WAVECOMB_ROW(name, set, widths, reduced, gain) \
  if (kind == #name) return is_of(kIsReduced ? #reduced : #widths);
  WAVECOMB_KERNELS(WAVECOMB_ROW)
#undef WAVECOMB_ROW
  return false;
}

/// Returns whether the general kernels of program `program` are built for packets of `lanes` lanes.
constexpr bool has_program_kernels(size_t program, size_t lanes) {
  return !WAVECOMB_REDUCED_KERNELS || lanes == 1 || program == 0;
}

/// Whether waves in SIMD packets also trace volumes in packets; if not, volumes are traced in
/// scalar lanes.
inline constexpr bool kHasVolumePackets = !WAVECOMB_REDUCED_KERNELS;

/// Whether this build has `plain` kernels for the lane type F.
template <typename F>
inline constexpr bool kHasPlain = has_kernels("plain", kWidth<F>);

/// Lane type of the kernels for light paths, whatever the lane width of the wave.
using LightLanes =
    Lanes<has_kernels("light", WAVECOMB_MAX_LANES) ? size_t{WAVECOMB_MAX_LANES} : size_t{1}>;

}  // namespace wavecomb
