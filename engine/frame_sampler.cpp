#include "engine/frame_sampler.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cluster/transport/collectives.h"
#include "compositing/assembly.h"
#include "core/error.h"
#include "core/log.h"
#include "core/progress.h"
#include "core/signals.h"
#include "core/timing.h"
#include "engine/balance/load_balance.h"
#include "engine/checkpoint/checkpoint.h"
#include "engine/session.h"

namespace hpr {
namespace {

/// What ranks exchange between samples.
struct RankState {
  Request request = Request::None;
  double seconds = 0.0;  ///< rank 0's clock is everybody's
  bool due = false;      ///< a checkpoint, by rank 0's clock
};

RankState agree(Communicator& comm, const RankState& mine) {
  const std::vector<RankState> all = all_gather_value(comm, mine);
  RankState agreed = all.front();
  for (const RankState& each : all) agreed.request = std::max(agreed.request, each.request);
  return agreed;
}

std::string describe(const SampleGoal& goal, const SampleProgress& progress) {
  std::string text = fmt::format("{:.1f} s", progress.seconds);
  if (progress.relmse) text += fmt::format(", relMSE about {:.2g}", *progress.relmse);
  if (const auto left = remaining_seconds(goal, progress)) text += fmt::format(", {:.0f} s left", *left);
  return text;
}

bool is_due(const CheckpointSettings& checkpoint, const Stopwatch& written) {
  if (checkpoint.path.empty() || checkpoint.every <= std::chrono::nanoseconds::zero()) return false;
  return std::chrono::duration<double, std::milli>(written.ms()) >= checkpoint.every;
}

}  // namespace

FrameSampler::FrameSampler(Session& session, const FramePlan& plan, const Sampling& sampling, std::uint64_t frame,
                           bool keeps_keys)
    : session_(session),
      plan_(plan),
      sampling_(sampling),
      number_(frame),
      film_(sampling.sums() ? plan.layout : FrameLayout(),
            {plan.layers, keeps_keys, sampling.adaptive && sampling.sums() ? AdaptiveSampling::pilot_of(sampling) : 0}),
      keeps_keys_(sampling.sums() && film_.keys().tiles() > 0) {
  if (!film_.is_adaptive()) return;
  adaptive_.emplace(sampling);
  due_ = PixelMask(film_.layout());
}

void FrameSampler::load(const CheckpointSettings& checkpoint) {
  struct Start {
    Film::Counters counters;
    std::uint32_t samples = 0;
    std::uint32_t budget = 0;
    double seconds = 0.0;
    double relmse = -1.0;
  };
  Start start;
  check_on_root(session_.comm(), [&] {
    const SampleProgress found = checkpoint_file_->read(checkpoint.identity(), film_);
    start = {film_.counters(), found.samples, found.budget, found.seconds, found.relmse.value_or(-1.0)};
    if (checkpoint.takes_more || found.samples <= sampling_.goal.samples.value_or(found.samples)) return;
    throw Error(ExitCode::BadInput,
                fmt::format("{}: the checkpoint holds {} samples, more than the {} asked for", checkpoint.path.string(),
                            found.samples, *sampling_.goal.samples),
                "ask for as many with --spp, or start anew without --resume");
  });
  start = all_gather_value(session_.comm(), start).front();
  film_.set_counters(start.counters);
  progress_ = {start.samples, start.seconds, {}, start.budget};
  if (start.relmse >= 0.0) progress_.relmse = start.relmse;
  if (adaptive_) adaptive_->resume(session_.comm(), progress_, film_, tiles());
  resumed_ = progress_.samples;
  scattered_ = false;
  if (session_.rank() == 0) log::info("going on after {} samples", progress_.samples);
}

void FrameSampler::write(const CheckpointSettings& checkpoint, bool asked_for) {
  const std::vector<int> to_root(plan_.layout.screens(), 0);
  film_.each_layer([&](auto& layer) {
    if (layer.tiles() > 0) session_.assembler().assemble(session_.comm(), layer, ownership_->mine(), to_root);
  });
  agree_on_failure(session_.comm(), [&] {
    if (session_.rank() != 0) return;
    checkpoint_file_->write(checkpoint.identity(), film_, progress_, asked_for);
  });
}

bool FrameSampler::try_to_write(const CheckpointSettings& checkpoint, bool asked_for) {
  try {
    write(checkpoint, asked_for);
  } catch (const Error& error) {
    // On every rank alike. Samples that cannot be written are not to be lost as well.
    if (session_.rank() == 0) log::error("{}: going on without a checkpoint; {}", error.what(), error.hint());
    return false;
  }
  if (session_.rank() != 0) return true;
  const std::string text = fmt::format("{} samples are in '{}'", progress_.samples, checkpoint.path.string());
  log::write(asked_for ? log::Level::Info : log::Level::Debug, text);
  return true;
}

void FrameSampler::remove_unasked_checkpoints() {
  if (checkpoint_file_) checkpoint_file_->remove_unasked();
}

JitteredViews FrameSampler::jittered_views(std::span<const View> views, std::uint32_t number, double& weight) {
  const FilterSample through = subpixel_sample(sampling_, {plan_.rays.seed, number_}, number);
  JitteredViews jittered{{views.begin(), views.end()},
                         {{number_, number}, &ownership_, adaptive_ ? &due_ : nullptr, nullptr}};
  for (View& view : jittered.views) view.jitter = through.offset;
  weight = through.weight;
  return jittered;
}

void FrameSampler::scatter() {
  if (std::exchange(scattered_, true)) return;
  film_.each_layer([&](auto& layer) {
    if (layer.tiles() > 0) ownership_->scatter(session_.comm(), layer);
  });
  if (adaptive_ && film_.samples() >= film_.pilot()) film_.mark_due(ownership_->mine(), due_);
}

/// The tiles of a checkpoint are all rank 0's until the first sample gives them owners.
std::vector<std::size_t> FrameSampler::tiles() const {
  if (ownership_ && scattered_) return ownership_->mine();
  return session_.rank() == 0 ? all_tiles(plan_.layout) : std::vector<std::size_t>{};
}

/// The pixels of the first sample after a checkpoint was read are not known before its tiles have owners.
void FrameSampler::choose_pixels() {
  if (adaptive_->is_stage_done()) adaptive_->start_stage(session_.comm(), film_, tiles(), session_.threads());
  if (ownership_ && scattered_ && film_.samples() >= film_.pilot()) film_.mark_due(ownership_->mine(), due_);
}

bool FrameSampler::add_samples(std::span<const View> views, std::uint32_t count, Interrupt* interrupt) {
  if (adaptive_) {
    choose_pixels();
    if (adaptive_->is_stage_done()) return true;  // no pixel wants more
    count = std::min(count, scattered_ ? adaptive_->max_batch() : 1);
  }
  const std::function<void()> before_shading = [this] { scatter(); };
  std::vector<JitteredViews> jittered;
  std::vector<double> weights(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    jittered.push_back(jittered_views(views, film_.samples() + i, weights[i]));
    jittered.back().sample.before_shading = &before_shading;
    jittered.back().sample.interrupt = interrupt;
  }
  FrameTimes round_times;
  std::vector<Frame> frames;
  if (count > 1) {
    frames = make_round(session_, plan_, jittered, round_times);
  } else {
    frames.push_back(make_frame(session_, plan_, jittered.front().views, &round_times, jittered.front().sample));
  }
  if (frames.front().overtaken) return false;
  std::vector<SampleLight> lights;
  lights.reserve(count);
  for (const Frame& frame : frames) lights.push_back({frame.radiance, frame.aovs, *frame.keys});
  film_.add(lights, weights, ownership_->mine(), session_.threads());
  if (adaptive_) adaptive_->added(count, film_);
  times_ += round_times;
  frame_.keys = frames.back().keys;
  return true;
}

void FrameSampler::report_progress(double seconds) {
  progress_.samples = adaptive_ ? adaptive_->samples() : film_.samples();
  if (adaptive_) {
    progress_.budget = adaptive_->budget();
    times_.samples = static_cast<int>(progress_.samples - resumed_);
  }
  progress_.seconds = seconds;
  const bool milestone = adaptive_ ? adaptive_->at_milestone() : is_milestone(film_.samples());
  if (!milestone || progress_.samples < 2) return;
  progress_.relmse = estimated_relmse(session_.comm(), film_, tiles(), session_.threads());
}

/// Up to the next sample after which the error is estimated, if that is a goal, else to the last one that can be
/// reached; no longer than somebody who sends a signal or looks at a clock would wait.
std::uint32_t FrameSampler::size_of_round() {
  constexpr double kSeconds = 2.0;
  constexpr std::size_t kQuickPixels = std::size_t{1} << 18U;  // of which a few samples take no longer
  const std::uint32_t done = progress_.samples;
  auto most = static_cast<double>(max_round_size(session_, plan_));
  if (sampling_.goal.samples && !adaptive_) most = std::min(most, static_cast<double>(*sampling_.goal.samples - done));
  if (done > 0) {
    const double left = sampling_.goal.seconds ? *sampling_.goal.seconds - progress_.seconds : kSeconds;
    most = std::min(most, std::min(left, kSeconds) * done / std::max(progress_.seconds, 1e-9));
  } else if (sampling_.goal.seconds ||
             plan_.layout.pixels() * static_cast<std::size_t>(plan_.rays.light_samples) > kQuickPixels) {
    most = 1.0;
  }
  const auto limit = static_cast<std::uint32_t>(std::max(most, 1.0));
  if (adaptive_) return limit;  // add_samples() ends it where another step begins
  std::uint32_t last = limit;
  for (std::uint32_t count = limit; count > 0; --count) {
    if (!is_milestone(done + count)) continue;
    last = count;
    if (!sampling_.goal.relmse) break;
  }
  return last;
}

bool FrameSampler::draw(std::span<const View> views, const CheckpointSettings& checkpoint, Progress& progress) {
  if (measures_costs()) session_.balance().start_frame(plan_.layout);
  if (!sampling_.sums()) {
    frame_ = make_frame(session_, plan_, views, &times_, {{number_, 0}, nullptr});
    progress_.samples = 1;
    note_costs();
    return true;
  }
  checkpoint_file_.emplace(checkpoint.path, checkpoint.keeps_previous);
  if (checkpoint.resume) load(checkpoint);
  const double before = progress_.seconds;
  const Stopwatch watch;
  std::optional<Stopwatch> requested;
  Stopwatch written;
  while (!reached(sampling_, progress_)) {
    (void)add_samples(views, size_of_round());
    // Without a checkpoint a request is for whoever draws frame after frame.
    Request request = checkpoint.path.empty() ? Request::None : take_request();
    // One signal reaches the ranks of a job one by one, maybe in different samples.
    if (request == Request::Write && requested && requested->ms() < 1000.0) request = Request::None;
    const RankState agreed = agree(session_.comm(), {request, before + 1e-3 * watch.ms(), is_due(checkpoint, written)});
    report_progress(agreed.seconds);
    progress.show(progress_.samples, describe(sampling_.goal, progress_));
    const bool asked_for = agreed.request != Request::None;
    if (!(asked_for || agreed.due) || reached(sampling_, progress_)) continue;
    if (asked_for) progress.end();
    if (try_to_write(checkpoint, asked_for) && agreed.request == Request::Stop) return false;
    if (asked_for) requested.emplace();
    written.restart();
  }
  if (checkpoint.at_end && ownership_) write(checkpoint, true);
  finish();
  note_costs();
  return true;
}

bool FrameSampler::measures_costs() const {
  return plan_.balance != Balance::Static && !plan_.rays.reference;
}

void FrameSampler::note_costs() {
  if (measures_costs()) session_.balance().finish_frame(session_.comm(), plan_.layout, times_.samples);
}

bool FrameSampler::refine(std::span<const View> views, Interrupt* interrupt) {
  if (!sampling_.sums()) {
    if (progress_.samples > 0) return true;
    Frame frame = make_frame(session_, plan_, views, &times_, {.number = {number_, 0}, .interrupt = interrupt});
    if (frame.overtaken) return false;
    frame_ = std::move(frame);
    progress_.samples = 1;
    return true;
  }
  if (!reached(sampling_, progress_)) {
    const Stopwatch watch;
    if (!add_samples(views, 1, interrupt)) return false;
    const double seconds = progress_.seconds + 1e-3 * watch.ms();
    report_progress(agree(session_.comm(), {Request::None, seconds, false}).seconds);
  }
  finish();
  return true;
}

void FrameSampler::finish() {
  if (!ownership_) {  // a checkpoint that had reached the goal: rank 0 has it all
    ownership_.emplace(session_.comm(), plan_.layout, tiles());
  }
  const auto [even, odd] = film_.counters().weights;
  if (even + odd == 0.0) {  // which no filter's are, but those a checkpoint claims may be; the same on all ranks
    throw Error(ExitCode::BadInput, "the weights of the samples add up to 0: the checkpoint is not one of a run",
                "start anew, without --resume");
  }
  frame_.owned = ownership_->mine();
  frame_.radiance = TileLayer<Rgb>(plan_.layout);
  frame_.aovs = AovLayers(plan_.layout, plan_.layers);
  frame_.is_transparent = plan_.is_transparent();
  film_.resolve(frame_.owned, session_.threads(), frame_.radiance, frame_.aovs);
  if (keeps_keys_) frame_.keys = &film_.keys();
}

}  // namespace hpr
