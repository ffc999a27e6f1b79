// SPDX-License-Identifier: Apache-2.0
#include "nano_tree.h"

#include <iterator>

#if __has_include(<nanovdb/NanoVDB.h>)
#include <nanovdb/NanoVDB.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <type_traits>
#include <utility>
#include <vector>
#endif

namespace vdb {

#if __has_include(<nanovdb/NanoVDB.h>)

namespace {

/// Byte range with bounds-checked access.
class Buffer {
 public:
  Buffer(const unsigned char* bytes, uint64_t size) : bytes_(bytes), size_(size) {}

  uint64_t size() const { return size_; }

  /// Returns `count` structures at an offset. Throws BrokenFile if the buffer is too small.
  template <typename T>
  const T* at(uint64_t offset, uint64_t count = 1) const {
    if (offset > size_ || offset % alignof(T) != 0 || count > (size_ - offset) / sizeof(T))
      throw BrokenFile("a grid with nodes at invalid offsets");
    return reinterpret_cast<const T*>(bytes_ + offset);
  }

 private:
  const unsigned char* bytes_;
  uint64_t size_;
};

template <typename Value>
constexpr uint32_t kChannels = std::is_arithmetic_v<Value> ? 1 : 3;

template <typename Value>
void put(const Value& value, float* to) {
  if constexpr (std::is_arithmetic_v<Value>)
    *to = static_cast<float>(value);
  else
    for (int c = 0; c < 3; ++c) to[c] = static_cast<float>(value[c]);
}

using Origin = BrickWriter::Origin;
constexpr int32_t kRootEdge = 4096;

/// Returns the leaf node at an offset. Throws BrokenFile if the node exceeds the buffer.
template <typename Build>
const auto* leaf_at(const Buffer& buffer, uint64_t at) {
  using Leaf = typename nanovdb::NanoLeaf<Build>::DataType;
  const Leaf* leaf = buffer.at<Leaf>(at);
  if constexpr (std::is_same_v<Build, nanovdb::FpN>) {
    const uint32_t log2_bits = leaf->mFlags >> 5;
    if (log2_bits > 4) throw BrokenFile("numbers of more than 16 bits in a FpN grid");
    buffer.at<unsigned char>(at + sizeof(Leaf), uint64_t{64} << log2_bits);
  }
  return leaf;
}

/// Traversal of the nodes of a NanoVDB grid from the root, in the order of OpenVDB's trees. The
/// template depends only on the type of voxel values, so that grids with and without quantised
/// leaves use the same code. Throws `BrokenFile` after visiting more nodes than fit into the
/// buffer, since node offsets of a broken file may form a cycle.
template <typename Value>
class NanoTreeTraversal {
 public:
  using Lower = typename nanovdb::NanoLower<Value>::DataType;
  using Upper = typename nanovdb::NanoUpper<Value>::DataType;
  using Root = typename nanovdb::NanoRoot<Value>::DataType;

  NanoTreeTraversal(const Buffer& buffer, uint64_t leaf_bytes)
      : buffer_(buffer), max_nodes_(buffer.size() / leaf_bytes) {
    constexpr uint64_t kTree = sizeof(nanovdb::GridData);
    const uint64_t to_root = buffer.at<nanovdb::TreeData<3>>(kTree)->mNodeOffset[3];
    if (to_root > buffer.size()) throw BrokenFile("a grid without a root");
    at_root_ = kTree + to_root;
    root_ = buffer.at<Root>(at_root_);
  }

  const Value& background() const { return root_->mBackground; }

  /// Calls `on_tile(origin, edge, value)` for active tiles, `on_leaf(origin, offset)` for leaves.
  template <typename OnTile, typename OnLeaf>
  void walk(OnTile&& on_tile, OnLeaf&& on_leaf) const {
    uint64_t nodes = 0;
    const auto count_node = [&] {
      if (++nodes > max_nodes_) throw BrokenFile("a cycle of nodes");
    };
    for (const auto& [origin, tile] : root_tiles()) {
      if (tile->child == 0) {
        if (tile->state != 0) on_tile(origin, kRootEdge, tile->value);
        continue;
      }
      count_node();
      visit_inner<Upper, 5>(at_root_ + static_cast<uint64_t>(tile->child), origin, 128, on_tile,
                            [&](uint64_t at_lower, const Origin& lower) {
                              count_node();
                              visit_inner<Lower, 4>(at_lower, lower, 8, on_tile,
                                                    [&](uint64_t at_leaf, const Origin& xyz) {
                                                      count_node();
                                                      on_leaf(xyz, at_leaf);
                                                    });
                            });
    }
  }

