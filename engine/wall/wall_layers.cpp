#include "engine/wall/wall_layers.h"

#include <algorithm>

#include "cluster/transport/collectives.h"
#include "core/file.h"
#include "core/timing.h"
#include "engine/picture_files.h"

namespace hpr {

void write_layers(const WallLayerFiles& files, std::span<const Aov> aovs, WallDriver& driver, Session& session) {
  if (files.empty()) return;
  const trace::Span span("write layers");
  Frame& frame = driver.frames().frame();
  const Blocks& blocks = driver.frames().blocks();
  const std::vector<int> to_root(blocks.views.size(), 0);
  const auto collect = [&](auto& layer) { session.assembler().assemble(session.comm(), layer, frame.owned, to_root); };
  if (!files.raw.empty() || std::ranges::any_of(aovs, needs_keys)) collect(*frame.keys);
  if (!files.aov.empty()) collect(frame.radiance);
  for (auto& [which, layer] : frame.aovs.rgb) collect(layer);
  for (auto& [which, layer] : frame.aovs.single) collect(layer);
  agree_on_failure(session.comm(), [&] {
    if (session.rank() != 0) return;
    for (std::size_t i = 0; i < files.aov.size(); ++i) {
      write_file_atomically(files.aov[i],
                            encode_exr(join_blocks(frame.radiance, blocks, i), {{"hpr:scene", session.scene().name}},
                                       exr_layers(frame, blocks, i, aovs)));
    }
    for (std::size_t i = 0; i < files.raw.size(); ++i) {
      write_file_atomically(files.raw[i], std::as_bytes(join_blocks(*frame.keys, blocks, i).pixels()));
    }
  });
}

}  // namespace hpr
