#include "core/temporary.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <string>
#include <system_error>
#include <utility>

#include "core/error.h"
#include "core/names.h"

namespace hpr {
namespace {

constexpr const char* kVariable = "TMPDIR";

/// None where it is not set, or empty.
const char* named_folder() {
  const char* const folder = std::getenv(kVariable);  // NOLINT(concurrency-mt-unsafe): nobody writes the environment
  return folder != nullptr && *folder != '\0' ? folder : nullptr;
}

int create_in(const std::filesystem::path& folder) {
  int file = ::open(folder.c_str(), O_RDWR | O_TMPFILE | O_CLOEXEC, 0600);
  if (file >= 0) return file;
  // Not every file system has files that never had a name.
  std::string name = (folder / "hpr-XXXXXX").string();
  file = ::mkostemp(name.data(), O_CLOEXEC);
  if (file >= 0) ::unlink(name.c_str());
  return file;
}

}  // namespace

std::filesystem::path temporary_folder() {
  const char* const named = named_folder();
  return named == nullptr ? "/tmp" : named;
}

TemporaryFile::TemporaryFile() : descriptor_(create_in(temporary_folder())) {
  if (descriptor_ < 0) {
    throw Error(ExitCode::Io,
                fmt::format("cannot write temporary files in '{}'{}: {}", printable(temporary_folder().string(), 300),
                            named_folder() == nullptr ? "" : fmt::format(", which {} names", kVariable),
                            std::generic_category().message(errno)),
                fmt::format("set {} to a folder that can be written", kVariable));
  }
  path_ = fmt::format("/proc/{}/fd/{}", ::getpid(), descriptor_);
}

TemporaryFile::~TemporaryFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

TemporaryFile::TemporaryFile(TemporaryFile&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)), path_(std::move(other.path_)) {}

}  // namespace hpr
