#include "tools/report/plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace hpr {
namespace {

constexpr Stroke kGridStroke{"#dddddd", 1.0};
constexpr Stroke kAxisStroke{"#444444", 1.0};

}  // namespace

const SeriesStyle& series_style(std::size_t index) {
  static constexpr std::array<SeriesStyle, 10> kStyles{{{"#332288", ""},
                                                        {"#117733", "7 3"},
                                                        {"#CC6677", ""},
                                                        {"#2F9C8E", "2 3"},
                                                        {"#882255", "7 3"},
                                                        {"#8A8A20", "9 3 2 3"},
                                                        {"#AA4499", ""},
                                                        {"#3E8FC0", "7 3"},
                                                        {"#555555", "9 3 2 3"},
                                                        {"#B5651D", "2 3"}}};
  return kStyles.at(index % kStyles.size());
}

LogScale LogScale::of(std::vector<double> values, double from, double to) {
  std::ranges::sort(values);
  const double low = values.front();
  const double high = values.back();
  const double room = std::max(1.12, std::pow(high / low, 0.04));
  return {low / room, high * room, from, to};
}

std::vector<double> LogScale::close_values() const {
  std::vector<double> close;
  const int last = static_cast<int>(std::floor(low_ + span_));
  for (int power = static_cast<int>(std::floor(low_)); power <= last; ++power) {
    for (int tenths = 10; tenths < 100; tenths += tenths < 50 ? 5 : 10) {
      const double value = 0.1 * tenths * std::pow(10.0, power);
      if (std::log10(value) >= low_ && std::log10(value) <= low_ + span_) close.push_back(value);
    }
  }
  return close;
}

std::vector<double> LogScale::round_values() const {
  constexpr double kNarrow = 0.8;  // of a power of ten: every digit counts, and halves of the smaller ones
  if (span_ < kNarrow) {
    std::vector<double> close = close_values();
    if (close.size() > 1) return close;
  }
  constexpr double kMaxPowers = 12.0;
  const int stride = std::max(1, static_cast<int>(std::ceil(span_ / kMaxPowers)));
  std::vector<double> found;
  for (int power = static_cast<int>(std::floor(low_)); power <= static_cast<int>(low_ + span_) + 1; ++power) {
    if (power % stride != 0) continue;
    for (const double digit : {1.0, 2.0, 5.0}) {
      if (span_ > 4.0 && digit > 1.0) continue;
      const double log = power + std::log10(digit);
      if (log >= low_ - 1e-9 && log <= low_ + span_ + 1e-9) found.push_back(digit * std::pow(10.0, power));
    }
  }
  return found;
}

std::vector<Tick> LogScale::ticks() const {
  std::vector<Tick> ticks;
  for (const double value : round_values()) ticks.push_back({at(value), fmt::format("{:g}", value)});
  return ticks;
}

void Plot::draw_x_ticks(std::span<const Tick> ticks) {
  for (const Tick& tick : ticks) {
    canvas_.line({tick.position, layout_.top}, {tick.position, layout_.bottom}, kGridStroke);
    if (!tick.label.empty()) canvas_.text({tick.position, layout_.bottom + 18}, tick.label, Anchor::Middle);
  }
}

void Plot::draw_y_ticks(std::span<const Tick> ticks) {
  for (const Tick& tick : ticks) {
    canvas_.line({layout_.left, tick.position}, {layout_.right, tick.position}, kGridStroke);
    if (!tick.label.empty()) canvas_.text({layout_.left - 8, tick.position + 4}, tick.label, Anchor::End);
  }
}

void Plot::draw_axis_lines() {
  canvas_.line({layout_.left, layout_.top}, {layout_.left, layout_.bottom}, kAxisStroke);
  canvas_.line({layout_.left, layout_.bottom}, {layout_.right, layout_.bottom}, kAxisStroke);
}

void Plot::name_x_axis(std::string_view name) {
  canvas_.text({(layout_.left + layout_.right) / 2, layout_.bottom + layout_.x_name_below}, name, Anchor::Middle, 13);
}

void Plot::name_y_axis(std::string_view name) {
  canvas_.upright_text({layout_.y_name_at, (layout_.top + layout_.bottom) / 2}, name, 13);
}

}  // namespace hpr
