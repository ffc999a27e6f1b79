// SPDX-License-Identifier: Apache-2.0
#include "nano_tree.h"

#include "archive.h"
#include "bricks.h"

#if __has_include(<nanovdb/NanoVDB.h>)
#include <nanovdb/NanoVDB.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <type_traits>
#endif

namespace vdb {

#if __has_include(<nanovdb/NanoVDB.h>)

namespace {

/// A range of bytes that is looked into by offsets.
class Buffer {
 public:
  Buffer(const unsigned char* bytes, uint64_t size) : bytes_(bytes), size_(size) {}

  uint64_t size() const { return size_; }

  /// `count` structures of the layout at an offset. Throws where they do not lie in the buffer.
  template <typename T>
  const T* at(uint64_t offset, uint64_t count = 1) const {
    if (offset > size_ || offset % alignof(T) != 0 || count > (size_ - offset) / sizeof(T))
      throw BrokenFile("a grid whose nodes lie where they cannot be");
    return reinterpret_cast<const T*>(bytes_ + offset);
  }

 private:
  const unsigned char* bytes_;
  uint64_t size_;
};

/// OpenVDB's type for a value of a leaf.
template <typename Value>
struct OpenValueOf {
  using Type = Value;
};
template <>
struct OpenValueOf<nanovdb::Vec3f> {
  using Type = openvdb::Vec3s;
};
template <>
struct OpenValueOf<nanovdb::Vec3d> {
  using Type = openvdb::Vec3d;
};

template <typename Value>
auto open_value(const Value& value) {
  if constexpr (std::is_arithmetic_v<Value>)
    return value;
  else
    return typename OpenValueOf<Value>::Type(value[0], value[1], value[2]);
}

/// The tree of a grid of one build type, which is walked node by node from the root. Offsets lead
/// from node to node; that no more nodes are met than there is room for bounds what a loop of them
/// costs.
template <typename Build>
class NanoWalk {
 public:
  using Leaf = typename nanovdb::NanoLeaf<Build>::DataType;
  using Lower = typename nanovdb::NanoLower<Build>::DataType;
  using Upper = typename nanovdb::NanoUpper<Build>::DataType;
  using Root = typename nanovdb::NanoRoot<Build>::DataType;
  using Value = typename OpenValueOf<typename Leaf::ValueType>::Type;

  explicit NanoWalk(const Buffer& buffer) : buffer_(buffer) {
    constexpr uint64_t kTree = sizeof(nanovdb::GridData);
    const uint64_t to_root = buffer.at<nanovdb::TreeData<3>>(kTree)->mNodeOffset[3];
    if (to_root > buffer.size()) throw BrokenFile("a grid without a root");
    at_root_ = kTree + to_root;
    root_ = buffer.at<Root>(at_root_);
  }

  Value background() const { return open_value(root_->mBackground); }

  /// Calls `tile(level, origin, edge, value)` for active tiles and `leaf(origin, data)`.
  template <typename OnTile, typename OnLeaf>
  void walk(OnTile&& on_tile, OnLeaf&& on_leaf) const {
    uint64_t nodes = 0;
    const auto count_node = [&] {
      if (++nodes > buffer_.size() / sizeof(Leaf)) throw BrokenFile("nodes in a circle");
    };
    const uint32_t entries = root_->mTableSize;
    const auto* tiles = buffer_.at<typename Root::Tile>(at_root_ + sizeof(Root), entries);
    for (uint32_t t = 0; t < entries; ++t) {
      const nanovdb::Coord key = tiles[t].origin();
      const openvdb::Coord origin(key[0] & ~4095, key[1] & ~4095, key[2] & ~4095);
      if (tiles[t].child == 0) {
        if (tiles[t].state != 0) on_tile(3, origin, 4096, open_value(tiles[t].value));
        continue;
      }
      count_node();
      walk_inner<Upper, 5>(at_root_ + static_cast<uint64_t>(tiles[t].child), origin, 128, on_tile,
                           [&](uint64_t at_lower, const openvdb::Coord& lower) {
                             count_node();
                             walk_inner<Lower, 4>(at_lower, lower, 8, on_tile,
                                                  [&](uint64_t at_leaf, const openvdb::Coord& xyz) {
                                                    count_node();
                                                    on_leaf(xyz, *leaf_at(at_leaf));
                                                  });
                           });
    }
  }

