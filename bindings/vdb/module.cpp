// SPDX-License-Identifier: Apache-2.0
/// Python module wavecomb._vdb, which reads .vdb and .nvdb files and writes .vdb files. The stub
/// file python/wavecomb/_vdb.pyi documents the module. The USD loader imports the module only for
/// stages with volumes.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <cerrno>
#include <initializer_list>
#include <memory>
#include <string>
#include <system_error>
#include <tuple>
#include <vector>

#include "files.h"
#include "nano_tree.h"
#include "writing.h"

namespace nb = nanobind;

namespace {

/// Converts the matrix M of a transform p' = p M to a list of four rows, or to None if the
/// transform is not affine.
nb::object rows_of(const std::optional<std::array<double, 16>>& matrix) {
  if (!matrix) return nb::none();
  nb::list rows;
  for (size_t i = 0; i < 4; ++i) {
    nb::list row;
    for (size_t j = 0; j < 4; ++j) row.append((*matrix)[4 * i + j]);
    rows.append(row);
  }
  return rows;
}

nb::tuple tuple_of(const std::array<int32_t, 3>& xyz) {
  return nb::make_tuple(xyz[0], xyz[1], xyz[2]);
}

/// Adds the dict entries that the Python functions grids() and bricks() both return.
void add_facts(nb::dict& d, const vdb::GridFacts& facts) {
  d["kind"] = facts.kind;
  d["index_to_object"] = rows_of(facts.index_to_object);
  nb::list background;
  for (const float component : facts.background) background.append(component);
  d["background"] = background;
  d["voxels"] = facts.voxels;
  d["box"] = nb::none();
  if (facts.box) d["box"] = nb::make_tuple(tuple_of(facts.box->first), tuple_of(facts.box->last));
}

nb::bytes bytes_of(const std::string& text) {
  return nb::bytes(text.data(), text.size());
}

nb::list grids(const std::string& path, bool heads) {
  nb::list found;
  const auto file = vdb::open_file(path);
  for (size_t number = 0; number < file->size(); ++number) {
    const vdb::Head head = file->head(number);
    nb::dict d;
    d["name"] = bytes_of(head.name);
    d["index"] = head.index;
    d["type"] = bytes_of(head.type);
    d["half"] = head.is_half;
    vdb::GridFacts facts;
    bool is_known = false;
    if (!heads) {
      const nb::gil_scoped_release release;
      is_known = file->describe(number, facts);
    }
    if (is_known) {
      d["is_read"] = facts.is_read;
      add_facts(d, facts);
      nb::dict metadata;
      for (const auto& [key, text] : facts.metadata) metadata[bytes_of(key)] = bytes_of(text);
      d["metadata"] = metadata;
    }
    found.append(d);
  }
  return found;
}

/// Moves a buffer into a NumPy array, which owns the buffer.
template <typename T>
nb::object array_of(std::unique_ptr<T[]>&& values, std::initializer_list<size_t> shape,
                    nb::dlpack::dtype dtype) {
  T* data = values.release();
  const nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<T*>(p); });
  return nb::cast(nb::ndarray<nb::numpy>(data, shape.size(), shape.begin(), owner, nullptr, dtype));
}

nb::dict bricks(const std::string& path, size_t number, uint64_t max_bytes, bool background_is_zero,
                bool drops_empty) {
  vdb::Bricks made;
  vdb::GridFacts facts;
  {
    const nb::gil_scoped_release release;
    made = vdb::open_file(path)->read(number, {max_bytes, background_is_zero, drops_empty}, facts);
  }
  nb::dict d;
  add_facts(d, facts);
  d["not_finite"] = made.facts.not_finite;
  d["negative"] = made.facts.negative;
  d["least"] = made.facts.least;
  d["greatest"] = made.facts.greatest;
  d["empty"] = made.facts.empty;
  const size_t n = made.count, edge = vdb::kBrickEdge;
  d["origins"] = array_of(std::move(made.origins), {n, 3}, nb::dtype<int32_t>());
  const nb::dlpack::dtype dtype{static_cast<uint8_t>(nb::dlpack::dtype_code::Float),
                                static_cast<uint8_t>(made.format.is_half ? 16 : 32), 1};
  if (made.format.channels == 3)
    d["values"] = array_of(std::move(made.values), {n, edge, edge, edge, 3}, dtype);
  else
    d["values"] = array_of(std::move(made.values), {n, edge, edge, edge}, dtype);
  return d;
}

using Origins = nb::ndarray<const int32_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Values = nb::ndarray<const float, nb::shape<-1, 512, -1>, nb::c_contig, nb::device::cpu>;
using Box = std::tuple<std::array<int32_t, 3>, std::array<int32_t, 3>, float>;

vdb::WrittenGrid grid_from(nb::handle described) {
  vdb::WrittenGrid grid;
  const auto get = [&](const char* name) { return described[name]; };
  grid.name = nb::cast<std::string>(get("name"));
  const auto origins = nb::cast<Origins>(get("origins"));
  const auto values = nb::cast<Values>(get("values"));
  grid.origins = origins.data();
  grid.values = values.data();
  grid.bricks = origins.shape(0);
  grid.channels = static_cast<uint32_t>(values.shape(2));
  grid.is_half = nb::cast<bool>(get("half"));
  grid.index_to_object = nb::cast<std::array<double, 16>>(get("index_to_object"));
  for (const auto& [first, last, value] : nb::cast<std::vector<Box>>(get("boxes")))
    grid.boxes.push_back({first, last, value});
  grid.has_tiles = nb::cast<bool>(get("tiles"));
  return grid;
}

void write_grids(const std::string& path, const nb::list& described) {
  std::vector<vdb::WrittenGrid> grids;
  for (const nb::handle one : described) grids.push_back(grid_from(one));
  const nb::gil_scoped_release release;
  vdb::write_file(path, grids);
}

}  // namespace

NB_MODULE(_vdb, m) {
  m.doc() = "Grids in .vdb and .nvdb files.";
  nb::set_leak_warnings(false);
  nb::exception<vdb::BrokenFile>(m, "BrokenFile", PyExc_ValueError);
  nb::exception<vdb::TooLarge>(m, "TooLarge", PyExc_ValueError);
  nb::register_exception_translator([](const std::exception_ptr& p, void*) {
    try {
      std::rethrow_exception(p);
    } catch (const std::system_error& error) {
      errno = error.code().value();
      PyErr_SetFromErrno(PyExc_OSError);
    }
  });
  vdb::initialize_openvdb();
  m.attr("version") = vdb::openvdb_version();
  m.def("grids", &grids, nb::arg("path"), nb::arg("heads") = false);
  m.def("bricks", &bricks, nb::arg("path"), nb::arg("number"), nb::arg("most_bytes"),
        nb::arg("background_is_zero"), nb::arg("drops_empty"));
  m.def("write", &write_grids, nb::arg("path"), nb::arg("grids"));
  m.attr("nano_version") = vdb::nano_major_version();
}
