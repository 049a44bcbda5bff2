#include "scene/gltf/uri.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/openat2.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <system_error>
#include <utility>

#include "core/error.h"
#include "core/text.h"

namespace hpr {
namespace {

constexpr std::string_view kHint = "a scene may only name files in its own folder and below";

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

[[noreturn]] void refuse(const std::string& what, std::string_view uri, std::string_view why) {
  throw Error(ExitCode::BadInput, fmt::format("{}: the URI '{}' {}", what, printable(uri), why), std::string(kHint));
}

/// A POSIX file descriptor that closes itself.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  Descriptor(Descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  [[nodiscard]] int get() const { return fd_; }

 private:
  int fd_;
};

/// Whether `text` starts with `prefix`, which is in small letters, in letters of any case.
bool starts_with_any_case(std::string_view text, std::string_view prefix) {
  const auto same = [](char letter, char small) {
    return (letter >= 'A' && letter <= 'Z' ? static_cast<char>(letter + ('a' - 'A')) : letter) == small;
  };
  return text.size() >= prefix.size() && std::ranges::equal(text.substr(0, prefix.size()), prefix, same);
}

constexpr int kFlags = O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY;

/// Opens component by component and follows no symbolic link: for kernels before 5.6 and sandboxes without openat2.
Descriptor open_without_links(int folder, const std::string& path) {
  Descriptor here(::dup(folder));
  std::size_t start = 0;
  while (here.get() >= 0) {
    const std::size_t slash = path.find('/', start);
    const std::string part = path.substr(start, slash - start);
    const bool last = slash == std::string::npos;
    here = Descriptor(::openat(here.get(), part.c_str(), kFlags | O_NOFOLLOW | (last ? 0 : O_DIRECTORY)));
    if (last) break;
    start = slash + 1;
  }
  return here;
}

Descriptor open_beneath(int folder, const std::string& path) {
  open_how how{};
  how.flags = static_cast<std::uint64_t>(kFlags);
  how.resolve = RESOLVE_BENEATH | RESOLVE_NO_MAGICLINKS;
  const long fd = ::syscall(SYS_openat2, folder, path.c_str(), &how, sizeof(how));
  if (fd < 0 && (errno == ENOSYS || errno == EPERM)) return open_without_links(folder, path);
  return Descriptor(static_cast<int>(fd));
}

/// Reads and never maps: a file that shrinks meanwhile is an error, not a signal.
std::vector<std::byte> read_all(const Descriptor& file, std::uint64_t size, const std::string& what) {
  std::vector<std::byte> bytes(size);
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t got = ::read(file.get(), bytes.data() + done, bytes.size() - done);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) {
      throw Error(ExitCode::Io, fmt::format("{}: the file could not be read to its end", what),
                  "try again when it is complete");
    }
    done += static_cast<std::size_t>(got);
  }
  return bytes;
}

}  // namespace

std::optional<std::string> percent_decoded(std::string_view text) {
  std::string decoded;
  decoded.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      decoded.push_back(text[i]);
      continue;
    }
    if (i + 2 >= text.size()) return std::nullopt;
    const int high = hex_digit(text[i + 1]);
    const int low = hex_digit(text[i + 2]);
    if (high < 0 || low < 0) return std::nullopt;
    decoded.push_back(static_cast<char>(high * 16 + low));
    i += 2;
  }
  return decoded;
}

std::optional<std::vector<std::byte>> base64_decoded(std::string_view text) {
  if (text.size() % 4 != 0) return std::nullopt;
  constexpr std::string_view kAlphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::array<std::int8_t, 256> digits{};
  digits.fill(-1);
  for (std::size_t i = 0; i < kAlphabet.size(); ++i) {
    digits[static_cast<unsigned char>(kAlphabet[i])] = static_cast<std::int8_t>(i);
  }

  std::size_t padding = 0;
  while (padding < 2 && padding < text.size() && text[text.size() - 1 - padding] == '=') ++padding;
  std::vector<std::byte> bytes;
  bytes.reserve(text.size() / 4 * 3);
  std::uint32_t bits = 0;
  unsigned count = 0;
  for (const char c : text.substr(0, text.size() - padding)) {
    const std::int8_t digit = digits[static_cast<unsigned char>(c)];
    if (digit < 0) return std::nullopt;
    bits = (bits << 6U) | static_cast<std::uint32_t>(digit);
    count += 6;
    if (count >= 8) {
      count -= 8;
      bytes.push_back(static_cast<std::byte>((bits >> count) & 0xFFU));
    }
  }
  if ((bits & ((1U << count) - 1U)) != 0) return std::nullopt;
  return bytes;
}

