// SPDX-License-Identifier: Apache-2.0
/// Cryptomatte: ids of names, and bounded lists of ids and coverage (J. Friedman and A. Jones,
/// "Fully Automatic ID Mattes with Support for Motion Blur and Transparency", SIGGRAPH 2015
/// poster; specification 1.2.0).
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "wavecomb/core/aov.h"

namespace wavecomb {

class Scene;

/// MurmurHash3_x86_32 (A. Appleby, public domain).
uint32_t murmur3_32(std::string_view text, uint32_t seed);

/// The id of a name: its hash with seed 0, where bits that would make a float that is zero,
/// denormal, infinite or NaN have the lowest bit of their exponent flipped (specification, "ID
/// Generation").
uint32_t crypto_id(std::string_view name);

/// The ids in one pixel and how many samples each got, in bounded room.
///
/// While there are at most kIds ids, all counts are exact. A further one takes the place of the
/// id with the fewest samples, and its count with it (A. Metwally, D. Agrawal, A. El Abbadi,
/// "Efficient Computation of Frequent and Top-k Elements in Data Streams", 2005): counts always add
/// up to the samples that hit something, no count is too small, and every id with more than
/// 1 / kIds of the samples is there.
struct CryptoPixel {
  static constexpr uint32_t kIds = 8;
  uint32_t id[kIds] = {};
  uint32_t count[kIds] = {};  ///< 0: free; free places come last

  void add(uint32_t new_id) {
    uint32_t least = 0;
    for (uint32_t i = 0; i < kIds; ++i) {
      if (count[i] != 0 && id[i] == new_id) {
        ++count[i];
        return;
      }
      if (count[i] == 0) {
        id[i] = new_id;
        count[i] = 1;
        return;
      }
      if (count[i] < count[least]) least = i;
    }
    id[least] = new_id;
    ++count[least];
  }
};

/// What kernels' indices mean to Cryptomatte. Made once a render, and only where asked for.
struct CryptoTables {
  std::vector<uint32_t> first_object;  ///< of each instance: object = first_object[inst] + geom
  uint32_t first_light = 0;            ///< object of light record 0
  uint32_t first_volume = 0;           ///< object of volume 0
  std::vector<uint32_t> object_id, asset_id;  ///< by object
  std::vector<uint32_t> material_id;

  CryptoTables() = default;
  CryptoTables(const Scene& scene, AovSet aovs);
};

/// (name, id) of all of `level` whose ids are in `ids`, which is sorted; by name. Several names of
/// one id are all given.
std::vector<std::pair<std::string, uint32_t>> crypto_manifest(const Scene& scene, Aov level,
                                                              const std::vector<uint32_t>& ids);

}  // namespace wavecomb
