#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tools/tradeoff/tradeoff.h"

namespace hpr {

/// "spp=4 photons=10000".
[[nodiscard]] std::string describe(const KnobValues& knobs);

/// What makes the pictures of `best`: a command line of `hpr render`.
[[nodiscard]] std::string command_for(const TradeoffReport& report, const TradeoffPoint& point);

/// "within 33 ms the most accurate by flip is ...", or what would have to give. Empty without a budget.
[[nodiscard]] std::string answer(const TradeoffReport& report);

/// As a table for people, the front marked with a star; as schema hpr.tradeoff/1; one line per point.
[[nodiscard]] std::string tradeoff_table(const TradeoffReport& report);
[[nodiscard]] std::string tradeoff_json(const TradeoffReport& report);
[[nodiscard]] std::string tradeoff_csv(const TradeoffReport& report);

/// The points of a sweep that is not at its end, as a file that tells which sweep it is of.
[[nodiscard]] std::string encode_points(const std::string& identity, const std::vector<TradeoffPoint>& points);
/// Throws Error (BadInput) when `text` is none, or of another sweep; `name` stands in errors.
[[nodiscard]] std::vector<TradeoffPoint> decode_points(const std::string& text, const std::string& name,
                                                       const std::string& identity);

}  // namespace hpr