 private:
  using Tile = typename Root::Tile;

  /// Returns the tiles of the root node with their origins, sorted by origin.
  std::vector<std::pair<Origin, const Tile*>> root_tiles() const {
    const uint32_t count = root_->mTableSize;
    const Tile* tiles = buffer_.at<Tile>(at_root_ + sizeof(Root), count);
    std::vector<std::pair<Origin, const Tile*>> found(count);
    for (uint32_t t = 0; t < count; ++t) {
      const nanovdb::Coord key = tiles[t].origin();
      constexpr int32_t kMask = ~(kRootEdge - 1);
      found[t] = {Origin{key[0] & kMask, key[1] & kMask, key[2] & kMask}, &tiles[t]};
    }
    std::sort(found.begin(), found.end());
    for (uint32_t t = 1; t < count; ++t)
      if (found[t].first == found[t - 1].first) throw BrokenFile("two nodes at one position");
    return found;
  }

  /// Visits the children and active tiles of the inner node at the offset `at`. Along each axis the
  /// node has 2^`Log2` entries of `edge` voxels.
  template <typename Node, int Log2, typename OnTile, typename OnChild>
  void visit_inner(uint64_t at, const Origin& origin, int32_t edge, OnTile&& on_tile,
                   OnChild&& on_child) const {
    const Node* node = buffer_.at<Node>(at);
    constexpr uint32_t kMask = (1u << Log2) - 1;
    for (uint32_t n = 0; n < 1u << (3 * Log2); ++n) {
      const bool is_child = node->mChildMask.isOn(n);
      if (!is_child && !node->mValueMask.isOn(n)) continue;
      const auto along = [&](int shift) {
        return static_cast<int32_t>((n >> shift) & kMask) * edge;
      };
      const Origin xyz{origin[0] + along(2 * Log2), origin[1] + along(Log2), origin[2] + along(0)};
      if (is_child)
        on_child(at + static_cast<uint64_t>(node->mTable[n].child), xyz);
      else
        on_tile(xyz, edge, node->mTable[n].value);
    }
  }

  Buffer buffer_;
  uint64_t max_nodes_;
  uint64_t at_root_ = 0;
  const Root* root_ = nullptr;
};

/// NanoVDB grid of voxel type `Value`. A function for the grid's build type reads its leaf nodes.
template <typename Value>
class NanoGrid {
 public:
  /// Voxel values of a leaf node. `is_on` is true for active voxels, and `is_outside` for inactive
  /// voxels that hold the background value.
  struct LeafValues {
    std::array<float, kChannels<Value> * kBrickVoxels> values;
    std::array<bool, kBrickVoxels> is_on, is_outside;
  };
  struct LeafKind {
    uint64_t bytes;
    void (*read)(const Buffer& buffer, uint64_t at, const Value& background, LeafValues& leaf);
  };
  template <typename Build>
  static LeafKind kind_of() {
    using Nodes = nanovdb::NanoUpper<Build>;
    static_assert(sizeof(typename Nodes::DataType) ==
                  sizeof(typename NanoTreeTraversal<Value>::Upper));
    static_assert(sizeof(typename nanovdb::NanoLower<Build>::DataType) ==
                  sizeof(typename NanoTreeTraversal<Value>::Lower));
    static_assert(sizeof(typename nanovdb::NanoRoot<Build>::DataType) ==
                  sizeof(typename NanoTreeTraversal<Value>::Root));
    return {sizeof(typename nanovdb::NanoLeaf<Build>::DataType), &read_leaf<Build>};
  }

  NanoGrid(const Buffer& buffer, const LeafKind& kind)
      : buffer_(buffer), kind_(kind), tree_(buffer, kind.bytes) {}

