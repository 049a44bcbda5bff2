#include "tools/stability/stability.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/json.h"

namespace hpr {
namespace {

/// JSON has no infinity: the largest number stands for it.
double finite(double value) {
  constexpr double kMost = std::numeric_limits<double>::max();
  return std::isnan(value) ? kMost : std::clamp(value, -kMost, kMost);
}

}  // namespace

double breaking_point(double good, double bad, double relative, const std::function<bool(double)>& holds) {
  HPR_CHECK(good * bad > 0.0 && relative > 0.0);
  const double sign = good < 0.0 ? -1.0 : 1.0;
  double inside = std::log(std::abs(good));
  double outside = std::log(std::abs(bad));
  while (std::abs(outside - inside) > std::log1p(relative)) {
    const double middle = 0.5 * (inside + outside);
    (holds(sign * std::exp(middle)) ? inside : outside) = middle;
  }
  return sign * std::exp(outside);
}

std::optional<double> breaking_point_if_any(double good, double bad, double relative,
                                            const std::function<bool(double)>& holds) {
  if (!holds(good) || holds(bad)) return std::nullopt;
  return breaking_point(good, bad, relative, holds);
}

std::string stability_json(std::span<const StabilityFinding> findings) {
  Json json{{"schema", "hpr.stability/1"}, {"cases", Json::array()}};
  for (const StabilityFinding& finding : findings) {
    json["cases"].push_back({{"name", finding.name},
                             {"parameter", finding.parameter},
                             {"limit", finite(finding.limit)},
                             {"measured", finite(finding.measured)},
                             {"unit", finding.unit},
                             {"bound", finding.bound == Bound::AtMost ? "at-most" : "at-least"},
                             {"verdict", finding.holds() ? "holds" : "breaks"},
                             {"breaks_at", finding.breaks_at ? Json(finite(*finding.breaks_at)) : Json()},
                             {"why", finding.why}});
  }
  return json.dump(2) + "\n";
}

std::string stability_table(std::span<const StabilityFinding> findings) {
  using Row = std::array<std::string, 7>;
  std::vector<Row> rows{{"case", "measured", "limit", "unit", "verdict", "breaks at", "parameter"}};
  for (const StabilityFinding& finding : findings) {
    rows.push_back({finding.name, fmt::format("{:.4g}", finding.measured),
                    fmt::format("{} {:.4g}", finding.bound == Bound::AtMost ? "<=" : ">=", finding.limit), finding.unit,
                    finding.holds() ? "holds" : "BREAKS",
                    finding.breaks_at ? fmt::format("{:.3g}", *finding.breaks_at) : "-", finding.parameter});
  }
  std::array<std::size_t, 7> widths{};
  for (const Row& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) widths.at(i) = std::max(widths.at(i), row.at(i).size());
  }
  std::string text;
  for (const Row& row : rows) {
    for (std::size_t i = 0; i + 1 < row.size(); ++i) text += fmt::format("{:<{}}  ", row.at(i), widths.at(i));
    text += row.back() + "\n";
  }
  const auto broken = std::ranges::count_if(findings, [](const StabilityFinding& f) { return !f.holds(); });
  return text + fmt::format("{} of {} hold\n", findings.size() - static_cast<std::size_t>(broken), findings.size());
}

}  // namespace hpr
