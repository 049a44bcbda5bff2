#include "scene/gltf/scan.h"

#include <gtest/gtest.h>

#include <string>

#include "core/error.h"

namespace hpr {
namespace {

GltfParts scan(const std::string& file, GltfContext& context) {
  return scan_gltf(std::as_bytes(std::span(file)), context);
}

std::string word(std::uint32_t value) {
  std::string bytes;
  for (unsigned i = 0; i < 4; ++i) bytes += static_cast<char>((value >> (8 * i)) & 0xFFU);
  return bytes;
}

std::string chunk(std::uint32_t type, const std::string& body) {
  return word(static_cast<std::uint32_t>(body.size())) + word(type) + body;
}

std::string glb(const std::string& chunks) {
  return "glTF" + word(2) + word(static_cast<std::uint32_t>(12 + chunks.size())) + chunks;
}

constexpr std::uint32_t kJson = 0x4E4F534A;
constexpr std::uint32_t kBin = 0x004E4942;

TEST(GltfScan, SplitsABinaryFileIntoItsChunks) {
  GltfContext context("x.glb", {});
  const std::string file = glb(chunk(kJson, "{}  ") + chunk(kBin, "abcd") + chunk(7, "skip"));
  const GltfParts parts = scan(file, context);
  EXPECT_EQ(parts.json, "{}  ");
  ASSERT_TRUE(parts.has_binary);
  EXPECT_EQ(parts.binary.size(), 4U);
  EXPECT_EQ(std::to_integer<char>(parts.binary[3]), 'd');
  EXPECT_TRUE(context.take_warnings().empty());
}

TEST(GltfScan, EveryPrefixOfABinaryFileIsRefused) {
  const std::string file = glb(chunk(kJson, "{}  ") + chunk(kBin, "abcd"));
  for (std::size_t size = 0; size < file.size(); ++size) {
    GltfContext context("x.glb", {});
    const std::string prefix = file.substr(0, size);
    EXPECT_THROW((void)scan(prefix, context), Error) << size << " bytes";
  }
}

TEST(GltfScan, BytesAfterTheLastChunkAreWarnedOf) {
  const std::string chunks = chunk(kJson, "{}  ") + chunk(kBin, "abcd");
  const std::string whole = glb(chunks);
  const std::string cut_chunk = word(1000) + word(7) + "unknown";
  for (const std::string& trailing :
       {std::string(1, '\0'), std::string("\n"), std::string("12345678"), whole, cut_chunk}) {
    for (const std::string& file : {whole + trailing, glb(chunks + trailing)}) {
      GltfContext context("x.glb", {});
      const GltfParts parts = scan(file, context);
      EXPECT_EQ(parts.json, "{}  ");
      EXPECT_EQ(parts.binary.size(), 4U);
      EXPECT_FALSE(context.take_warnings().empty()) << trailing.size() << " bytes";
    }
  }
}

TEST(GltfScan, AChunkOfDataThatIsCutOffIsRefusedWhateverTheHeaderSays) {
  GltfContext context("x.glb", {});
  const std::string file = glb(chunk(kJson, "{}  ") + word(8) + word(kBin) + "abcd");
  EXPECT_THROW((void)scan(file, context), Error);
  const std::string short_length = "glTF" + word(2) + word(11) + chunk(kJson, "{}  ");
  EXPECT_THROW((void)scan(short_length, context), Error);
}

TEST(GltfScan, ChunkLengthsBeyondTheFileAreRefused) {
  for (const std::uint32_t length : {5U, 0x7FFFFFFFU, 0xFFFFFFF8U, 0xFFFFFFFFU}) {
    GltfContext context("x.glb", {});
    const std::string file = glb(word(length) + word(kJson) + "{}  ");
    EXPECT_THROW((void)scan(file, context), Error) << length;
  }
}

TEST(GltfScan, TheFirstChunkMustBeJson) {
  GltfContext context("x.glb", {});
  const std::string file = glb(chunk(kBin, "abcd") + chunk(kJson, "{}  "));
  EXPECT_THROW((void)scan(file, context), Error);
}

TEST(GltfScan, NestingIsAllowedUpToItsLimitAndNotBeyond) {
  const auto nested = [](int levels) {
    return "{\"a\":" + std::string(static_cast<std::size_t>(levels - 1), '[') +
           std::string(static_cast<std::size_t>(levels - 1), ']') + "}";
  };
  GltfContext context("x.gltf", {});
  EXPECT_NO_THROW((void)scan(nested(kGltfJsonDepth), context));
  EXPECT_THROW((void)scan(nested(kGltfJsonDepth + 1), context), Error);
  EXPECT_THROW((void)scan("{\"a\":" + std::string(10'000'000, '['), context), Error);
}

TEST(GltfScan, BracketsInsideStringsDoNotNest) {
  GltfContext context("x.gltf", {});
  EXPECT_NO_THROW((void)scan("{\"a\":\"" + std::string(1000, '[') + "\\\"[[\\\\\"}", context));
}

TEST(GltfScan, TextThatIsNotUtf8IsRefused) {
  for (const char* bytes : {"\xFF", "\xC0\xAF", "\xED\xA0\x80", "\xF5\x80\x80\x80", "\xE2\x82", "\x80"}) {
    GltfContext context("x.gltf", {});
    EXPECT_THROW((void)scan(std::string("{\"a\":\"") + bytes + "\"}", context), Error);
  }
  GltfContext context("x.gltf", {});
  EXPECT_NO_THROW((void)scan("{\"a\":\"\xC3\xBC \xE2\x82\xAC \xF0\x9F\x98\x80\"}", context));
}

TEST(GltfScan, AKeyThatStandsTwiceIsWarnedOf) {
  GltfContext context("x.gltf", {});
  (void)scan(R"({"a": {"b": 1}, "c": [{"b": 1}, {"b": "b"}]})", context);
  EXPECT_TRUE(context.take_warnings().empty());
  (void)scan(R"({"a": {"b": 1, "b": 2}})", context);
  EXPECT_EQ(context.take_warnings().size(), 1U);
}

}  // namespace
}  // namespace hpr
