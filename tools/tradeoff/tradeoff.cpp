#include "tools/tradeoff/tradeoff.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>

#include "core/error.h"
#include "core/text.h"
#include "engine/settings_table.h"
#include "tools/sweep.h"

namespace hpr {
namespace {

std::optional<double> number_in(const std::string& text) {
  double value = 0.0;
  const char* const end = text.data() + text.size();
  const auto [stopped, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || stopped != end || !std::isfinite(value)) return std::nullopt;
  return value;
}

/// A line through points, and how sure its slope is.
KnobSlope fit(std::span<const std::pair<double, double>> points) {
  const auto n = static_cast<double>(points.size());
  double mean_x = 0.0;
  double mean_y = 0.0;
  for (const auto& [x, y] : points) {
    mean_x += x / n;
    mean_y += y / n;
  }
  double xx = 0.0;
  double xy = 0.0;
  double yy = 0.0;
  for (const auto& [x, y] : points) {
    xx += (x - mean_x) * (x - mean_x);
    xy += (x - mean_x) * (y - mean_y);
    yy += (y - mean_y) * (y - mean_y);
  }
  KnobSlope line;
  line.points = points.size();
  line.slope = xy / xx;
  if (points.size() > 2) line.spread = std::sqrt(std::max(yy - xy * xy / xx, 0.0) / (n - 2.0) / xx);
  return line;
}

}  // namespace

KnobSweep parse_knob_sweep(const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos) {
    throw Error(ExitCode::Usage, fmt::format("--vary {}: no values", printable(text)), "write e.g. --vary spp=1,4,16");
  }
  KnobSweep sweep{std::string(find_tradeoff_setting(text.substr(0, equals)).name), {}};
  for (std::string& value : split_commas(std::string_view(text).substr(equals + 1))) {
    if (value.empty()) {
      throw Error(ExitCode::Usage, fmt::format("--vary {}: an empty value", printable(text)),
                  "write e.g. --vary spp=1,4,16; lists within a value take + between their words");
    }
    if (std::ranges::find(sweep.values, value) != sweep.values.end()) {
      throw Error(ExitCode::Usage, fmt::format("--vary {}: '{}' stands there twice", printable(text), printable(value)),
                  "name each value once");
    }
    sweep.values.push_back(std::move(value));
  }
  return sweep;
}

std::vector<KnobValues> combinations(std::span<const KnobSweep> sweeps) {
  std::vector<KnobValues> all(1);
  for (const KnobSweep& sweep : sweeps) {
    std::vector<KnobValues> longer;
    for (const KnobValues& chosen : all) {
      const auto has = [&](const auto& pair) { return pair.first == sweep.knob; };
      if (std::ranges::any_of(chosen, has)) {
        throw Error(ExitCode::Usage, fmt::format("--vary {}: this knob is varied twice", sweep.knob),
                    "put all its values into one list");
      }
      for (const std::string& value : sweep.values) {
        longer.push_back(chosen);
        longer.back().emplace_back(sweep.knob, value);
      }
    }
    all = std::move(longer);
  }
  return all;
}

RenderSettings with_knobs(const RenderSettings& base, const KnobValues& values) {
  RenderSettings settings = base;
  for (const auto& [knob, value] : values) {
    std::string written = value;
    std::ranges::replace(written, '+', ',');
    const Setting& setting = find_tradeoff_setting(knob);
    try {
      set_setting(settings, knob, written);
    } catch (const Error& error) {
      throw Error(ExitCode::Usage, fmt::format("--vary {}={}: {}", knob, printable(value), error.what()),
                  fmt::format("it takes {}", setting.value.takes));
    }
  }
  return settings;
}

const std::vector<std::string>& tradeoff_metrics() {
  static const std::vector<std::string> names{"relmse", "rmse", "psnr", "ssim", "flip"};
  return names;
}

double PictureError::of(const std::string& metric) const {
  if (metric == "relmse") return relmse;
  if (metric == "rmse") return rmse;
  if (metric == "psnr") return psnr;
  if (metric == "ssim") return ssim;
  if (metric == "flip") return flip;
  throw Error(ExitCode::Usage, fmt::format("there is no metric '{}'", printable(metric)),
              unknown_name_hint(metric, tradeoff_metrics()));
}

