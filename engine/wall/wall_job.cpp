#include "engine/wall/wall_job.h"

#include <algorithm>

#include "core/error.h"
#include "walls/geometry/geometry.h"

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

void check_frames(const WallJob& job, const FrameSettings& settings) {
  if (job.target_ms || job.open_ended()) {
    throw Error(ExitCode::Usage, "--aov and --raw are of a last frame with all its pixels",
                "say how many there are with --frames, and leave --target-ms out");
  }
  const bool curved = std::ranges::any_of(job.wall.screens, has_position_map);
  if (curved && settings.primary == Primary::Raster) {
    throw Error(ExitCode::Usage,
                "OpenGL draws no surfaces for the pixels of curved screens, which --aov and --raw tell of",
                "use --primary rays");
  }
}

}  // namespace

Sampling sampling_of(const WallJob& job, const RenderSettings& settings) {
  Sampling sampling = settings.sampling;
  if (!job.target_relmse) return sampling;
  sampling.goal.relmse = job.target_relmse;
  if (!settings.is_given("spp")) sampling.goal.samples.reset();
  return sampling;
}

WallLayerFiles layer_files(const WallJob& job, const RenderSettings& settings, const std::filesystem::path& folder,
                           const std::string& raw) {
  WallLayerFiles files;
  const bool wants_aovs = !settings.frame.aovs.empty();
  if (!wants_aovs && raw.empty()) return files;
  if (wants_aovs && job.display->name != "file") {
    throw Error(ExitCode::Usage, "--aov needs a folder its files go to", "use it with --display file and -o DIR");
  }
  if (!raw.empty()) check_raw(settings);
  check_frames(job, settings.frame);
  const std::vector<std::string> names = names_of_pictures(job.wall);
  const std::filesystem::path keys = raw;
  for (const std::string& name : names) {
    if (wants_aovs) files.aov.push_back((folder / (name + ".aov.exr")).string());
    if (raw.empty()) continue;
    const std::string file = keys.stem().string() + "-" + name + keys.extension().string();
    files.raw.push_back(names.size() == 1 ? raw : (keys.parent_path() / file).string());
  }
  return files;
}

}  // namespace hpr
