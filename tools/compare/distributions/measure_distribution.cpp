#include "tools/compare/distributions/measure_distribution.h"

#include <algorithm>
#include <span>
#include <vector>

#include "app/options/render_options.h"
#include "cluster/transport/collectives.h"
#include "compositing/assembly.h"
#include "compositing/compositor.h"
#include "core/bytes.h"
#include "core/peak_memory.h"
#include "core/progress.h"
#include "core/timing.h"
#include "engine/display/exposure.h"
#include "engine/frame_maker.h"
#include "engine/output.h"
#include "engine/session.h"
#include "engine/wall/wall_displays.h"
#include "rt/deferred_shader.h"
#include "tools/compare/compare.h"
#include "tools/compare/distributions/frame_prediction.h"
#include "walls/config/wall_file.h"
#include "walls/geometry/geometry.h"

namespace hpr {
namespace {

std::vector<View> views_of(const Wall& wall, const RenderSettings& settings, const Scene& scene) {
  return wall_views(wall, choose_camera(settings.camera, scene), scene.bounds);
}

/// The frames of one distribution by the ranks of a session.
class DistributionBench {
 public:
  /// Collective.
  DistributionBench(Session& session, const DistributionInput& input, const RenderSettings& settings)
      : session_(session),
        input_(input),
        display_(settings.display),
        wall_(load_wall(wall_of(input.grid, input.screen))),
        screens_(views_of(wall_, settings, session.scene())),
        maker_(session, settings.frame, settings.sampling, screens_, {}, {}, true) {
    showing_.shown_by = owners_of(wall_, all_gather_texts(session.comm(), session.host()), false);
    for (const View& screen : screens_) showing_.sizes.push_back(screen.screen);
    prepare(session, maker_.plan());
  }

  [[nodiscard]] const FramePlan& plan() const { return maker_.plan(); }

  /// Collective. What this rank measured of one frame.
  RankFrame draw() {
    CountingCommunicator& comm = session_.comm();
    session_.shader(plan().rays).discard_photons();  // of the same sample, in the frame before
    barrier(comm);
    const std::size_t bytes_before = comm.bytes_sent();
    const std::size_t messages_before = comm.messages_sent();
    const Stopwatch watch;
    Progress silent("none", "sample", 0);
    Frame& frame = *maker_.make(screens_, 0, silent);  // frames of another number have other noise
    showing_.transform = transform_for(session_, frame, maker_.blocks().views, display_);
    const Stopwatch collecting;
    pictures_ = bring_to_screens(session_, frame, maker_.blocks(), showing_);
    const double collect_ms = collecting.ms();
    const FrameTimes& times = maker_.times();
    RankFrame measured{.ms = watch.ms(), .stages = {}, .work_ms = times.work.keys_ms + times.work.light_ms};
    measured.stages = {.chunks_ms = times.chunk_exchange_ms,
                       .draw_ms = times.primary_ms,
                       .composite_ms = times.composite_ms,
                       .move_ms = times.move_ms,
                       .light_ms = times.light_ms,
                       .return_ms = times.return_ms,
                       .collect_ms = collect_ms};
    measured.bytes = comm.bytes_sent() - bytes_before;
    measured.messages = comm.messages_sent() - messages_before;
    return measured;
  }

  /// Collective. The last frame, on rank 0.
  [[nodiscard]] WholeFrame collect() {
    Frame& frame = maker_.frame();
    const Blocks& blocks = maker_.blocks();
    const std::vector<int> to_root(blocks.views.size(), 0);
    session_.assembler().assemble(session_.comm(), *frame.keys, frame.owned, to_root);
    WholeFrame whole;
    for (std::size_t screen = 0; screen < screens_.size(); ++screen) {
      bring_to_root(screen);
      if (session_.rank() != 0) continue;
      place(join_blocks(*frame.keys, blocks, screen), screen, whole.keys);
      place(pictures_[screen], screen, whole.picture);
    }
    return whole;
  }

