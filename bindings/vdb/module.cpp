// SPDX-License-Identifier: Apache-2.0
/// The Python module wavecomb._vdb: .vdb and .nvdb files. Documented in
/// python/wavecomb/_vdb.pyi. It is loaded where there are volumes, and nowhere else.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>
#include <openvdb/openvdb.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <system_error>
#include <tuple>
#include <vector>

#include "bricks.h"
#include "files.h"
#include "nano_tree.h"
#include "nano_write.h"
#include "write.h"

namespace nb = nanobind;

namespace {

using vdb::Bricks;
using vdb::GridFile;
using vdb::Head;
using vdb::Part;
using vdb::with_grid;

using Index = std::array<int32_t, 3>;
template <typename T>
using Input = nb::ndarray<const T, nb::c_contig, nb::device::cpu>;

/// (4, 4) rows of p' = p M; None where the transform is not affine.
nb::object transform_of(const openvdb::GridBase& grid) {
  if (!grid.transform().isLinear()) return nb::none();
  const openvdb::Mat4d m = grid.transform().baseMap()->getAffineMap()->getMat4();
  nb::list rows;
  for (int i = 0; i < 4; ++i) {
    nb::list row;
    for (int j = 0; j < 4; ++j) row.append(m(i, j));
    rows.append(row);
  }
  return rows;
}

nb::object background_of(const openvdb::GridBase& grid) {
  nb::list values;
  with_grid(grid, [&](const auto& typed) {
    using Value = std::decay_t<decltype(typed.background())>;
    for (uint32_t c = 0; c < vdb::ChannelsOf<Value>::value; ++c)
      values.append(vdb::channel(typed.background(), c));
  });
  return values;
}

/// What both lists and bricks say of a grid.
void tell(nb::dict& d, const openvdb::GridBase& grid) {
  d["kind"] = openvdb::GridBase::gridClassToString(grid.getGridClass());
  d["index_to_object"] = transform_of(grid);
  d["background"] = background_of(grid);
  d["voxels"] = grid.activeVoxelCount();
  const openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
  d["box"] = nb::none();
  if (!box.empty())
    d["box"] = nb::make_tuple(nb::make_tuple(box.min().x(), box.min().y(), box.min().z()),
                              nb::make_tuple(box.max().x(), box.max().y(), box.max().z()));
}

nb::dict describe(const Head& head, const openvdb::GridBase* grid) {
  nb::dict d;
  d["name"] = nb::bytes(head.name.data(), head.name.size());
  d["index"] = head.index;
  d["type"] = nb::bytes(head.type.data(), head.type.size());
  d["half"] = head.is_half;
  if (grid == nullptr) return d;
  d["is_read"] = with_grid(*grid, [](const auto&) {});
  tell(d, *grid);
  nb::dict metadata;
  for (auto item = grid->beginMeta(); item != grid->endMeta(); ++item) {
    const std::string text = item->second == nullptr ? "" : item->second->str();
    metadata[nb::bytes(item->first.data(), item->first.size())] =
        nb::bytes(text.data(), text.size());
  }
  d["metadata"] = metadata;
  return d;
}

nb::list grids(const std::string& path, bool heads) {
  nb::list found;
  GridFile file(path);
  for (size_t number = 0; number < file.size(); ++number) {
    openvdb::GridBase::Ptr grid;
    if (!heads) {
      const nb::gil_scoped_release release;
      grid = file.read(number, Part::kTopology, std::numeric_limits<uint64_t>::max());
    }
    found.append(describe(file.head(number), grid.get()));
  }
  return found;
}

/// A buffer as an array that owns it.
template <typename T>
nb::object array_of(std::unique_ptr<T[]>&& values, std::initializer_list<size_t> shape,
                    nb::dlpack::dtype dtype) {
  T* data = values.release();
  const nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<T*>(p); });
  return nb::cast(nb::ndarray<nb::numpy>(data, shape.size(), shape.begin(), owner, nullptr, dtype));
}

nb::dict bricks(const std::string& path, size_t number, uint64_t most_bytes,
                bool background_is_zero, bool drops_empty) {
  openvdb::GridBase::Ptr grid;
  Bricks made;
  bool is_known = false;
  {
    const nb::gil_scoped_release release;
    const vdb::BrickOptions options{most_bytes, background_is_zero, drops_empty};
    grid = GridFile(path).read(number, Part::kWhole, most_bytes);
    if (grid != nullptr)
      is_known = with_grid(*grid, [&](const auto& typed) { made = vdb::collect(typed, options); });
  }
  if (!is_known) throw vdb::BrokenFile("it is of a type that is not read");
  nb::dict d;
  tell(d, *grid);
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

vdb::GridDesc description(const nb::dict& d) {
  vdb::GridDesc desc;
  desc.name = nb::cast<std::string>(d["name"]);
  desc.is_half = nb::cast<bool>(d["half"]);
  desc.makes_tiles = nb::cast<bool>(d["tiles"]);
  const auto origins = nb::cast<Input<int32_t>>(d["origins"]);
  const auto values = nb::cast<Input<float>>(d["values"]);
  const auto matrix = nb::cast<Input<double>>(d["index_to_object"]);
  desc.count = origins.shape(0);
  desc.channels = values.ndim() == 5 ? 3 : 1;
  if (origins.size() != 3 * desc.count || matrix.size() != 16 ||
      values.size() != desc.count * vdb::kBrickVoxels * desc.channels)
    throw std::invalid_argument("bricks of another shape");
  desc.origins = origins.data();
  desc.values = values.data();
  std::copy_n(matrix.data(), 16, desc.index_to_object.begin());
  for (const auto& [first, last, value] :
       nb::cast<std::vector<std::tuple<Index, Index, float>>>(d["boxes"]))
    desc.boxes.push_back({first, last, value});
  return desc;
}

void write_file(const std::string& path, const nb::list& grids) {
  openvdb::GridPtrVec made;
  for (const nb::handle item : grids)
    made.push_back(vdb::make_grid(description(nb::cast<nb::dict>(item))));
  const nb::gil_scoped_release release;
  try {
    openvdb::io::File(path).write(made);
  } catch (const openvdb::IoError& error) {
    throw std::system_error(errno != 0 ? errno : EIO, std::generic_category(), error.what());
  }
}

void write_nano_file(const std::string& path, const nb::list& grids, const std::string& packed) {
  std::vector<vdb::NanoDesc> made;
  for (const nb::handle item : grids) {
    const auto d = nb::cast<nb::dict>(item);
    made.push_back({vdb::make_grid(description(d)), nb::cast<std::string>(d["bits"])});
  }
  const nb::gil_scoped_release release;
  vdb::write_nano(path, made, packed);
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
  openvdb::initialize();
  m.attr("version") = OPENVDB_LIBRARY_VERSION_STRING;
  m.def("grids", &grids, nb::arg("path"), nb::arg("heads") = false);
  m.def("bricks", &bricks, nb::arg("path"), nb::arg("number"), nb::arg("most_bytes"),
        nb::arg("background_is_zero"), nb::arg("drops_empty"));
  m.def("write", &write_file, nb::arg("path"), nb::arg("grids"));
  m.attr("nano_version") = vdb::nano_major_version();
  if (vdb::can_write_nano())
    m.def("write_nano", &write_nano_file, nb::arg("path"), nb::arg("grids"), nb::arg("packed"));
}