 private:
  /// Children and active tiles of an inner node of 2^Log2 entries an edge, each of `edge` voxels.
  template <typename Node, int Log2, typename OnTile, typename OnChild>
  void walk_inner(uint64_t at, const openvdb::Coord& origin, int edge, OnTile&& on_tile,
                  OnChild&& on_child) const {
    const Node* node = buffer_.at<Node>(at);
    constexpr uint32_t kMask = (1u << Log2) - 1;
    for (uint32_t n = 0; n < 1u << (3 * Log2); ++n) {
      const bool is_child = node->mChildMask.isOn(n);
      if (!is_child && !node->mValueMask.isOn(n)) continue;
      const auto along = [&](int shift) { return static_cast<int>((n >> shift) & kMask) * edge; };
      const openvdb::Coord xyz = origin.offsetBy(along(2 * Log2), along(Log2), along(0));
      if (is_child)
        on_child(at + static_cast<uint64_t>(node->mTable[n].child), xyz);
      else
        on_tile(Log2 - 3, xyz, edge, open_value(node->mTable[n].value));
    }
  }

  const Leaf* leaf_at(uint64_t at) const {
    const Leaf* leaf = buffer_.at<Leaf>(at);
    if constexpr (std::is_same_v<Build, nanovdb::FpN>) {
      const uint32_t log2_bits = leaf->mFlags >> 5;
      if (log2_bits > 4) throw BrokenFile("numbers of more than 16 bits in a FpN grid");
      buffer_.at<unsigned char>(at + sizeof(Leaf), uint64_t{64} << log2_bits);
    }
    return leaf;
  }

  Buffer buffer_;
  uint64_t at_root_ = 0;
  const Root* root_ = nullptr;
};

openvdb::math::Transform::Ptr transform_of(const nanovdb::GridData& data) {
  openvdb::Mat4d matrix = openvdb::Mat4d::identity();
  bool is_finite = true;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) matrix(j, i) = data.mMap.mMatD[3 * i + j];
    matrix(3, i) = data.mMap.mVecD[i];
    for (int j = 0; j < 4; ++j) is_finite = is_finite && std::isfinite(matrix(j, i));
  }
  if (!is_finite || !openvdb::math::isInvertible(matrix))
    throw BrokenFile("a grid whose transform has no inverse");
  return openvdb::math::Transform::createLinearTransform(matrix);
}

openvdb::GridClass class_of(const nanovdb::GridData& data) {
  switch (data.mGridClass) {
    case nanovdb::GridClass::LevelSet:
      return openvdb::GRID_LEVEL_SET;
    case nanovdb::GridClass::FogVolume:
      return openvdb::GRID_FOG_VOLUME;
    case nanovdb::GridClass::Staggered:
      return openvdb::GRID_STAGGERED;
    default:
      return openvdb::GRID_UNKNOWN;
  }
}

/// A grid of OpenVDB in the making. Not inlined: one for all builds that have such values, since a
/// compiler takes long over each.
template <typename Value>
class Making {
 public:
  using Grid = openvdb::Grid<typename openvdb::tree::Tree4<Value, 5, 4, 3>::Type>;
  using Values = std::array<Value, kBrickVoxels>;
  using Mask = openvdb::util::NodeMask<3>;

  [[gnu::noinline]] explicit Making(const Value& background) : grid_(Grid::create(background)) {}
  [[gnu::noinline]] void add_tile(int level, const openvdb::Coord& xyz, const Value& value) {
    grid_->tree().addTile(level, xyz, value, true);
  }
  [[gnu::noinline]] void add_leaf(const openvdb::Coord& xyz, const Values& values,
                                  const Mask& mask) {
    auto* leaf = grid_->tree().touchLeaf(xyz);
    std::copy(values.begin(), values.end(), leaf->buffer().data());
    leaf->setValueMask(mask);
  }
  openvdb::GridBase::Ptr grid() const { return grid_; }

 private:
  typename Grid::Ptr grid_;
};

