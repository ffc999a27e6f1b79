// SPDX-License-Identifier: Apache-2.0
#include "open_tree.h"

#include <type_traits>

namespace vdb {

namespace {

using Origin = BrickWriter::Origin;

template <typename Value>
struct ChannelsOf : std::integral_constant<uint32_t, 1> {};
template <typename T>
struct ChannelsOf<openvdb::math::Vec3<T>> : std::integral_constant<uint32_t, 3> {};

template <typename Value>
void put(const Value& value, float* to) {
  if constexpr (ChannelsOf<Value>::value == 3)
    for (int c = 0; c < 3; ++c) to[c] = static_cast<float>(value[c]);
  else
    *to = static_cast<float>(value);
}

Origin origin_of(const openvdb::Coord& xyz) {
  return {xyz.x(), xyz.y(), xyz.z()};
}

/// Casts `grid` to its concrete type and calls `use` with it. Returns false if grids of this type
/// cannot be converted to bricks. Each supported type costs about one second of compile time.
template <typename Use>
bool with_grid(const openvdb::GridBase& grid, Use&& use) {
  const auto as = [&]<typename Value>() {
    if (!grid.isType<GridOf<Value>>()) return false;
    use(static_cast<const GridOf<Value>&>(grid));
    return true;
  };
  return as.template operator()<float>() || as.template operator()<double>() ||
         as.template operator()<openvdb::Vec3s>() || as.template operator()<openvdb::Vec3d>();
}

/// Calls `on_tile(origin, edge, value)` for the active tiles of an inner node and
/// `on_child(node)` for its children, in the order of their positions.
template <typename Node, typename OnTile, typename OnChild>
void visit_node(const Node& node, OnTile&& on_tile, OnChild&& on_child) {
  auto child = node.cbeginChildOn();
  auto tile = node.cbeginValueOn();
  while (child || tile) {
    if (child && (!tile || child.pos() < tile.pos())) {
      on_child(*child);
      ++child;
    } else {
      on_tile(origin_of(tile.getCoord()), static_cast<int32_t>(Node::ChildNodeType::DIM), *tile);
      ++tile;
    }
  }
}

/// Traverses a tree from its root and visits active tiles of all levels and leaves.
template <typename Tree, typename OnTile, typename OnLeaf>
void walk(const Tree& tree, OnTile&& on_tile, OnLeaf&& on_leaf) {
  using Upper = typename Tree::RootNodeType::ChildNodeType;
  for (auto tile = tree.root().cbeginValueOn(); tile; ++tile)
    on_tile(origin_of(tile.getCoord()), static_cast<int32_t>(Upper::DIM), *tile);
  for (auto upper = tree.root().cbeginChildOn(); upper; ++upper)
    visit_node(*upper, on_tile, [&](const auto& lower) { visit_node(lower, on_tile, on_leaf); });
}

template <typename Grid>
BrickFormat format_of(const Grid& grid) {
  return {ChannelsOf<typename Grid::ValueType>::value, grid.saveFloatAsHalf()};
}

template <typename Tree>
uint64_t count_bricks(const Tree& tree) {
  uint64_t count = 0;
  walk(
      tree,
      [&](const Origin&, int32_t edge, const auto&) {
        count += bricks_of_tile(static_cast<uint64_t>(edge));
      },
      [&](const auto&) { ++count; });
  return count;
}

template <typename Grid>
Bricks collect(const Grid& grid, const BrickOptions& options) {
  using Value = typename Grid::ValueType;
  const auto& tree = grid.tree();
  const BrickFormat format = format_of(grid);
  BrickWriter writer(count_bricks(tree), format, options);
  const Value background = grid.background(), zero = openvdb::zeroVal<Value>();
  walk(
      tree, [](const Origin&, int32_t, const Value&) {},
      [&](const auto& leaf) {
        float* out = writer.scratch();
        for (openvdb::Index i = 0; i < kBrickVoxels; ++i, out += format.channels) {
          const Value value = leaf.getValue(i);
          const bool is_outside =
              options.background_is_zero && !leaf.isValueOn(i) && value == background;
          put(is_outside ? zero : value, out);
        }
        writer.add(origin_of(leaf.origin()));
      });
  walk(
      tree,
      [&](const Origin& first, int32_t edge, const Value& value) {
        float components[3];
        put(value, components);
        writer.add_tile(first, edge, components);
      },
      [](const auto&) {});
  return writer.take();
}

}  // namespace

GridFacts facts_of(const openvdb::GridBase& grid) {
  GridFacts facts;
  facts.is_read = with_grid(grid, [&](const auto& typed) {
    facts.background.resize(ChannelsOf<std::decay_t<decltype(typed.background())>>::value);
    put(typed.background(), facts.background.data());
  });
  facts.kind = openvdb::GridBase::gridClassToString(grid.getGridClass());
  if (grid.transform().isLinear()) {
    const openvdb::Mat4d m = grid.transform().baseMap()->getAffineMap()->getMat4();
    facts.index_to_object.emplace();
    std::copy_n(m.asPointer(), 16, facts.index_to_object->begin());
  }
  facts.voxels = grid.activeVoxelCount();
  const openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
  if (!box.empty()) facts.box = IndexBox{origin_of(box.min()), origin_of(box.max())};
  for (auto item = grid.beginMeta(); item != grid.endMeta(); ++item)
    facts.metadata.emplace_back(item->first, item->second == nullptr ? "" : item->second->str());
  return facts;
}

void check_type_of(const openvdb::GridBase& grid) {
  if (!with_grid(grid, [](const auto&) {}))
    throw BrokenFile("it is of type " + grid.valueType() + ", which is not read");
}

void check_size_of(const openvdb::GridBase& grid, uint64_t max_bytes) {
  with_grid(grid, [&](const auto& typed) {
    check_size(count_bricks(typed.tree()), format_of(typed), max_bytes);
  });
}

Bricks bricks_of(const openvdb::GridBase& grid, const BrickOptions& options) {
  check_type_of(grid);
  Bricks made;
  with_grid(grid, [&](const auto& typed) { made = collect(typed, options); });
  return made;
}

void to_halves(const float* values, size_t count, uint16_t* halves) {
  for (size_t i = 0; i < count; ++i) halves[i] = openvdb::math::half(values[i]).bits();
}

}  // namespace vdb