  /// Sets the background value, the number of active voxels and their bounds in `facts`.
  void describe(GridFacts& facts) const {
    facts.background.resize(kChannels<Value>);
    put(tree_.background(), facts.background.data());
    const auto extend = [&](const Origin& first, const Origin& last) {
      if (!facts.box) facts.box = IndexBox{first, last};
      facts.box->extend(first, last);
    };
    LeafValues leaf;
    tree_.walk(
        [&](const Origin& xyz, int32_t edge, const Value&) {
          facts.voxels += kBrickVoxels * bricks_of_tile(static_cast<uint64_t>(edge));
          extend(xyz, {xyz[0] + edge - 1, xyz[1] + edge - 1, xyz[2] + edge - 1});
        },
        [&](const Origin& xyz, uint64_t at) {
          kind_.read(buffer_, at, tree_.background(), leaf);
          for (int32_t i = 0; i < static_cast<int32_t>(kBrickVoxels); ++i) {
            if (!leaf.is_on[static_cast<size_t>(i)]) continue;
            const Origin voxel{xyz[0] + i / 64, xyz[1] + i / 8 % 8, xyz[2] + i % 8};
            extend(voxel, voxel);
            ++facts.voxels;
          }
        });
  }

  Bricks bricks(const BrickOptions& options) const {
    uint64_t count = 0;
    tree_.walk([&](const Origin&, int32_t edge,
                   const Value&) { count += bricks_of_tile(static_cast<uint64_t>(edge)); },
               [&](const Origin&, uint64_t) { ++count; });
    BrickWriter writer(count, {kChannels<Value>, false}, options);
    LeafValues leaf;
    tree_.walk([](const Origin&, int32_t, const Value&) {},
               [&](const Origin& xyz, uint64_t at) {
                 kind_.read(buffer_, at, tree_.background(), leaf);
                 for (size_t i = 0; i < leaf.values.size(); ++i) {
                   const bool is_zero =
                       options.background_is_zero && leaf.is_outside[i / kChannels<Value>];
                   writer.scratch()[i] = is_zero ? 0.0f : leaf.values[i];
                 }
                 writer.add(xyz);
               });
    tree_.walk(
        [&](const Origin& xyz, int32_t edge, const Value& value) {
          float components[3];
          put(value, components);
          writer.add_tile(xyz, edge, components);
        },
        [](const Origin&, uint64_t) {});
    return writer.take();
  }

 private:
  template <typename Build>
  static void read_leaf(const Buffer& buffer, uint64_t at, const Value& background,
                        LeafValues& leaf) {
    const auto* data = leaf_at<Build>(buffer, at);
    for (uint32_t i = 0; i < kBrickVoxels; ++i) {
      const Value value = data->getValue(i);
      put(value, leaf.values.data() + kChannels<Value> * i);
      leaf.is_on[i] = data->mValueMask.isOn(i);
      leaf.is_outside[i] = !leaf.is_on[i] && value == background;
    }
  }

