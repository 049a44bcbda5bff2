#include "engine/wall/wall_layers.h"

#include <algorithm>
#include <filesystem>

#include "cluster/transport/agreement.h"
#include "core/file.h"
#include "core/trace.h"
#include "engine/picture_files.h"
#include "walls/geometry/stereo.h"

namespace hpr {
namespace {

/// Of each picture, what its files are named by.
std::vector<std::string> names_of_pictures(const Wall& wall) {
  const std::vector<ScreenEye> pictures = screen_eyes(wall);
  std::vector<std::string> names;
  for (const ScreenEye& picture : pictures) {
    std::string name = wall.screens[picture.screen].id;
    const auto same = [&](const ScreenEye& other) { return other.screen == picture.screen; };
    if (std::ranges::count_if(pictures, same) > 1) name += picture.eye == Eye::Left ? "-left" : "-right";
    names.push_back(std::move(name));
  }
  return names;
}

void check_frames(const WallRun& run, const Wall& wall, const FrameSettings& settings) {
  if (run.target_ms || run.open_ended()) {
    throw Error(ExitCode::Usage, "--aov and --raw are of a last frame with all its pixels",
                "say how many there are with --frames, and leave --target-ms out");
  }
  const bool curved =
      std::ranges::any_of(wall.screens, [](const WallScreen& screen) { return screen.warp.points != nullptr; });
  if (curved && settings.primary == Primary::Raster) {
    throw Error(ExitCode::Usage,
                "OpenGL draws no surfaces for the pixels of curved screens, which --aov and --raw tell of",
                "use --primary rays");
  }
}

}  // namespace

WallLayers::WallLayers(const WallRun& run, const Wall& wall, const FrameSettings& settings) {
  if (settings.aovs.empty() && run.raw.empty()) return;
  if (!settings.aovs.empty() && !run.writes_files()) {
    throw Error(ExitCode::Usage, "--aov needs a folder its files go to", "use it with --display file and -o DIR");
  }
  if (!run.raw.empty()) check_raw(run.options);
  check_frames(run, wall, settings);
  const std::vector<std::string> names = names_of_pictures(wall);
  const std::filesystem::path keys = run.raw;
  for (const std::string& name : names) {
    if (!settings.aovs.empty()) {
      aov.push_back((std::filesystem::path(run.display.output) / (name + ".aov.exr")).string());
    }
    if (!run.raw.empty()) {
      const std::string file = keys.stem().string() + "-" + name + keys.extension().string();
      raw.push_back(names.size() == 1 ? run.raw : (keys.parent_path() / file).string());
    }
  }
}

std::vector<std::string> WallLayers::all() const {
  std::vector<std::string> files = aov;
  files.insert(files.end(), raw.begin(), raw.end());
  return files;
}

void write_layers(const WallLayers& files, std::span<const Aov> aovs, WallDriver& driver, Session& session) {
  if (files.all().empty()) return;
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
