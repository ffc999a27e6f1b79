// SPDX-License-Identifier: Apache-2.0
#include "watching.h"

#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include <cmath>
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "bind.h"
#include "statistics.h"
#include "wavecomb/core/error.h"
#include "wavecomb/render/pilots/training_cache.h"

namespace nb = nanobind;
using namespace nb::literals;
using namespace wavecomb;

namespace {

using Bytes = nb::ndarray<const uint8_t, nb::shape<-1>, nb::c_contig, nb::device::cpu>;

nb::dict status_dict(const RenderStatus& s) {
  nb::dict d;
  d["samples_done"] = s.samples_done;
  d["samples_total"] = s.samples_total;
  d["resumed_samples"] = s.resumed_samples;
  d["rays"] = s.rays;
  d["passes"] = s.passes;
  d["active_pixels"] = s.active_pixels;
  d["seconds"] = s.seconds;
  d["error"] = std::isfinite(s.error) ? nb::cast(s.error) : nb::none();
  return d;
}

/// Returns a NumPy array that refers to memory without owning it. The memory is valid until the
/// Python callback returns.
nb::object view(const void* data, size_t size) {
  return nb::cast(nb::ndarray<nb::numpy, const uint8_t>(data, {size}, nb::handle()),
                  nb::rv_policy::reference);
}

/// Moves `bytes` into a NumPy array.
nb::object owned(std::vector<std::byte> bytes) {
  auto* own = new std::vector<std::byte>(std::move(bytes));
  const nb::capsule owner(own,
                          [](void* p) noexcept { delete static_cast<std::vector<std::byte>*>(p); });
  return nb::cast(nb::ndarray<nb::numpy, uint8_t>(own->data(), {own->size()}, owner));
}

nb::dict state_dict(const Snapshot& s) {
  nb::dict d;
  d["pass.target"] = s.pass.target;
  d["pass.light_target"] = view(&s.pass.light_target, sizeof(uint32_t));
  d["pass.active"] = view(s.pass.active.data(), s.pass.active.size());
  const auto& counts = s.pass.allocation.counts;
  d["pass.counts"] = view(counts.data(), counts.size() * sizeof(uint32_t));
  for (const Film::Block& block : s.film.blocks())
    d[("film." + block.name).c_str()] = view(block.bytes.data(), block.bytes.size());
  if (const DeepFilm& deep = s.film.aovs().deep(); !deep.empty())
    d["film.deep"] = owned(deep.packed());
  if (std::vector<std::byte> learned = packed_training(s.training, s.transport); !learned.empty())
    d["learned.field"] = owned(std::move(learned));
  return d;
}

/// Python object for a `Snapshot` of a render. The methods throw after the callback that received
/// the object has returned.
class LiveSnapshot {
 public:
  LiveSnapshot(const Snapshot& snapshot, const nb::dict& settings)
      : snapshot_(&snapshot), settings_(settings) {}
  void end() { snapshot_ = nullptr; }

  const Snapshot& get() const {
    if (!snapshot_)
      throw Error("the snapshot is over; take what is needed of it while snapshot() runs");
    return *snapshot_;
  }
  nb::dict stats() const { return statistics_dict(get().statistics(), settings_, 0); }

