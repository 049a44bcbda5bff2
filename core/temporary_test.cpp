#include "core/temporary.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <optional>
#include <string>

#include "core/error.h"

namespace hpr {
namespace {

namespace fs = std::filesystem;

/// TMPDIR as it is set while this lives.
class TmpdirSetting {
 public:
  explicit TmpdirSetting(const std::string& value) {
    if (const char* const old = std::getenv("TMPDIR"); old != nullptr) old_ = old;
    ::setenv("TMPDIR", value.c_str(), 1);
  }
  ~TmpdirSetting() { old_ ? ::setenv("TMPDIR", old_->c_str(), 1) : ::unsetenv("TMPDIR"); }
  TmpdirSetting(const TmpdirSetting&) = delete;
  TmpdirSetting& operator=(const TmpdirSetting&) = delete;

 private:
  std::optional<std::string> old_;
};

std::string refusal() {
  try {
    const TemporaryFile file;
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Io);
    EXPECT_NE(error.hint().find("set TMPDIR"), std::string::npos) << error.hint();
    return error.what();
  }
  return {};
}

TEST(TemporaryFile, HasNoNameAndGoesWithItsOwner) {
  std::string name = (temporary_folder() / "hpr-temporary-test-XXXXXX").string();
  ASSERT_NE(::mkdtemp(name.data()), nullptr);
  const TmpdirSetting setting(name);
  fs::path path;
  {
    TemporaryFile made;
    const TemporaryFile file(std::move(made));
    path = file.path();
    std::ofstream(path) << "text";
    std::string text;
    std::ifstream(path) >> text;
    EXPECT_EQ(text, "text");
    EXPECT_TRUE(fs::is_empty(name));
    EXPECT_EQ(fs::status(path).permissions(), fs::perms{0600});
    EXPECT_EQ(fs::read_symlink(path).parent_path(), fs::canonical(name));
  }
  EXPECT_FALSE(fs::exists(path));
  fs::remove_all(name);
}

TEST(TemporaryFile, AFolderThatCannotBeWrittenIsNamedWithItsVariable) {
  for (const std::string folder : {"/nonexistent/folder", "/dev/null"}) {
    const TmpdirSetting setting(folder);
    EXPECT_EQ(temporary_folder(), folder);
    const std::string said = refusal();
    EXPECT_NE(said.find("'" + folder + "', which TMPDIR names"), std::string::npos) << said;
  }
}

TEST(TemporaryFolder, IsTheUsualOneWhereNobodyNamesAnother) {
  const TmpdirSetting setting("");
  EXPECT_EQ(temporary_folder(), "/tmp");
}

}  // namespace
}  // namespace hpr