template <typename Build>
openvdb::GridBase::Ptr read_as(const Buffer& buffer, uint64_t most_bytes) {
  using Walk = NanoWalk<Build>;
  using Value = typename Walk::Value;
  const Walk tree(buffer);
  uint64_t bricks = 0;
  tree.walk(
      [&](int, const openvdb::Coord&, int edge, const auto&) {
        const uint64_t along = static_cast<uint64_t>(edge / kBrickEdge);
        bricks += along * along * along;
      },
      [&](const openvdb::Coord&, const auto&) { ++bricks; });
  check_size(bricks, {ChannelsOf<Value>::value, false}, most_bytes);
  Making<Value> making(tree.background());
  tree.walk([&](int level, const openvdb::Coord& xyz, int,
                const Value& value) { making.add_tile(level, xyz, value); },
            [&](const openvdb::Coord& xyz, const auto& from) {
              typename Making<Value>::Values values;
              typename Making<Value>::Mask mask;
              for (uint32_t i = 0; i < kBrickVoxels; ++i) {
                values[i] = open_value(from.getValue(i));
                mask.set(i, from.mValueMask.isOn(i));
              }
              making.add_leaf(xyz, values, mask);
            });
  return making.grid();
}

/// Calls `use` with the build type that a nanovdb::GridType stands for; false where it is not read.
template <typename Use>
bool with_build(uint32_t type, Use&& use) {
  switch (static_cast<nanovdb::GridType>(type)) {
    case nanovdb::GridType::Float:
      use.template operator()<float>();
      return true;
    case nanovdb::GridType::Double:
      use.template operator()<double>();
      return true;
    case nanovdb::GridType::Vec3f:
      use.template operator()<nanovdb::Vec3f>();
      return true;
    case nanovdb::GridType::Vec3d:
      use.template operator()<nanovdb::Vec3d>();
      return true;
    case nanovdb::GridType::Fp4:
      use.template operator()<nanovdb::Fp4>();
      return true;
    case nanovdb::GridType::Fp8:
      use.template operator()<nanovdb::Fp8>();
      return true;
    case nanovdb::GridType::Fp16:
      use.template operator()<nanovdb::Fp16>();
      return true;
    case nanovdb::GridType::FpN:
      use.template operator()<nanovdb::FpN>();
      return true;
    default:
      return false;
  }
}

}  // namespace

uint32_t nano_major_version() {
  return NANOVDB_MAJOR_VERSION_NUMBER;
}

bool is_nano_type_read(uint32_t type) {
  return with_build(type, []<typename Build>() {});
}

openvdb::GridBase::Ptr read_nano(const unsigned char* bytes, uint64_t size, uint32_t type,
                                 uint64_t most_bytes) {
  const Buffer whole(bytes, size);
  const auto* data = whole.at<nanovdb::GridData>(0);
  if (std::memcmp(&data->mMagic, "NanoVDB", 7) != 0)
    throw BrokenFile("a grid that does not begin like one");
  if (data->mVersion.getMajor() != nano_major_version())
    throw BrokenFile("a grid of another version than its file");
  if (data->mGridSize > size || data->mGridType != static_cast<nanovdb::GridType>(type))
    throw BrokenFile("a grid that is not what the file's table says");
  const Buffer own(bytes, data->mGridSize);
  openvdb::GridBase::Ptr grid;
  with_build(type, [&]<typename Build>() { grid = read_as<Build>(own, most_bytes); });
  grid->setTransform(transform_of(*data));
  if (const auto kind = class_of(*data); kind != openvdb::GRID_UNKNOWN) grid->setGridClass(kind);
  return grid;
}

#else

uint32_t nano_major_version() {
  return 0;
}

bool is_nano_type_read(uint32_t) {
  return false;
}

openvdb::GridBase::Ptr read_nano(const unsigned char*, uint64_t, uint32_t, uint64_t) {
  throw BrokenFile("this build is without NanoVDB");
}

#endif

const char* nano_type_word(uint32_t type) {
  // By the numbers of nanovdb::GridType.
  constexpr const char* kWords[] = {
      "unknown", "float", "double", "int16", "int32", "int64", "vec3s", "vec3d", "mask",  "half",
      "uint32",  "bool",  "rgba8",  "fp4",   "fp8",   "fp16",  "fpn",   "vec4s", "vec4d", "index"};
  return type < std::size(kWords) ? kWords[type] : "unknown";
}

}  // namespace vdb