 private:
  const Snapshot* snapshot_;
  nb::dict settings_;
};

/// Moves pixel values of the film's size into a NumPy array of shape (height, width, channels), or
/// (height, width) if there is one channel.
template <typename T>
nb::object image(const Film& film, std::vector<T> values, size_t channels) {
  auto* own = new std::vector<T>(std::move(values));
  const nb::capsule owner(own, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  const size_t shape[3] = {film.height(), film.width(), channels};
  return nb::cast(nb::ndarray<nb::numpy, T>(own->data(), channels == 1 ? 2 : 3, shape, owner));
}

nb::object samples(const LiveSnapshot& live) {
  const Film& film = live.get().film;
  return image(film, film.samples(), 1);
}

nb::object layer(const LiveSnapshot& live, const std::string& name) {
  if (name == "samples") return samples(live);
  const Snapshot& s = live.get();
  std::optional<AovLayer> found;
  {
    const nb::gil_scoped_release release;
    found = s.layer(name);
  }
  if (!found) return nb::none();
  return image(s.film, std::move(found->values), found->channels);
}

Request request_of(const nb::object& answer) {
  if (answer.is_none()) return Request::kContinue;
  const auto text = nb::cast<std::string>(answer);
  if (text == "snapshot") return Request::kSnapshot;
  if (text == "stop") return Request::kStop;
  throw Error("a watcher's progress() returned '" + text +
              "'; it must be None, \"snapshot\" or \"stop\"");
}

/// Returns the bytes of the item `key` of a checkpoint's state. Throws `Error` unless the item has
/// `size` bytes.
Bytes bytes_of(const nb::dict& state, const std::string& key, size_t size) {
  if (!state.contains(key.c_str()))
    throw Error("the checkpoint has no '" + key + "'; it is from another build");
  const auto bytes = nb::cast<Bytes>(state[key.c_str()]);
  if (bytes.size() != size)
    throw Error("the checkpoint has " + std::to_string(bytes.size()) + " bytes of '" + key +
                "', not " + std::to_string(size) + "; it is of a different image");
  return bytes;
}

std::span<const std::byte> span_of(const Bytes& bytes) {
  return {reinterpret_cast<const std::byte*>(bytes.data()), bytes.size()};
}

}  // namespace

RenderOptions watched_by(const nb::object& progress, const nb::object& watcher,
                         const nb::dict& settings) {
  RenderOptions options;
  options.progress = [&](const RenderStatus& s) {
    const nb::gil_scoped_acquire gil;
    if (PyErr_CheckSignals() != 0) throw nb::python_error();
    if (!progress.is_none()) {
      const nb::object should_continue = progress(s.samples_done, s.samples_total);
      if (!should_continue.is_none() && !nb::cast<bool>(should_continue)) return Request::kStop;
    }
    if (watcher.is_none()) return Request::kContinue;
    return request_of(watcher.attr("progress")(status_dict(s)));
  };
  if (!watcher.is_none())
    options.snapshot = [&](const Snapshot& s) {
      const nb::gil_scoped_acquire gil;
      const nb::object live = nb::cast(LiveSnapshot(s, settings));
      const auto end = [&live](void*) { nb::cast<LiveSnapshot&>(live).end(); };
      const std::unique_ptr<LiveSnapshot, decltype(end)> guard(&nb::cast<LiveSnapshot&>(live), end);
      watcher.attr("snapshot")(live);
    };
  return options;
}

std::function<std::vector<std::byte>(Film&, PassState&)> resumed_from(const nb::dict& state) {
  return [&state](Film& film, PassState& pass) {
    const nb::gil_scoped_acquire gil;
    for (const Film::Block& block : film.blocks()) {
      const Bytes bytes = bytes_of(state, "film." + block.name, block.bytes.size());
      std::memcpy(block.bytes.data(), bytes.data(), block.bytes.size());
    }
    if (DeepFilm& deep = film.aovs().deep(); !deep.empty()) {
      if (!state.contains("film.deep"))
        throw Error("the checkpoint has no 'film.deep'; it is from another build");
      deep.unpack(span_of(nb::cast<Bytes>(state["film.deep"])));
    }
    pass.target = nb::cast<uint32_t>(state["pass.target"]);
    const auto active = nb::cast<Bytes>(state["pass.active"]);
    if (active.size() != 0) bytes_of(state, "pass.active", film.pixel_count());
    pass.active.assign(active.data(), active.data() + active.size());
    // Checkpoints from older versions of Wavecomb have no `pass.light_target`.
    if (state.contains("pass.light_target")) {
      const Bytes light = bytes_of(state, "pass.light_target", sizeof(uint32_t));
      std::memcpy(&pass.light_target, light.data(), sizeof(uint32_t));
    }
    if (state.contains("pass.counts")) {
      const auto counts = nb::cast<Bytes>(state["pass.counts"]);
      if (counts.size() != 0) bytes_of(state, "pass.counts", film.pixel_count() * sizeof(uint32_t));
      pass.allocation.counts.resize(counts.size() / sizeof(uint32_t));
      if (counts.size() != 0)
        std::memcpy(pass.allocation.counts.data(), counts.data(), counts.size());
    }
    return learned_in(state);
  };
}

std::vector<std::byte> learned_in(const nb::dict& state) {
  if (!state.contains("learned.field")) return {};
  const auto learned = nb::cast<Bytes>(state["learned.field"]);
  const std::span<const std::byte> bytes = span_of(learned);
  return {bytes.begin(), bytes.end()};
}

void bind_watching(nb::module_& m) {
  nb::class_<LiveSnapshot>(m, "Snapshot")
      .def_prop_ro("finished", [](const LiveSnapshot& s) { return s.get().finished; })
      .def_prop_ro("status", [](const LiveSnapshot& s) { return status_dict(s.get().status); })
      .def_prop_ro("stats", &LiveSnapshot::stats)
      .def("beauty", [](const LiveSnapshot& s) { return layer(s, "beauty"); })
      .def("samples", &samples)
      .def("layer", &layer, "name"_a)
      .def("state", [](const LiveSnapshot& s) { return state_dict(s.get()); });
}
