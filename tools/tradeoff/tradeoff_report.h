#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tools/tradeoff/tradeoff.h"

namespace hpr {

/// "spp=4 photons=10000".
[[nodiscard]] std::string describe(const KnobValues& knobs);

/// The command line of `hpr render` that makes the picture of a point.
[[nodiscard]] std::string command_for(const TradeoffReport& report, const TradeoffPoint& point);

/// "within 33 ms the most accurate by flip is ...", or what would have to give. Empty without a budget.
[[nodiscard]] std::string answer(const TradeoffReport& report);

/// A table for people, the front marked with a star.
[[nodiscard]] std::string tradeoff_table(const TradeoffReport& report);
/// Schema hpr.tradeoff/1.
[[nodiscard]] std::string tradeoff_json(const TradeoffReport& report);
/// One line per point below a line of column names.
[[nodiscard]] std::string tradeoff_csv(const TradeoffReport& report);
/// The sweep as one HTML page: error over time by every metric, where the time goes, a part of every picture with what
/// is seen to be wrong in it, and the table. `report.points` is not empty.
[[nodiscard]] std::string tradeoff_html(const TradeoffReport& report);

/// The points measured by a sweep that was interrupted, as a file that `identity` names the sweep in.
[[nodiscard]] std::string encode_points(const std::string& identity, const std::vector<TradeoffPoint>& points);
/// The points that encode_points wrote. Throws Error (BadInput) when `text` holds none, or those of another sweep;
/// `name` is the file's in errors.
[[nodiscard]] std::vector<TradeoffPoint> decode_points(const std::string& text, const std::string& name,
                                                       const std::string& identity);

}  // namespace hpr
