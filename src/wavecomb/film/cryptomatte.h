// SPDX-License-Identifier: Apache-2.0
/// Cryptomatte ids, which are hashes of names, and lists of ids and coverage per pixel (J. Friedman
/// and A. Jones, "Fully Automatic ID Mattes with Support for Motion Blur and Transparency",
/// SIGGRAPH 2015 poster; specification 1.2.0).
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

/// Returns the MurmurHash3_x86_32 hash of `text` (A. Appleby, public domain).
uint32_t murmur3_32(std::string_view text, uint32_t seed);

/// Returns the Cryptomatte id of a name: its hash with seed 0. If the hash read as a float would be
/// zero, denormal, infinite or NaN, the lowest exponent bit is flipped (specification, "ID
/// Generation").
uint32_t crypto_id(std::string_view name);

/// Ids of the samples of one pixel with their sample counts, in constant memory.
///
/// Sample counts are exact while a pixel has at most kIds ids. After that, each new id replaces the
/// id with the fewest samples and inherits its count (A. Metwally, D. Agrawal, A. El Abbadi,
/// "Efficient Computation of Frequent and Top-k Elements in Data Streams", 2005). Therefore, the
/// counts always add up to the number of samples that hit something, no count is too small, and
/// every id with more than 1 / kIds of the samples is in the list.
struct CryptoPixel {
  static constexpr uint32_t kIds = 8;
  uint32_t id[kIds] = {};
  /// Sample count of each id. Unused entries have the count 0 and are at the end.
  uint32_t count[kIds] = {};

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

/// Tables that map object indices and material indices to Cryptomatte ids. The tables are built
/// once per render if a Cryptomatte AOV is requested.
struct CryptoTables {
  /// Object index of the first geometry of each instance. The object index of geometry `geom` is
  /// `first_object[instance] + geom`.
  std::vector<uint32_t> first_object;
  uint32_t first_light = 0;                   ///< object index of light record 0
  uint32_t first_volume = 0;                  ///< object index of volume 0
  std::vector<uint32_t> object_id, asset_id;  ///< by object index
  std::vector<uint32_t> material_id;          ///< by material index

  CryptoTables() = default;
  CryptoTables(const Scene& scene, AovSet aovs);
};

/// Returns pairs of a name and an id, sorted by name, for the names of the Cryptomatte level
/// `level` whose ids are in `ids`. `ids` must be sorted. If the hashes of several names collide,
/// all these names are included.
std::vector<std::pair<std::string, uint32_t>> crypto_manifest(const Scene& scene, Aov level,
                                                              const std::vector<uint32_t>& ids);

}  // namespace wavecomb
