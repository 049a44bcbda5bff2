#include "app/session.h"

#include <fmt/ranges.h>

#include <algorithm>

#include "cluster/collectives.h"
#include "cluster/scene_distribution.h"
#include "core/log.h"
#include "core/names.h"

namespace hpr {

Session::Session(Communicator& comm, const Globals& globals, const std::function<Scene()>& load)
    : comm_(comm), share_(host_share(comm, globals)), scene_(distribute_scene(comm_, load)) {
  if (comm_.rank() == 0) {
    for (const std::string& warning : scene_.warnings)
      log::warning("{}: {}", printable(scene_.name), printable(warning, 400));
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

Communicator& Session::group(std::span<const int> members) {
  if (static_cast<int>(members.size()) == comm_.size()) return comm_;
  if (!group_.comm || !std::ranges::equal(members, group_.members)) {
    group_.comm = comm_.subset(members);
    group_.members.assign(members.begin(), members.end());
  }
  return *group_.comm;
}

TileLayer<Key>& Session::keys(const FrameLayout& layout) {
  if (keys_.layout() == layout && keys_.tiles() == layout.tiles()) {
    keys_.clear();
  } else {
    keys_ = TileLayer<Key>(layout);
  }
  return keys_;
}

}  // namespace hpr
