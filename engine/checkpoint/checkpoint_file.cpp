#include "engine/checkpoint/checkpoint_file.h"

#include <fmt/format.h>

#include <limits>
#include <system_error>
#include <utility>

#include "core/error.h"
#include "core/file.h"
#include "core/log.h"
#include "engine/samples.h"

namespace hpr {
namespace {

std::vector<std::byte> read_whole(const std::filesystem::path& path) {
  std::vector<std::byte> bytes = read_file(path, std::numeric_limits<std::uint64_t>::max());
  check_whole(bytes, path.string());
  return bytes;
}

bool is_there(const std::filesystem::path& path) {
  std::error_code error;
  return std::filesystem::exists(std::filesystem::symlink_status(path, error));
}

Error both(const std::string& problem, const Error& of_previous) {
  return {ExitCode::BadInput, fmt::format("{}; {}", problem, of_previous.what()), of_previous.hint()};
}

}  // namespace

std::filesystem::path previous_checkpoint(const std::filesystem::path& path) {
  std::filesystem::path previous = written_file(path);
  previous += ".previous";
  return previous;
}

StoredCheckpoint read_checkpoint(const std::filesystem::path& path) {
  std::string problem;
  try {
    return {path, read_whole(path), {}};
  } catch (const DamagedCheckpoint& error) {
    if (!is_there(previous_checkpoint(path))) throw;
    problem = error.what();
  } catch (const Error& error) {
    if (error.code() != ExitCode::Io || !is_there(previous_checkpoint(path))) throw;
    problem = error.what();
  }
  const std::filesystem::path previous = previous_checkpoint(path);
  try {
    return {previous, read_whole(previous), problem};
  } catch (const Error& error) {
    throw both(problem, error);
  }
}

CheckpointFile::CheckpointFile(std::filesystem::path path, bool keeps_previous)
    : path_(std::move(path)), keeps_previous_(keeps_previous) {}

SampleProgress CheckpointFile::read(const RunIdentity& identity, Film& film) {
  const StoredCheckpoint stored = read_checkpoint(path_);
  try {
    const SampleProgress progress = decode_checkpoint(stored.bytes, stored.path.string(), identity, film);
    if (!stored.problem.empty()) log::warning("{}; going on from '{}'", stored.problem, stored.path.string());
    whole_ = stored.problem.empty();
    used_ = true;
    asked_for_ = asked_for_ || was_asked_for(stored.bytes, stored.path.string());
    return progress;
  } catch (const Error& error) {
    if (stored.problem.empty()) throw;
    throw both(stored.problem, error);
  }
}

void CheckpointFile::write(const RunIdentity& identity, Film& film, const SampleProgress& progress, bool asked_for) {
  asked_for_ = asked_for_ || asked_for;
  const std::vector<std::byte> bytes = encode_checkpoint(identity, film, progress, asked_for_);
  // What is not known to be whole takes the place of nothing that may be.
  const bool moves = keeps_previous_ && whole_;
  whole_ = false;
  write_file_atomically(path_, bytes, moves ? previous_checkpoint(path_) : std::filesystem::path());
  whole_ = true;
  used_ = true;
}

void CheckpointFile::remove_unasked() {
  if (!used_ || (asked_for_ && !whole_)) return;
  std::error_code error;
  if (!asked_for_) std::filesystem::remove(written_file(path_), error);
  std::filesystem::remove(previous_checkpoint(path_), error);
}

}  // namespace hpr
