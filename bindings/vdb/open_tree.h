// SPDX-License-Identifier: Apache-2.0
/// Functions that describe OpenVDB grids and convert them to bricks. Only open_tree.cpp and
/// writing.cpp instantiate OpenVDB's tree templates. The functions of this file iterate over tree
/// nodes and not with OpenVDB's value iterators, which take ten times as long to compile.
#pragma once

#include <openvdb/Grid.h>

#include "bricks.h"

namespace vdb {

/// OpenVDB's grid of a value type.
template <typename Value>
using GridOf = openvdb::Grid<typename openvdb::tree::Tree4<Value, 5, 4, 3>::Type>;

/// Describes a grid. Only the topology of its tree needs to be loaded, not the voxel values.
GridFacts facts_of(const openvdb::GridBase& grid);

/// Throws a `BrokenFile` that names the grid's type if grids of this type cannot be converted to
/// bricks.
void check_type_of(const openvdb::GridBase& grid);

/// Throws TooLarge if the bricks of a grid need more than `max_bytes`.
void check_size_of(const openvdb::GridBase& grid, uint64_t max_bytes);

/// Converts a grid to bricks. Throws `TooLarge` if the bricks exceed options.max_bytes,
/// `std::bad_alloc` if the allocation fails, and `BrokenFile` if the grid's type is not supported.
Bricks bricks_of(const openvdb::GridBase& grid, const BrickOptions& options);

}  // namespace vdb
