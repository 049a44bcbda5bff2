#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "app/options/globals.h"

namespace hpr {

/// Which side of its limit a measured number must stay on.
enum class Bound { AtMost, AtLeast };

/// How the measured number goes with the parameter, for the plot.
struct StabilityCurve {
  std::string x;                                    ///< what runs along the axis, with its unit
  std::vector<std::pair<double, double>> points;    ///< (parameter, measured), ascending
  std::vector<std::pair<double, double>> expected;  ///< by the derivation in docs/numerics.md; may be empty
};

/// One number about one extreme. `limit` is what HPR promises and docs/numerics.md derives; `breaks_at` where along the
/// parameter the promise ends, found by bisection beyond the promised range or, where it is broken within, by
/// breaking_point_of_curve(); nothing if it held as far as was tried.
struct StabilityFinding {
  std::string name;       ///< "depth-order/reversed-z": the case, and which of its numbers
  std::string parameter;  ///< what was varied, and how far: "relative gap 1e-2 .. 1e-7 at 1e-3 .. 1e7 m"
  double limit = 0.0;
  double measured = 0.0;  ///< the worst within what is promised; never NaN (a NaN is the worst there is: infinity)
  std::string unit;       ///< "share of pixels", "relative", "levels of 255", "1" for plain counts
  Bound bound = Bound::AtMost;
  std::optional<double> breaks_at;
  std::string why = {};  ///< one sentence: where the limit comes from
  StabilityCurve curve = {};

  [[nodiscard]] bool holds() const { return is_within(measured); }
  [[nodiscard]] bool is_within(double value) const { return bound == Bound::AtMost ? value <= limit : value >= limit; }
};

/// One extreme. Its file in tools/stability/ defines stability::NAME_case(), and the list in stability.cpp names it.
struct StabilityCase {
  std::string_view name;   ///< kebab-case
  std::string_view about;  ///< one line: what is driven to its extreme, and what must not move
  std::function<std::vector<StabilityFinding>(const Globals& globals)> measure;
};

/// Every case, in the order of the report.
[[nodiscard]] std::span<const StabilityCase> all_stability_cases();

/// The parameter at which `holds` turns from true to false, between `good` (known to hold) and `bad` (known not to;
/// either side may be the larger; both of one sign, not 0): bisected on a logarithmic scale until the ends are within
/// `relative` of each other. Returns the end that does not hold. `holds` is called about log2(log(bad / good) /
/// relative) times.
[[nodiscard]] double breaking_point(double good, double bad, double relative, const std::function<bool(double)>& holds);

/// The first breaking point between `good` and `bad`, by decades and then by breaking_point(); nullopt where `good`
/// does not hold, or all decades and `bad` do.
[[nodiscard]] std::optional<double> breaking_point_if_any(double good, double bad, double relative,
                                                          const std::function<bool(double)>& holds);

/// Where no breaking point was looked for beyond what is promised, or the promise is broken: the point of the curve
/// that is past the limit beside one that is not, the first in the curve's order, or its first point where all are.
[[nodiscard]] std::optional<double> breaking_point_of_curve(const StabilityFinding& finding);

/// Schema hpr.stability/1.
[[nodiscard]] std::string stability_json(std::span<const StabilityFinding> findings);
/// A table for people.
[[nodiscard]] std::string stability_table(std::span<const StabilityFinding> findings);
/// The report as one HTML page with a plot for each curve.
[[nodiscard]] std::string stability_html(std::span<const StabilityFinding> findings);

}  // namespace hpr
