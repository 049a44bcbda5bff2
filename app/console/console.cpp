#include "app/console/console.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <utility>

#include "app/stats_file.h"
#include "cluster/transport/collectives.h"
#include "core/error.h"
#include "core/file.h"
#include "core/progress.h"
#include "core/text.h"
#include "core/timing.h"
#include "engine/picture_files.h"
#include "engine/resolution.h"

namespace hpr {

Console::Console(Session& session, const Globals& globals, RenderSettings settings, Size size)
    : session_(session),
      globals_(globals),
      settings_(std::move(settings)),
      size_(size),
      controls_(
          session, settings_, globals.seed,
          [this](const std::string& source, const RenderSettings& its) { return load_scene(source, its, globals_); },
          table_) {
  table_.add({"size", "WxH", "pixels of the picture", [this](Words words) { return set_size(words); }});
  table_.add({"render", "", "draw the picture", [this](Words) { return render(); }});
  table_.add({"save", "FILE.(png|exr)", "write the last picture", [this](Words words) { return save(words); }});
  table_.add({"stats", "FILE.json", "write what the last picture took",
              [this](Words words) { return write_stats_of(words); }});
  table_.add({"explain", "", "the plan of the next picture, and why", [this](Words) { return explain(); }});
  table_.add({"quit", "", "end the session", [this](Words) {
                quits_ = true;
                return std::string();
              }});
}

View Console::view() const {
  return make_view(choose_camera(settings_.camera, session_.scene()), size_, session_.scene().bounds);
}

std::string Console::set_size(Words words) {
  const auto extent = words.size() == 1 ? parse_extent(words[0]) : std::nullopt;
  if (!extent) refuse("a size is two numbers", "size 1920x1080");
  check_size({extent->first, extent->second}, globals_.picture_limits());
  size_ = {extent->first, extent->second};
  return "";
}

std::string Console::render() {
  const RenderSettings settings = resolve(settings_, globals_.seed);
  const View seen = view();
  auto picture = std::make_unique<Picture>();
  picture->size = size_;
  picture->exposure = settings.exposure_stops;
  picture->colors = settings.color_format;
  picture->scene_name = session_.scene().name;
  picture->blocks = cut_blocks(at_resolution(std::span(&seen, 1), settings.frame.resolution_scale));
  picture->plan = plan_frame(session_, settings.frame, picture->blocks.views);
  picture_.reset();  // frees its memory before the next one takes some

  const Stopwatch watch;
  const std::size_t sent_before = session_.comm().bytes_sent();
  picture->sampler = std::make_unique<FrameSampler>(session_, picture->plan, settings.sampling, 0, false);
  Progress progress(session_.comm().rank() == 0 ? globals_.progress : "none", "sample",
                    settings.sampling.goal.samples.value_or(0));
  drawing_ = true;
  (void)picture->sampler->draw(picture->blocks.views, {}, progress);  // without a checkpoint it does not stop early
  drawing_ = false;
  picture->stats = gather_stats(session_, picture->plan, picture->sampler->times(),
                                {watch.ms(), session_.comm().bytes_sent() - sent_before});
  picture->stats.relmse = picture->sampler->reached_so_far().relmse;
  picture_ = std::move(picture);
  const RunStats& stats = picture_->stats;
  return fmt::format("{}x{} pixels, {} sample{}: {:.1f} ms", size_.width, size_.height, stats.samples,
                     stats.samples == 1 ? "" : "s", stats.ms);
}

const Console::Picture& Console::picture() const {
  if (!picture_) throw Error(ExitCode::Usage, "there is no picture yet", "draw one first: render");
  return *picture_;
}

std::string Console::save(Words words) {
  if (words.size() != 1 || !(words[0].ends_with(".png") || words[0].ends_with(".exr"))) {
    refuse("a picture is a .png or an .exr", "save picture.png");
  }
  const Picture& last = picture();
  check_on_root(session_.comm(), [&] { check_writable(words[0], globals_.force); });
  PictureFiles files;
  files.picture = words[0];
  files.exposure = last.exposure;
  files.aovs = last.plan.aovs;
  files.colors = last.colors;
  const CollectedPicture collected(session_, last.sampler->frame(), last.blocks, last.size, files);
  agree_on_failure(session_.comm(), [&] {
    if (session_.comm().rank() == 0) collected.write(last.scene_name);
  });
  return words[0];
}

std::string Console::write_stats_of(Words words) const {
  if (words.size() != 1) refuse("where to?", "stats picture.json");
  const Picture& last = picture();
  agree_on_failure(session_.comm(), [&] {
    if (session_.comm().rank() != 0) return;
    check_writable(words[0], globals_.force);
    write_stats(words[0], last.stats);
  });
  return words[0];
}

std::string Console::explain() {
  const RenderSettings settings = resolve(settings_, globals_.seed);
  const View seen = view();
  const Blocks blocks = cut_blocks(at_resolution(std::span(&seen, 1), settings.frame.resolution_scale));
  return fmt::format("{}", fmt::join(plan_frame(session_, settings.frame, blocks.views).explained, "\n"));
}

}  // namespace hpr
