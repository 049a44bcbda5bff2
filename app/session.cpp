#include "app/session.h"

#include <fmt/ranges.h>

#include <algorithm>

#include "cluster/collectives.h"
#include "cluster/scene_distribution.h"
#include "core/log.h"

namespace hpr {

Session::Session(Communicator& comm, const Globals& globals, const std::function<Scene()>& load)
    : comm_(comm), share_(host_share(comm, globals)), scene_(distribute_scene(comm_, load)) {
  if (comm_.rank() == 0) {
    for (const std::string& warning : scene_.warnings) log::warning("{}: {}", scene_.name, warning);
  }
  agree_on_failure(comm_, [&] {
    gl_ = make_gl_context({.backend = globals.backend,
                           .device = globals.device,
                           .local_rank = share_.local_rank,
                           .threads = share_.threads});
  });
  log::debug("OpenGL: {}", gl_->description());
  compare_rasterizers();
}

void Session::compare_rasterizers() {
  if (comm_.size() == 1) return;
  const auto prints = all_gather_value(comm_, raster_fingerprint(*gl_));
  std::vector<std::size_t> others;
  for (std::size_t rank = 0; rank < prints.size(); ++rank) {
    if (prints[rank] != prints[0]) others.push_back(rank);
  }
  if (!others.empty() && comm_.rank() == 0) {
    log::warning("ranks {} rasterise differently from rank 0 (another GL driver or CPU): pictures may differ at edges",
                 fmt::join(others, ", "));
  }
}

Rasterizer& Session::rasterizer(std::span<const SurfaceRange> objects) {
  if (!rasterizer_ || !std::ranges::equal(objects, objects_)) {
    rasterizer_.reset();  // frees its GPU memory before the next one takes some
    objects_.assign(objects.begin(), objects.end());
    rasterizer_ = std::make_unique<Rasterizer>(*gl_, scene_, objects_, share_.threads);
  }
  return *rasterizer_;
}

Lighter& Session::lighter(const RaySettings& settings) {
  if (!lighter_ || ray_settings_ != settings) {
    RaySettings own = settings;
    own.threads = share_.threads;
    lighter_ = std::make_unique<Lighter>(scene_, own);
    ray_settings_ = settings;
  }
  return *lighter_;
}

CountingCommunicator& Session::group(std::span<const int> members) {
  if (static_cast<int>(members.size()) == comm_.size()) return comm_;
  if (!group_.counting || !std::ranges::equal(members, group_.members)) {
    if (group_.counting) bytes_of_past_groups_ += group_.counting->bytes_sent();
    group_.counting.reset();
    group_.comm = comm_.subset(members);
    group_.counting = std::make_unique<CountingCommunicator>(*group_.comm);
    group_.members.assign(members.begin(), members.end());
  }
  return *group_.counting;
}

TileLayer<Key>& Session::keys(const FrameLayout& layout) {
  if (keys_.layout() == layout && keys_.tiles() == layout.tiles()) {
    keys_.clear();
  } else {
    keys_ = TileLayer<Key>(layout);
  }
  return keys_;
}

std::size_t Session::bytes_sent() const {
  return comm_.bytes_sent() + bytes_of_past_groups_ + (group_.counting ? group_.counting->bytes_sent() : 0);
}

}  // namespace hpr
