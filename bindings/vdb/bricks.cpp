// SPDX-License-Identifier: Apache-2.0
#include "bricks.h"

#include <cstdio>
#include <cstring>

namespace vdb {

std::string limit_message(const std::string& what, uint64_t bytes, uint64_t max_bytes) {
  char text[160];
  std::snprintf(text, sizeof(text), "%s takes %.1f GB; there is room for %.1f GB", what.c_str(),
                1e-9 * static_cast<double>(bytes), 1e-9 * static_cast<double>(max_bytes));
  return text;
}

void check_size(uint64_t bricks, const BrickFormat& format, uint64_t max_bytes) {
  if (bricks <= max_bytes / format.brick_bytes()) return;
  const double gigabytes =
      1e-9 * static_cast<double>(bricks) * static_cast<double>(format.brick_bytes());
  char text[160];
  std::snprintf(text, sizeof(text), "%llu million voxels take %.1f GB; there is room for %.1f GB",
                static_cast<unsigned long long>(bricks * kBrickVoxels / 1000000), gigabytes,
                1e-9 * static_cast<double>(max_bytes));
  throw TooLarge(text);
}

BrickWriter::BrickWriter(uint64_t most, const BrickFormat& format, const BrickOptions& options)
    : most_(most), drops_empty_(options.drops_empty) {
  check_size(most, format, options.max_bytes);
  bricks_.format = format;
  bricks_.origins = std::make_unique_for_overwrite<int32_t[]>(3 * most);
  bricks_.values =
      std::make_unique_for_overwrite<unsigned char[]>(most * kBrickVoxels * format.voxel_bytes());
}

void BrickWriter::add(const Origin& origin) {
  const BrickFormat& format = bricks_.format;
  const size_t components = kBrickVoxels * format.channels;
  bool is_empty = true;
  for (size_t i = 0; i < components; ++i) {
    bricks_.facts.see(scratch_[i]);
    is_empty = is_empty && scratch_[i] == 0.0f;
  }
  if (is_empty && drops_empty_) {
    ++bricks_.facts.empty;
    return;
  }
  if (bricks_.count == most_) throw BrokenFile("a grid changed while it was read");
  unsigned char* out = bricks_.values.get() + bricks_.count * kBrickVoxels * format.voxel_bytes();
  if (format.is_half) {
    uint16_t halves[3 * kBrickVoxels];
    to_halves(scratch_, components, halves);
    std::memcpy(out, halves, components * sizeof(uint16_t));
  } else {
    std::memcpy(out, scratch_, components * sizeof(float));
  }
  std::copy(origin.begin(), origin.end(), bricks_.origins.get() + 3 * bricks_.count);
  ++bricks_.count;
}

void BrickWriter::add_tile(const Origin& first, int32_t edge, const float* value) {
  const uint32_t channels = bricks_.format.channels;
  for (size_t i = 0; i < kBrickVoxels * channels; ++i) scratch_[i] = value[i % channels];
  for (int32_t x = 0; x < edge; x += kBrickEdge)
    for (int32_t y = 0; y < edge; y += kBrickEdge)
      for (int32_t z = 0; z < edge; z += kBrickEdge)
        add({first[0] + x, first[1] + y, first[2] + z});
}

}  // namespace vdb
