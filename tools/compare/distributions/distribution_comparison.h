#pragma once

#include <string>
#include <vector>

#include "app/options/globals.h"
#include "core/error.h"
#include "tools/compare/compare_options.h"
#include "tools/compare/distributions/measure_distribution.h"

namespace hpr {

/// The distributions that a list names, each once: names of kDistributions, kAutoDistribution, or "all" of them
/// that the input's settings do not exclude. Throws Error (Usage) for unknown names, with the choices and the nearest
/// one, and where settings exclude one that is named, or all.
[[nodiscard]] std::vector<std::string> distributions_in(const std::string& list, const DistributionInput& input);

/// `hpr compare SCENE --distribute LIST`: whole frames of every distribution on every number of ranks, in jobs of this
/// program, each of which draws a part of the frames of one of them; inside an MPI job by its ranks, one distribution
/// after the other. Every frame is checked against the picture of one rank, inside an MPI job of the first
/// distribution.
[[nodiscard]] ExitCode compare_distributions(const Globals& globals, CompareOptions& options);

}  // namespace hpr