bool is_data_uri(std::string_view uri) {
  return starts_with_any_case(uri, "data:");
}

bool is_picture_uri(std::string_view uri) {
  return starts_with_any_case(uri, "data:image/");
}

std::vector<std::byte> data_uri_bytes(std::string_view uri, const std::string& what) {
  const auto fail = [&](std::string_view why) {
    throw Error(ExitCode::BadInput, fmt::format("{}: the data URI {}", what, why), "export the scene again");
  };
  const std::size_t comma = uri.find(',');
  if (comma == std::string_view::npos) fail("has no comma");
  std::string_view data = uri.substr(std::min(uri.size(), comma + 1));
  std::string unescaped;
  if (data.find('%') != std::string_view::npos) {
    auto text = percent_decoded(data);
    if (!text) fail("has a broken % escape");
    unescaped = *std::move(text);
    data = unescaped;
  }
  constexpr std::string_view kBase64 = ";base64";
  const std::string_view type = uri.substr(0, comma);
  if (type.size() >= kBase64.size() && starts_with_any_case(type.substr(type.size() - kBase64.size()), kBase64)) {
    auto bytes = base64_decoded(data);
    if (!bytes) fail("is no valid base64");
    return *std::move(bytes);
  }
  const auto bytes = std::as_bytes(std::span(data));
  return {bytes.begin(), bytes.end()};
}

std::string jailed_path(std::string_view uri, const std::string& what) {
  constexpr std::size_t kMaxUriBytes = 1024;
  if (uri.empty()) refuse(what, uri, "is empty");
  if (uri.size() > kMaxUriBytes) refuse(what, uri, "is longer than 1024 bytes");
  const auto decoded = percent_decoded(uri);
  if (!decoded) refuse(what, uri, "has a broken % escape");
  const std::string& path = *decoded;
  if (std::ranges::any_of(path, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; })) {
    refuse(what, uri, "holds a control character");
  }
  if (path.find('\\') != std::string::npos) refuse(what, uri, "holds a backslash");
  if (path.starts_with('/')) refuse(what, uri, "is an absolute path");
  if (uri.find(':') < uri.find('/')) refuse(what, uri, "names a scheme or drive");
  for (std::size_t start = 0; start <= path.size();) {
    const std::size_t end = std::min(path.find('/', start), path.size());
    if (const std::string_view part(path.data() + start, end - start); part == "..") {
      refuse(what, uri, "leaves the scene's folder");
    }
    start = end + 1;
  }
  return path;
}

FileBytes read_jailed(const std::filesystem::path& folder, std::string_view uri, const std::string& what,
                      std::uint64_t limit_bytes, bool mapped) {
  const std::string path = jailed_path(uri, what);
  const Descriptor root(::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  const Descriptor file = root.get() < 0 ? Descriptor(-1) : open_beneath(root.get(), path);
  if (file.get() < 0) {
    const int error = errno;
    if (error == EXDEV || error == ELOOP) refuse(what, uri, "leads out of the scene's folder through a link");
    throw Error(ExitCode::Io,
                fmt::format("{}: cannot read '{}': {}", what, printable(path), std::generic_category().message(error)),
                "put the file beside the scene, where the scene names it");
  }
  struct stat info {};
  if (::fstat(file.get(), &info) != 0 || !S_ISREG(info.st_mode)) {
    throw Error(ExitCode::Io, fmt::format("{}: cannot read '{}': not a regular file", what, printable(path)),
                "name a file, not a folder, pipe or device");
  }
  const auto size = static_cast<std::uint64_t>(info.st_size);
  if (size > limit_bytes) {
    throw Error(
        ExitCode::Limit,
        fmt::format("{}: '{}' has {} bytes, more than the limit of {}", what, printable(path), size, limit_bytes),
        "raise the limit with --limit-mem if the file is to be trusted");
  }
  return mapped ? FileBytes::mapped(file.get(), size) : FileBytes(read_all(file, size, what));
}

}  // namespace hpr
