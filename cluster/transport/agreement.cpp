#include "cluster/transport/agreement.h"

#include <cstdint>
#include <cstring>
#include <new>
#include <optional>
#include <span>
#include <string>

#include "cluster/transport/collectives.h"
#include "core/error.h"

namespace hpr {
namespace {

void put(std::vector<std::byte>& bytes, const std::string& text) {
  const std::uint64_t size = text.size();
  const auto header = std::as_bytes(std::span(&size, 1));
  bytes.insert(bytes.end(), header.begin(), header.end());
  const auto body = std::as_bytes(std::span(text));
  bytes.insert(bytes.end(), body.begin(), body.end());
}

std::string take_text(std::span<const std::byte>& bytes) {
  std::uint64_t size = 0;
  std::memcpy(&size, bytes.data(), sizeof size);
  std::string text(reinterpret_cast<const char*>(bytes.data() + sizeof size), size);
  bytes = bytes.subspan(sizeof size + size);
  return text;
}

/// A failure as bytes: a code (0: none), then three texts.
std::vector<std::byte> pack(const std::optional<Error>& error) {
  std::vector<std::byte> bytes{static_cast<std::byte>(error ? static_cast<int>(error->code()) : 0)};
  if (!error) return bytes;
  put(bytes, error->what());
  put(bytes, error->hint());
  put(bytes, error->line());
  return bytes;
}

void throw_if_packed(std::span<const std::byte> bytes) {
  const auto code = static_cast<ExitCode>(bytes.front());
  if (code == ExitCode::Done) return;
  bytes = bytes.subspan(1);
  const std::string what = take_text(bytes);
  const std::string hint = take_text(bytes);
  throw Error(code, what, hint, take_text(bytes));
}

template <typename Work>
std::optional<Error> failure_of(const Work& work) {
  try {
    work();
  } catch (const Error& error) {
    return error;
  } catch (const std::bad_alloc&) {
    return Error(ExitCode::Limit, "out of memory", "use more ranks or a smaller scene, or raise --limit-mem");
  } catch (const std::exception& error) {
    return Error(ExitCode::Internal, error.what());
  }
  return std::nullopt;
}

}  // namespace

std::vector<std::byte> on_root(Communicator& comm, const std::function<std::vector<std::byte>()>& work) {
  std::vector<std::byte> result;
  std::vector<std::byte> verdict;
  if (comm.rank() == 0) verdict = pack(failure_of([&] { result = work(); }));
  broadcast(comm, verdict);
  throw_if_packed(verdict);
  broadcast(comm, result);
  return result;
}

void check_on_root(Communicator& comm, const std::function<void()>& check) {
  (void)on_root(comm, [&] {
    check();
    return std::vector<std::byte>{};
  });
}

void agree_on_failure(Communicator& comm, const std::function<void()>& work) {
  for (const auto& verdict : all_gather(comm, pack(failure_of(work)))) throw_if_packed(verdict);
}

}  // namespace hpr
