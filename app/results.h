#pragma once

#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "app/options/globals.h"
#include "cluster/transport/communicator.h"
#include "core/error.h"
#include "engine/output.h"
#include "scene/load_scene.h"

/// Where results go, and what they must not replace.
namespace hpr {

/// `text` to the file `path`, or to standard output where that is empty. Throws Error where the file is there and
/// `overwrite` is false, or cannot be written.
void write_or_print(std::string_view text, const std::string& path, bool overwrite);

/// Throws Error (Usage) when two of these paths of results, or one and `trace`, are one file. Empty ones are none.
void check_distinct(std::span<const std::string> paths, const std::string& trace);

/// Throws Error (Usage) where a result would take the place of a file that is read: one of the scene's, or of `inputs`.
void check_spared(const std::string& scene, const SceneLimits& limits, std::span<const std::string> inputs,
                  std::span<const std::string> results);

/// Writes schema hpr.stats/1. Throws Error (Io).
void write_stats(const std::filesystem::path& path, const RunStats& stats);

/// Before any work: throws Error (Io) where globals.trace cannot be written or exists (without --force or --resume),
/// and (Usage) where it holds something else than a trace, which none shall replace.
void check_trace(const Globals& globals);

/// Collective: does `body` and writes what all ranks did meanwhile to globals.trace, if that is set, in Chrome's trace
/// event format (as chrome://tracing, Perfetto and Speedscope read it): one process per rank, one row per thread,
/// microseconds since a barrier. Clocks of other hosts are set by that barrier, to within its messages' time.
/// Throws Error (Io), (Usage) where `body` wrote that file, and what `body` does; then nothing is written.
ExitCode traced(Communicator& comm, const Globals& globals, const std::function<ExitCode(Communicator&)>& body);

/// Runs the body of a command that has no job of ranks, and writes the trace of this process alone.
ExitCode traced_alone(const Globals& globals, const std::function<ExitCode()>& body);

/// Prints an error on stderr in at most three lines: what and where, the offending line where there is one, a hint.
/// Throws std::bad_alloc.
void print_error(const Error& error, std::string_view who = "");

}  // namespace hpr
