#include "scene/gltf/uri.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <span>
#include <string>

#include "core/error.h"
#include "scene/gltf/test_tools.h"

namespace hpr {
namespace {

std::string text(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

TEST(GltfUri, Base64FollowsTheExamplesOfItsStandard) {
  EXPECT_EQ(text(base64_decoded("").value()), "");
  EXPECT_EQ(text(base64_decoded("Zg==").value()), "f");
  EXPECT_EQ(text(base64_decoded("Zm8=").value()), "fo");
  EXPECT_EQ(text(base64_decoded("Zm9v").value()), "foo");
  EXPECT_EQ(text(base64_decoded("Zm9vYmFy").value()), "foobar");
}

TEST(GltfUri, Base64IsStrict) {
  for (const char* bad : {"Zg=", "Zg", "Z===", "Zh==", "Zm9=", "Zm 9v", "Zm-_", "Zg==Zg==", "=Zg=", "===="}) {
    EXPECT_FALSE(base64_decoded(bad).has_value()) << bad;
  }
}

TEST(GltfUri, DataUrisHaveASchemeInAnyCaseAndMayEscapeWhatTheyHold) {
  // One triangle's worth of text that base64 writes with both of its signs and padding: "a>?b" is "YT4/Yg==".
  for (const char* uri : {
           "data:;base64,YT4/Yg==",
           "data:application/octet-stream;base64,YT4%2FYg%3D%3D",
           "data:application/octet-stream;base64,YT4%2fYg%3d=",
           "data:application/octet-stream;base64,%59T4/Yg==",
           "DATA:application/octet-stream;BASE64,YT4/Yg==",
           "Data:application/gltf-buffer;charset=utf-8;Base64,YT4/Yg==",
           "dAtA:;bAsE64,YT4%2FYg%3D%3D",
           "data:,a>?b",
           "DATA:,a%3E%3Fb",
           "data:application/octet-stream,%61%3e%3f%62",
           "data:base64,a%3E?b",
       }) {
    EXPECT_TRUE(is_data_uri(uri)) << uri;
    EXPECT_EQ(text(data_uri_bytes(uri, "t")), "a>?b") << uri;
  }
  for (const char* bad : {"data:;base64,YT4%2", "data:;base64,YT4%2FYg", "data:;base64,YT4/Yg==%zz", "data:,a%3",
                          "data:a", "data:;base64,YT4%20/Yg=="}) {
    EXPECT_THROW((void)data_uri_bytes(bad, "t"), Error) << bad;
  }
  EXPECT_FALSE(is_data_uri("database.bin"));
  EXPECT_FALSE(is_data_uri("dat"));
  EXPECT_TRUE(is_picture_uri("Data:Image/PNG;base64,AA=="));
  EXPECT_FALSE(is_picture_uri("data:application/octet-stream;base64,AA=="));
}

TEST(GltfUri, OnlyPathsBelowTheFolderAreLetThrough) {
  EXPECT_EQ(jailed_path("a.bin", "t"), "a.bin");
  EXPECT_EQ(jailed_path("sub/a%20b.bin", "t"), "sub/a b.bin");
  EXPECT_EQ(jailed_path("..a/b..", "t"), "..a/b..");
  EXPECT_EQ(jailed_path("gr%C3%BC%C3%9Fe%23%3F%25.bin", "t"), "gr\u00fc\u00dfe#?%.bin");
  EXPECT_EQ(jailed_path("a%3Ab.bin", "t"), "a:b.bin");
  for (const char* bad : {"",           "../a",   "a/../b",      "a/..",          "..",
                          "%2e%2e/a",   "%2E./a", "/etc/passwd", "%2fetc/passwd", "file:///etc/passwd",
                          "http://x/y", "C:\\a",  "c:a",         "..\\a",         "\\\\host\\a",
                          "a%00b",      "a%0ab",  "a%",          "a%2",           "a%zz"}) {
    EXPECT_THROW((void)jailed_path(bad, "t"), Error) << bad;
  }
  EXPECT_THROW((void)jailed_path(std::string(5000, 'a'), "t"), Error);
}

TEST(GltfUri, FilesAreReadBelowTheFolderOnly) {
  const test::TemporaryFolder outside;
  (void)outside.write("secret", "secret");
  const test::TemporaryFolder folder;
  (void)folder.write("sub/a.bin", "hello");
  std::filesystem::create_symlink("sub/a.bin", folder.path() / "inside");
  std::filesystem::create_symlink(outside.path() / "secret", folder.path() / "absolute");
  std::filesystem::create_symlink("../" + outside.path().filename().string() + "/secret", folder.path() / "relative");
  std::filesystem::create_symlink("loop", folder.path() / "loop");

  EXPECT_EQ(text(read_jailed(folder.path(), "sub/a.bin", "t", 100).bytes()), "hello");
  EXPECT_EQ(text(read_jailed(folder.path(), "inside", "t", 100).bytes()), "hello");
  for (const char* bad : {"absolute", "relative", "loop"}) {
    try {
      (void)read_jailed(folder.path(), bad, "t", 100);
      ADD_FAILURE() << bad << " was read";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::BadInput) << bad;
    }
  }
}

TEST(GltfUri, PipesFoldersAndLargeFilesAreRefused) {
  const test::TemporaryFolder folder;
  (void)folder.write("sub/a.bin", "hello");
  ASSERT_EQ(::mkfifo((folder.path() / "pipe").c_str(), 0600), 0);
  const auto code_of = [&](const char* uri, std::uint64_t limit) {
    try {
      (void)read_jailed(folder.path(), uri, "t", limit);
    } catch (const Error& error) {
      return error.code();
    }
    return ExitCode::Done;
  };
  EXPECT_EQ(code_of("pipe", 100), ExitCode::Io);
  EXPECT_EQ(code_of("sub", 100), ExitCode::Io);
  EXPECT_EQ(code_of("missing", 100), ExitCode::Io);
  EXPECT_EQ(code_of("sub/a.bin", 4), ExitCode::Limit);
  EXPECT_EQ(code_of("sub/a.bin", 5), ExitCode::Done);
}

}  // namespace
}  // namespace hpr
