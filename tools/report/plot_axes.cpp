#include "tools/report/plot_axes.h"

#include <algorithm>
#include <array>

namespace hpr {

const SeriesLook& series_look(std::size_t index) {
  static constexpr std::array<SeriesLook, 10> kLooks{{{"#332288", ""},
                                                      {"#117733", "7 3"},
                                                      {"#CC6677", ""},
                                                      {"#2F9C8E", "2 3"},
                                                      {"#882255", "7 3"},
                                                      {"#8A8A20", "9 3 2 3"},
                                                      {"#AA4499", ""},
                                                      {"#3E8FC0", "7 3"},
                                                      {"#555555", "9 3 2 3"},
                                                      {"#B5651D", "2 3"}}};
  return kLooks.at(index % kLooks.size());
}

LogScale LogScale::of(std::vector<double> values, double from, double to) {
  std::ranges::sort(values);
  const double least = values.front();
  const double most = values.back();
  const double room = std::max(1.12, std::pow(most / least, 0.04));
  return {least / room, most * room, from, to};
}

std::vector<double> LogScale::close_ticks() const {
  std::vector<double> close;
  const int last = static_cast<int>(std::floor(least_ + span_));
  for (int power = static_cast<int>(std::floor(least_)); power <= last; ++power) {
    for (int tenths = 10; tenths < 100; tenths += tenths < 50 ? 5 : 10) {
      const double value = 0.1 * tenths * std::pow(10.0, power);
      if (std::log10(value) >= least_ && std::log10(value) <= least_ + span_) close.push_back(value);
    }
  }
  return close;
}

std::vector<double> LogScale::ticks() const {
  constexpr double kNarrow = 0.8;  // of a power of ten: every digit counts, and halves of the smaller ones
  if (span_ < kNarrow) {
    std::vector<double> close = close_ticks();
    if (close.size() > 1) return close;
  }
  constexpr double kMostPowers = 12.0;
  const int stride = std::max(1, static_cast<int>(std::ceil(span_ / kMostPowers)));
  std::vector<double> found;
  for (int power = static_cast<int>(std::floor(least_)); power <= static_cast<int>(least_ + span_) + 1; ++power) {
    if (power % stride != 0) continue;
    for (const double digit : {1.0, 2.0, 5.0}) {
      if (span_ > 4.0 && digit > 1.0) continue;
      const double log = power + std::log10(digit);
      if (log >= least_ - 1e-9 && log <= least_ + span_ + 1e-9) found.push_back(digit * std::pow(10.0, power));
    }
  }
  return found;
}

}  // namespace hpr
