#pragma once

#include <filesystem>

#include "engine/output.h"

namespace hpr {

/// Writes schema hpr.stats/1. Throws Error (Io).
void write_stats(const std::filesystem::path& path, const RunStats& stats);

}  // namespace hpr