  Buffer buffer_;
  LeafKind kind_;
  NanoTreeTraversal<Value> tree_;
};

void set_transform(const nanovdb::GridData& data, GridFacts& facts) {
  std::array<double, 16> m{};
  m[15] = 1.0;
  for (size_t i = 0; i < 3; ++i) {
    for (size_t j = 0; j < 3; ++j) m[4 * j + i] = data.mMap.mMatD[3 * i + j];
    m[12 + i] = data.mMap.mVecD[i];
  }
  const double determinant = m[0] * (m[5] * m[10] - m[6] * m[9]) -
                             m[1] * (m[4] * m[10] - m[6] * m[8]) +
                             m[2] * (m[4] * m[9] - m[5] * m[8]);
  const bool is_finite = std::all_of(m.begin(), m.end(), [](double x) { return std::isfinite(x); });
  if (!is_finite || !std::isfinite(determinant) || determinant == 0.0)
    throw BrokenFile("a grid whose transform has no inverse");
  facts.index_to_object = m;
}

const char* kind_of(const nanovdb::GridData& data) {
  switch (data.mGridClass) {
    case nanovdb::GridClass::LevelSet:
      return "level set";
    case nanovdb::GridClass::FogVolume:
      return "fog volume";
    case nanovdb::GridClass::Staggered:
      return "staggered";
    default:
      return "unknown";
  }
}

/// Returns the header of a grid. Throws `BrokenFile` unless it matches the file's table of grids.
const nanovdb::GridData& head_of(const Buffer& whole, uint32_t type) {
  const auto* data = whole.at<nanovdb::GridData>(0);
  if (std::memcmp(&data->mMagic, "NanoVDB", 7) != 0)
    throw BrokenFile("a grid without a valid header");
  if (data->mVersion.getMajor() != nano_major_version())
    throw BrokenFile("a grid whose version differs from its file");
  if (data->mGridSize > whole.size() || data->mGridType != static_cast<nanovdb::GridType>(type))
    throw BrokenFile("a grid that differs from the file's table");
  return *data;
}

/// Calls `use` with the value and leaf node types of a nanovdb::GridType; false if not supported.
template <typename Use>
bool with_build(uint32_t type, Use&& use) {
  switch (static_cast<nanovdb::GridType>(type)) {
    case nanovdb::GridType::Float:
      use.template operator()<float, float>();
      return true;
    case nanovdb::GridType::Double:
      use.template operator()<double, double>();
      return true;
    case nanovdb::GridType::Vec3f:
      use.template operator()<nanovdb::Vec3f, nanovdb::Vec3f>();
      return true;
    case nanovdb::GridType::Vec3d:
      use.template operator()<nanovdb::Vec3d, nanovdb::Vec3d>();
      return true;
    case nanovdb::GridType::Fp4:
      use.template operator()<float, nanovdb::Fp4>();
      return true;
    case nanovdb::GridType::Fp8:
      use.template operator()<float, nanovdb::Fp8>();
      return true;
    case nanovdb::GridType::Fp16:
      use.template operator()<float, nanovdb::Fp16>();
      return true;
    case nanovdb::GridType::FpN:
      use.template operator()<float, nanovdb::FpN>();
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
  return with_build(type, []<typename Value, typename Build>() {});
}

GridFacts nano_facts(const unsigned char* bytes, uint64_t size, uint32_t type) {
  const nanovdb::GridData& data = head_of(Buffer(bytes, size), type);
  const Buffer own(bytes, data.mGridSize);
  GridFacts facts;
  facts.is_read = with_build(type, [&]<typename Value, typename Build>() {
    using Grid = NanoGrid<Value>;
    Grid(own, Grid::template kind_of<Build>()).describe(facts);
  });
  set_transform(data, facts);
  facts.kind = kind_of(data);
  if (facts.kind != "unknown") facts.metadata.emplace_back("class", facts.kind);
  return facts;
}

Bricks nano_bricks(const unsigned char* bytes, uint64_t size, uint32_t type,
                   const BrickOptions& options) {
  const Buffer own(bytes, head_of(Buffer(bytes, size), type).mGridSize);
  Bricks made;
  with_build(type, [&]<typename Value, typename Build>() {
    using Grid = NanoGrid<Value>;
    made = Grid(own, Grid::template kind_of<Build>()).bricks(options);
  });
  return made;
}

#else

uint32_t nano_major_version() {
  return 0;
}

bool is_nano_type_read(uint32_t) {
  return false;
}

GridFacts nano_facts(const unsigned char*, uint64_t, uint32_t) {
  throw BrokenFile("this build is without NanoVDB");
}

Bricks nano_bricks(const unsigned char*, uint64_t, uint32_t, const BrickOptions&) {
  throw BrokenFile("this build is without NanoVDB");
}

#endif

const char* nano_type_word(uint32_t type) {
  // Names of value types, indexed by nanovdb::GridType.
  constexpr const char* kWords[] = {
      "unknown", "float", "double", "int16", "int32", "int64", "vec3s", "vec3d", "mask",  "half",
      "uint32",  "bool",  "rgba8",  "fp4",   "fp8",   "fp16",  "fpn",   "vec4s", "vec4d", "index"};
  return type < std::size(kWords) ? kWords[type] : "unknown";
}

}  // namespace vdb
