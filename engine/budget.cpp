#include "engine/budget.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "engine/frame_settings.h"
#include "rt/passes/pass_list.h"
#include "rt/ray_settings.h"

namespace hpr {
namespace {

constexpr double kMinScale = 0.1;
/// A run starts small: a first frame that is too quick costs less than one that takes seconds.
constexpr double kFirstScale = 0.3;

// Shares of the target. 95 % of the frames are to take no more than kTail of it.
constexpr double kTail = 1.1;
constexpr double kTailDeviations = 1.65;
constexpr double kMaxAim = 0.92;
constexpr double kMinAim = 0.75;
// The dead band, in shares of the aim.
constexpr double kTooSlow = 1.08;
constexpr double kRoomToRise = 0.93;
constexpr std::size_t kRungsUpAtOnce = 3;
/// Where even the least effort misses the target, what takes at most so much longer than that is kept.
constexpr double kNotWorthSaving = 1.1;
/// Where the target is out of reach a higher effort is tried every so many frames: times at one effort cannot separate
/// fixed cost from cost per pixel.
constexpr int kFramesToProbe = 12;

// Standard deviations a frame adds to what is known: in shares of a frame's time, and of a pixel's.
constexpr double kFixedDrift = 0.01;
constexpr double kEachDrift = 0.05;
constexpr double kSurprising = 3.0;
constexpr double kMinScatter = 0.02;
constexpr double kScatterMemory = 0.9;

/// What a degradation is believed to leave of the time before it was tried.
constexpr double kGuessedRatio = 0.75;
constexpr int kFramesToTrust = 4;

}  // namespace

double scale_of_step(int step) {
  return std::pow(kMinScale, static_cast<double>(step) / (kScaleSteps - 1));
}

FrameBudget::FrameBudget(const BudgetSettings& settings)
    : settings_(settings), ratios_(static_cast<std::size_t>(settings.degradations), kGuessedRatio) {
  HPR_CHECK(settings.target_ms > 0.0 && settings.degradations >= 0 && settings.max_samples > 0);
  for (std::uint32_t samples = settings.max_samples; samples > 1; samples = (samples + 1) / 2) {
    ladder_.push_back({samples, 0, 0});
  }
  for (int degradations = 0; degradations <= settings.degradations; ++degradations)
    ladder_.push_back({1, degradations, 0});
  for (int step = 1; step < kScaleSteps; ++step) ladder_.push_back({1, settings.degradations, step});
  const auto first = std::ranges::find_if(
      ladder_, [](const Effort& effort) { return scale_of_step(effort.scale_step) <= kFirstScale; });
  rung_ = static_cast<std::size_t>(first - ladder_.begin());
}

double FrameBudget::work(std::size_t rung) const {
  const double scale = scale_of_step(ladder_[rung].scale_step);
  return ladder_[rung].samples * scale * scale;
}

double FrameBudget::degradation_ratio(int from, int to) const {
  double ratio = 1.0;
  for (int i = from; i < to; ++i) ratio *= ratios_[static_cast<std::size_t>(i)];
  for (int i = to; i < from; ++i) ratio /= ratios_[static_cast<std::size_t>(i)];
  return ratio;
}

double FrameBudget::predict(std::size_t rung) const {
  return fixed_ms_ + work(rung) * each_ms_ * degradation_ratio(ladder_[rung_].degradations, ladder_[rung].degradations);
}

bool FrameBudget::update_model(double ms) {
  const double x = work(rung_);
  if (!started_) {
    started_ = true;
    fixed_ms_ = 0.2 * ms;
    each_ms_ = 0.8 * ms / x;
    fixed_variance_ = fixed_ms_ * fixed_ms_;
    each_variance_ = 0.25 * each_ms_ * each_ms_;
    covariance_ = 0.0;
    return true;
  }
  const double expected = fixed_ms_ + x * each_ms_;
  fixed_variance_ += std::pow(kFixedDrift * expected, 2);
  each_variance_ += std::pow(kEachDrift * each_ms_, 2);
  const double noise = std::pow(scatter_ * expected, 2);
  const auto variance = [&] { return fixed_variance_ + 2.0 * x * covariance_ + x * x * each_variance_ + noise; };
  const double off = ms - expected;
  if (off * off > kSurprising * kSurprising * variance()) {
    if (++surprises_ < 2) return false;
    // Either the view has changed, and what a pixel costs is open again, or the last move was based on a wrong share of
    // what is fixed.
    each_variance_ += std::pow(off / x, 2);
    if (moved_) fixed_variance_ += off * off;
  } else {
    surprises_ = 0;
    // The mean of |off| of a normal distribution is 0.8 standard deviations.
    scatter_ = kScatterMemory * scatter_ + (1.0 - kScatterMemory) * 1.25 * std::abs(off) / expected;
    scatter_ = std::max(scatter_, kMinScatter);
  }
  const double total = variance();
  const double fixed_gain = (fixed_variance_ + x * covariance_) / total;
  const double each_gain = (covariance_ + x * each_variance_) / total;
  fixed_ms_ = std::max(fixed_ms_ + fixed_gain * off, 0.0);
  each_ms_ = std::max(each_ms_ + each_gain * off, 0.0);
  const double old_covariance = covariance_;
  const double old_fixed = fixed_variance_;
  fixed_variance_ -= fixed_gain * (old_fixed + x * old_covariance);
  covariance_ -= fixed_gain * (old_covariance + x * each_variance_);
  each_variance_ -= each_gain * (old_covariance + x * each_variance_);
  moved_ = false;
  return true;
}

void FrameBudget::update_degradation() {
  const int now = ladder_[rung_].degradations;
  if (now == degradations_before_ || each_before_ <= 0.0 || ++frames_since_ != kFramesToTrust) return;
  const int low = std::min(now, degradations_before_);
  const int high = std::max(now, degradations_before_);
  const double all = now > degradations_before_ ? each_ms_ / each_before_ : each_before_ / std::max(each_ms_, 1e-9);
  // Of several at once nobody knows which saved how much.
  const double one = std::clamp(std::pow(all, 1.0 / (high - low)), 0.1, 1.0);
  std::fill(ratios_.begin() + low, ratios_.begin() + high, one);
}

std::size_t FrameBudget::best_within(double ms) const {
  const double limit = std::max(ms, kNotWorthSaving * predict(ladder_.size() - 1));
  for (std::size_t rung = 0; rung < ladder_.size(); ++rung) {
    if (predict(rung) <= limit) return rung;
  }
  return ladder_.size() - 1;
}

void FrameBudget::move_to(std::size_t rung) {
  const int before = ladder_[rung_].degradations;
  const int after = ladder_[rung].degradations;
  if (after != before) {
    degradations_before_ = before;
    each_before_ = each_ms_;
    frames_since_ = 0;
    each_ms_ *= degradation_ratio(before, after);
    each_variance_ += 0.25 * each_ms_ * each_ms_;
    covariance_ = 0.0;
  }
  rung_ = rung;
  moved_ = true;
}

void FrameBudget::choose() {
  const double aim = settings_.target_ms * std::clamp(kTail * std::exp(-kTailDeviations * scatter_), kMinAim, kMaxAim);
  const std::size_t lower = best_within(aim);
  if (lower > rung_ && predict(rung_) > kTooSlow * aim) {
    move_to(lower);
    return;
  }
  const std::size_t higher = best_within(kRoomToRise * aim);
  const std::size_t up = rung_ - std::min(rung_, kRungsUpAtOnce);
  if (higher < rung_) {
    move_to(std::max(higher, up));
  } else if (predict(ladder_.size() - 1) > aim && ++frames_out_of_reach_ % kFramesToProbe == 0) {
    move_to(up);
  }
}

void FrameBudget::record_frame_time(double ms) {
  if (!(ms > 0.0) || !std::isfinite(ms)) return;
  if (!update_model(ms)) return;
  update_degradation();
  choose();
}

namespace {

constexpr const char* kHalfResolution = "half-resolution";
constexpr const char* kNoPhotons = "photons";
constexpr const char* kLessGlossy = "glossy-cutoff";

constexpr double kCheapCutoff = 0.1;
constexpr int kCheapDepth = 2;

/// Whether it brings light that surfaces scattered on to others.
bool is_indirect(const PassInfo& pass) {
  return pass.component == Component::Photon;
}

}  // namespace

std::vector<std::string> degradations_for(const FrameSettings& settings, std::span<const PassPlan> passes,
                                          bool on_device) {
  std::vector<std::string> names;
  if (settings.rays.reference) return names;
  const bool shares_otherwise = settings.rays.denoise || runs_pass(passes, [](const PassInfo& pass) {
                                  return pass.half_resolution.components == 0;
                                });
  if (settings.shading == Shading::Deferred && !shares_otherwise && !on_device) names.emplace_back(kHalfResolution);
  if (runs_pass(passes, is_indirect)) names.emplace_back(kNoPhotons);
  const bool costly = settings.rays.glossy_cutoff > kCheapCutoff || settings.rays.max_depth > kCheapDepth;
  if (costly && runs_pass(passes, [](const PassInfo& pass) { return pass.lobe.has_value(); })) {
    names.emplace_back(kLessGlossy);
  }
  return names;
}

FrameSettings apply_degradations(FrameSettings settings, std::span<const std::string> degradations) {
  RaySettings& rays = settings.rays;
  for (const std::string& name : degradations) {
    if (name == kHalfResolution) {
      rays.half_resolution = half_resolution_passes();
    } else if (name == kNoPhotons) {
      rays.photons = 0;
      rays.global_photons = false;
      const std::size_t given_up = std::erase_if(rays.passes, [](PassId pass) { return is_indirect(info_of(pass)); });
      if (given_up > 0 && rays.passes.empty()) rays.auto_passes = false;
    } else {
      HPR_CHECK(name == kLessGlossy);
      rays.glossy_cutoff = std::min(rays.glossy_cutoff, kCheapCutoff);
      rays.max_depth = std::min(rays.max_depth, kCheapDepth);
    }
  }
  return settings;
}

}  // namespace hpr
