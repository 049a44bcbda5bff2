#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "core/error.h"
#include "image/image_io.h"
#include "image/key.h"
#include "tests/fuzz/fuzz.h"
#include "tools/diff/diff.h"

// Files of keys of strangers, compared as `hpr diff` does: the first half of the input with the second.
namespace hpr::fuzz {
namespace {

/// A folder of this process, gone with it.
class Folder {
 public:
  Folder() {
    std::string name = (std::filesystem::temp_directory_path() / "hpr-fuzz-keys-XXXXXX").string();
    HPR_CHECK(::mkdtemp(name.data()) != nullptr);
    path_ = name;
  }
  ~Folder() {
    std::error_code error;
    std::filesystem::remove_all(path_, error);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  [[nodiscard]] std::filesystem::path write(const std::string& name, std::span<const std::byte> bytes) const {
    std::ofstream file(path_ / name, std::ios::binary);
    file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    HPR_CHECK(file.good());
    return path_ / name;
  }

 private:
  std::filesystem::path path_;
};

void check(const DiffReport& report, std::size_t keys) {
  const Difference& difference = report.difference;
  HPR_CHECK(report.keys && difference.pixels == keys && difference.differing <= keys);
  HPR_CHECK(report.other_surface <= difference.differing && report.beyond == difference.differing);
  HPR_CHECK(report.passed == (report.beyond == 0));
  HPR_CHECK(!diff_table(report, quick_diff_metrics()).empty());
  HPR_CHECK(!diff_json(report, quick_diff_metrics(), "a.keys", "b.keys", {}).empty());
}

Bytes seed_of(const std::vector<Key>& keys) {
  const auto bytes = std::as_bytes(std::span(keys));
  return {bytes.begin(), bytes.end()};
}

}  // namespace

std::vector<Bytes> seeds() {
  const Key near = make_key(0.5F, 7);
  const Key far = make_key(0.25F, 9);
  return {seed_of({near, near}), seed_of({near, far, kNoKey, near, near, kNoKey}), seed_of({kNoKey, far})};
}

bool run(std::span<const std::byte> input) {
  static const Folder folder;
  const std::size_t half = input.size() / 2;
  const auto a = folder.write("a.keys", input.first(half));
  const auto b = folder.write("b.keys", input.last(half));
  try {
    check(diff_files(a, b, {}, {}), half / sizeof(Key));
    return true;
  } catch (const Error& error) {
    HPR_CHECK(error.code() == ExitCode::BadInput);
    HPR_CHECK(half == 0 || half % sizeof(Key) != 0);
    return false;
  }
}

Bytes repaired(Bytes input) {
  return input;
}

}  // namespace hpr::fuzz