double badness(const std::string& metric, double value) {
  if (metric == "ssim") return 1.0 - value;
  if (metric == "psnr") return std::pow(10.0, -value / 20.0);
  return value;
}

double TradeoffPoint::median_ms() const {
  return median(ms);
}

void mark_pareto(std::span<TradeoffPoint> points, const std::string& metric) {
  const auto error_of = [&](const TradeoffPoint& point) { return badness(metric, point.error.of(metric)); };
  for (TradeoffPoint& point : points) {
    const double ms = point.median_ms();
    const double error = error_of(point);
    point.pareto = !std::isnan(error) && std::ranges::none_of(points, [&](const TradeoffPoint& other) {
      const double other_ms = other.median_ms();
      const double other_error = error_of(other);
      return other_ms <= ms && other_error <= error && (other_ms < ms || other_error < error);
    });
  }
}

TradeoffBudget parse_budget(const std::string& text) {
  const std::string hint = "write a time, e.g. 33ms, or an error, e.g. flip=0.05 or psnr=40";
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos) {
    const auto time = parse_duration(text);
    if (!time || time->count() <= 0) {
      throw Error(ExitCode::Usage, fmt::format("--budget: '{}' is no time", printable(text)), hint);
    }
    return {std::chrono::duration<double, std::milli>(*time).count()};
  }
  TradeoffBudget budget{{}, text.substr(0, equals), 0.0};
  (void)PictureError{}.of(budget.metric);  // throws for unknown ones
  const auto error = number_in(text.substr(equals + 1));
  if (!error || *error < 0.0) {
    throw Error(ExitCode::Usage, fmt::format("--budget: '{}' is no error", printable(text)), hint);
  }
  budget.error = *error;
  return budget;
}

std::optional<std::size_t> best_within(std::span<const TradeoffPoint> points, const TradeoffBudget& budget,
                                       const std::string& metric) {
  std::optional<std::size_t> best;
  std::pair<double, double> best_value;  // of what is asked for, and of two alike the other
  for (std::size_t i = 0; i < points.size(); ++i) {
    const TradeoffPoint& point = points[i];
    const std::string& judged = budget.ms ? metric : budget.metric;
    const double error = badness(judged, point.error.of(judged));
    const bool within =
        budget.ms ? point.median_ms() <= *budget.ms && !std::isnan(error) : error <= badness(judged, budget.error);
    const auto value =
        budget.ms ? std::pair(error, point.median_ms()) : std::pair(point.median_ms(), std::isnan(error) ? 0.0 : error);
    if (within && (!best || value < best_value)) {
      best = i;
      best_value = value;
    }
  }
  return best;
}

std::vector<KnobSlope> knob_slopes(std::span<const TradeoffPoint> points, std::span<const std::string> metrics) {
  std::vector<KnobSlope> slopes;
  if (points.empty()) return slopes;
  for (std::size_t knob = 0; knob < points.front().knobs.size(); ++knob) {
    for (const std::string& metric : metrics) {
      std::map<KnobValues, std::vector<std::pair<double, double>>> lines;
      for (const TradeoffPoint& point : points) {
        const auto value = number_in(point.knobs[knob].second);
        const double error = badness(metric, point.error.of(metric));
        if (!value || !(*value > 0.0) || !(error > 0.0) || !std::isfinite(error)) continue;
        KnobValues others = point.knobs;
        others.erase(others.begin() + static_cast<std::ptrdiff_t>(knob));
        lines[others].emplace_back(std::log(*value), std::log(error));
      }
      for (const auto& [others, line] : lines) {
        if (line.size() < 2) continue;
        KnobSlope slope = fit(line);
        slope.knob = points.front().knobs[knob].first;
        slope.others = others;
        slope.metric = metric;
        slopes.push_back(std::move(slope));
      }
    }
  }
  return slopes;
}

}  // namespace hpr
