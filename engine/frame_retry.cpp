#include "engine/frame_retry.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cluster/transport/collectives.h"
#include "core/log.h"

namespace hpr {
namespace {

bool may_be_about_a_frame(ExitCode code) {
  return code == ExitCode::Internal || code == ExitCode::NoDevice || code == ExitCode::Limit ||
         code == ExitCode::CheckFailed;
}

std::optional<Error> failure_of(Communicator& comm, const std::function<void()>& draw) {
  try {
    if (comm.size() > 1) {
      draw();
    } else {
      agree_on_failure(comm, draw);
    }
  } catch (const AgreedError& error) {
    if (!may_be_about_a_frame(error.code())) throw;
    return error;
  }
  return std::nullopt;
}

}  // namespace

std::optional<Error> draw_with_retry(Communicator& comm, const std::string& what, const std::function<void()>& draw) {
  const std::optional<Error> failure = failure_of(comm, draw);
  if (!failure) return std::nullopt;
  if (comm.rank() == 0) log::warning("{}: {}; drawing it once more", what, failure->what());
  return failure_of(comm, draw);
}

void FailedFrames::add_failed(std::uint64_t frame) {
  constexpr std::size_t kMaxNames = 10;
  if (first_.size() < kMaxNames) first_.push_back(frame);
  ++count_;
  ++in_a_row_;
}

std::string FailedFrames::describe() const {
  std::string text = fmt::format("{} frame{} failed: {}", count_, count_ == 1 ? "" : "s", fmt::join(first_, ", "));
  if (count_ > first_.size()) text += fmt::format(" and {} more", count_ - first_.size());
  return text;
}

}  // namespace hpr
