// SPDX-License-Identifier: Apache-2.0
/// OpenVDB grids: description and bricks. Only open_tree.cpp and writing.cpp instantiate OpenVDB's
/// tree templates. The functions traverse tree nodes, because OpenVDB's value iterators take ten
/// times as long to compile.
#pragma once

#include <openvdb/Grid.h>

#include "bricks.h"

namespace vdb {

/// OpenVDB's grid of a value type.
template <typename Value>
using GridOf = openvdb::Grid<typename openvdb::tree::Tree4<Value, 5, 4, 3>::Type>;

/// Describes a grid; requires its topology only.
GridFacts facts_of(const openvdb::GridBase& grid);

/// Throws BrokenFile that names the type if bricks are not supported for it.
void check_type_of(const openvdb::GridBase& grid);

/// Throws TooLarge if the bricks of a grid need more than `max_bytes`.
void check_size_of(const openvdb::GridBase& grid, uint64_t max_bytes);

/// Makes bricks of a grid. Throws TooLarge, std::bad_alloc, and the errors of check_type_of().
Bricks bricks_of(const openvdb::GridBase& grid, const BrickOptions& options);

}  // namespace vdb
