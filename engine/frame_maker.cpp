#include "engine/frame_maker.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <utility>

#include "cluster/transport/collectives.h"
#include "core/progress.h"
#include "engine/balance/load_balance.h"
#include "engine/budget.h"
#include "engine/checkpoint/checkpoint.h"
#include "engine/frame_sampler.h"
#include "engine/output.h"
#include "engine/session.h"
#include "rt/passes/pass_list.h"
#include "scene/view.h"

namespace hpr {
namespace {

/// Of a frame that has a goal other than a number of samples.
constexpr std::uint32_t kMaxSamples = 64;

/// From the same place in the same direction.
bool same_projection(const View& a, const View& b) {
  return a.eye == b.eye && a.axes == b.axes && a.left == b.left && a.right == b.right && a.top == b.top &&
         a.bottom == b.bottom;
}

/// Whether pixels are filtered, so that screens that touch must go on into each other.
bool filters(const RaySettings& rays, double scale) {
  return rays.denoise || !rays.half_resolution.empty() || scale != 1.0;
}

}  // namespace

FrameMaker::FrameMaker(Session& session, FrameSettings settings, const Sampling& sampling,
                       std::span<const View> screens, std::optional<double> target_ms,
                       const std::optional<SampleGoal>& resting, bool keeps_keys)
    : session_(session),
      settings_(std::move(settings)),
      sampling_(sampling),
      resting_(sampling),
      target_ms_(target_ms),
      keeps_keys_(keeps_keys) {
  if (resting) resting_.goal = *resting;
  plan_for({}, screens);
  if (!target_ms_) return;
  // Whatever the size of a frame and whatever is given up, it has as many photons and takes its keys and its light the
  // same way: the shader stays, and times of a device and of the CPU are not mixed.
  settings_.photons_fit_frame = false;
  settings_.rays.photons = plan_.rays.photons;
  settings_.rays.photon_footprint = plan_.rays.photon_footprint;
  settings_.rays.fits_photons = plan_.rays.fits_photons;
  settings_.primary = plan_.primary;
  settings_.distribution = plan_.distribution;
  settings_.rays.gather = plan_.rays.gather;
  settings_.indirect_is_chosen = true;
  settings_.keys_by_device = plan_.keys_on_device;
  settings_.light_by_device = plan_.rays.on_device;
  degradations_ = degradations_for(settings_, plan_passes(session.requirements(), plan_.rays), plan_.rays.on_device);
  budget_.emplace(BudgetSettings{
      .target_ms = *target_ms_, .max_samples = max_samples(), .degradations = static_cast<int>(degradations_.size())});
  std::vector<std::string> explained = plan_.explained;
  explained.push_back(fmt::format("budget: {} ms a frame (as asked); given up, first to last: {}", *target_ms_,
                                  fmt::join(all_degradations(), ", ")));
  plan_for(budget_->effort(), screens);
  plan_.explained = std::move(explained);
}

FrameMaker::~FrameMaker() = default;

Frame& FrameMaker::frame() {
  return sampler_->frame();
}

std::vector<std::string> FrameMaker::all_degradations() const {
  std::vector<std::string> names;
  if (max_samples() > 1) names.emplace_back("samples");
  for (const std::string& degradation : degradations_) names.push_back(degradation);
  names.emplace_back("resolution");
  return names;
}

std::uint32_t FrameMaker::max_samples() const {
  return std::min(sampling_.goal.samples.value_or(kMaxSamples), kMaxSamples);
}

void FrameMaker::plan_for(const Effort& effort, std::span<const View> screens) {
  const double scale = settings_.resolution_scale * scale_of_step(effort.scale_step);
  const auto count = static_cast<std::size_t>(effort.degradations);
  const FrameSettings settings = apply_degradations(settings_, std::span(degradations_).first(count));
  blocks_ = filters(settings.rays, scale) ? cut_blocks(join_screens(screens), scale) : cut_blocks(screens, scale);
  const bool same_plan = plan_.layout.tiles() > 0 && effort.degradations == effort_.degradations &&
                         effort.scale_step == effort_.scale_step && plan_.layout == layout_of(blocks_.views);
  if (same_plan) return;
  sampler_.reset();  // it holds on to the plan
  plan_ = plan_frame(session_, settings, blocks_.views);
  frames_of_plan_ = 0;
  light_was_known_ = false;
  effort_ = effort;
}

void FrameMaker::discard() {
  session_.balance().forget();  // a rank may have failed where others had gone on
  refining_ = false;
}

bool FrameMaker::is_resting(std::span<const View> screens) const {
  return std::ranges::equal(screens, last_screens_, same_projection);
}

VerifyCounts FrameMaker::verified() const {
  const VerifyCounts& all = times_.verified;
  const VerifyCounts& before = times_before_.verified;
  return {all.tiles - before.tiles, all.mismatches - before.mismatches, all.unmended - before.unmended};
}

bool FrameMaker::refined(std::span<const View> screens) const {
  return refining_ && is_resting(screens) && reached(resting_, sampler_->sample_progress());
}

Frame* FrameMaker::make(std::span<const View> screens, std::uint64_t number, Progress& progress, Interrupt* interrupt) {
  session_.comm().begin_frame(number);
  session_.forget_unused_texels();
  if (!budget_) {
    plan_for({}, screens);
    make_anew(number, sampling_.goal.samples.value_or(0), progress);
  } else if (is_resting(screens)) {
    if (!refine(screens, number, interrupt)) return nullptr;
  } else {
    refining_ = false;
    const Effort effort = all_gather_value(session_.comm(), budget_->effort()).front();
    plan_for(effort, screens);
    make_anew(number, effort.samples, progress);
    write_report(effort, effort.samples);
  }
  last_screens_.assign(screens.begin(), screens.end());
  return &sampler_->frame();
}

/// Once it is known what light takes, and from time to time as views move.
void FrameMaker::choose_distribution_again() {
  constexpr int kFramesBetweenChoices = 16;
  if (!plan_.distribution_is_predicted) return;
  const bool learned_light = !light_was_known_ && !session_.balance().light_costs(plan_.layout).empty();
  if (++frames_of_plan_ <= kFramesBetweenChoices && !learned_light) return;
  light_was_known_ = light_was_known_ || learned_light;
  frames_of_plan_ = 1;
  choose_again(session_, settings_, blocks_.views, plan_);
}

void FrameMaker::make_anew(std::uint64_t number, std::uint32_t samples, Progress& progress) {
  times_before_ = {};
  Sampling sampling = sampling_;
  if (budget_) {
    sampling.goal = {.samples = samples, .seconds = {}, .relmse = {}};
    if (samples < min_samples(sampling)) sampling.filter.reset();
  }
  sampler_.reset();  // frees its memory before the next one takes some
  choose_distribution_again();
  update_areas(session_, plan_, blocks_.views);
  sampler_ = std::make_unique<FrameSampler>(session_, plan_, sampling, number, keeps_keys_);
  (void)sampler_->draw(blocks_.views, {}, progress);  // it stops before its goal for a checkpoint only
  times_ = sampler_->times();
  relmse_ = sampler_->sample_progress().relmse;
}

bool FrameMaker::refine(std::span<const View> screens, std::uint64_t number, Interrupt* interrupt) {
  if (!refining_) {
    sampler_.reset();
    plan_for({}, screens);
    update_areas(session_, plan_, blocks_.views);
    sampler_ = std::make_unique<FrameSampler>(session_, plan_, resting_, number, false);
    times_ = {};
  }
  refining_ = true;
  const FrameTimes before = times_;
  if (!sampler_->refine(blocks_.views, interrupt)) return false;
  times_before_ = before;
  times_ = sampler_->times();
  relmse_ = sampler_->sample_progress().relmse;
  write_report({max_samples(), 0, 0}, sampler_->sample_progress().samples);
  report_->resting = true;
  return true;
}

void FrameMaker::record_frame_time(double slowest_ms) {
  if (budget_ && !refining_) budget_->record_frame_time(slowest_ms);
}

void FrameMaker::write_report(const Effort& effort, std::uint32_t samples) {
  BudgetReport report{*target_ms_, settings_.resolution_scale * scale_of_step(effort.scale_step), samples, {}};
  if (samples < max_samples() && !refining_) report.given_up.emplace_back("samples");
  for (int i = 0; i < effort.degradations; ++i) report.given_up.push_back(degradations_[static_cast<std::size_t>(i)]);
  if (effort.scale_step > 0) report.given_up.emplace_back("resolution");
  report_ = std::move(report);
}

}  // namespace hpr