  /// Collective. What a frame is to take, by what this rank measured of one before.
  [[nodiscard]] std::optional<double> predict(const RankFrame& before) {
    const RankStages& stages = before.stages;
    const double shared_out =
        stages.chunks_ms + stages.draw_ms + stages.composite_ms + stages.move_ms + stages.light_ms + stages.return_ms;
    return predict_frame_ms(session_, plan(), maker_.blocks().views, maker_.times().samples,
                            std::max(before.ms - shared_out, 0.0));
  }

  /// Collective. The compositing strategy at work.
  [[nodiscard]] std::string strategy() {
    const std::vector<int>& group = plan().mine.group;
    const std::string mine =
        group.size() > 1 ? std::string(session_.compositor(plan().strategy, group).chosen()) : std::string();
    for (const std::string& name : all_gather_texts(session_.comm(), mine)) {
      if (!name.empty()) return name;
    }
    return kNoStrategy;
  }

 private:
  void bring_to_root(std::size_t screen) {
    const int owner = showing_.shown_by[screen];
    if (owner == 0) return;
    const Size size = showing_.sizes[screen];
    if (session_.rank() == owner) session_.comm().send(std::as_bytes(pictures_[screen].pixels()), 0);
    if (session_.rank() != 0) return;
    pictures_[screen] = Image<Rgba8>(size);
    session_.comm().receive(std::as_writable_bytes(pictures_[screen].pixels()), owner);
  }

  /// Puts a screen's pixels where they stand in the wall.
  template <typename Pixel>
  void place(const Image<Pixel>& pixels, std::size_t screen, Image<Pixel>& wall) const {
    const int column = static_cast<int>(screen) % input_.grid.width;
    const int row = static_cast<int>(screen) / input_.grid.width;
    if (screen == 0) {
      wall = Image<Pixel>({pixels.width() * input_.grid.width, pixels.height() * input_.grid.height});
    }
    paste(pixels, column * pixels.width(), row * pixels.height(), wall);
  }

  Session& session_;
  const DistributionInput& input_;
  DisplaySettings display_;
  Wall wall_;
  std::vector<View> screens_;
  FrameMaker maker_;
  Showing showing_;
  std::vector<Image<Rgba8>> pictures_;
};

std::string hash_of(const Image<Rgba8>& picture) {
  return hex16(xxh64(std::as_bytes(picture.pixels())));
}

}  // namespace

RenderSettings DistributionInput::settings_for(const std::string& distribution) const {
  RenderSettings one = settings;
  set_setting(one, "distribute", distribution);
  return resolve(std::move(one), seed);
}

DistributionRun measure_distribution(Communicator& comm, const Globals& globals, const DistributionInput& input,
                                     const std::string& distribution, Repetitions frames, const CheckFrame& check) {
  const RenderSettings settings = input.settings_for(distribution);
  Session session(comm, globals.session(), [&] { return load_scene(input.scene, settings, globals, input.screen); });
  DistributionBench bench(session, input, settings);
  DistributionRun run;
  run.distribution = distribution;
  run.ranks = comm.size();
  run.threads = session.threads();
  run.transport = comm.transport();
  const bool is_local = settings.frame.shading == Shading::Local;
  measure_in_turns(1, frames, [&](std::size_t /*contender*/, bool counts) {
    const RankFrame mine = bench.draw();
    const std::vector<RankFrame> all = all_gather_value(comm, mine);
    if (!counts) {
      run.predicted_ms = bench.predict(mine);
      return;
    }
    run.add(all, settings.frame.shading);
    if (run.memory_peak_bytes.empty()) run.memory_peak_bytes = all_gather_value(comm, peak_memory_bytes());
    const WholeFrame whole = bench.collect();
    if (comm.rank() != 0) return;
    run.differing_pixels = std::max(run.differing_pixels, check(whole));
    run.picture_xxh64 = hash_of(whole.picture);
    run.frame_xxh64 =
        is_local ? hash_of(frame_colors(whole.keys, true)) : hex16(xxh64(std::as_bytes(whole.keys.pixels())));
  });
  if (!settings.frame.distribution) run.chosen = name_of(bench.plan().distribution);
  run.strategy = bench.strategy();
  return run;
}

}  // namespace hpr
