#include "core/bytes.h"

#include <gtest/gtest.h>

#include <string_view>
#include <vector>

namespace hpr {
namespace {

std::uint64_t hash_of(std::string_view text) {
  return xxh64(std::as_bytes(std::span(text)));
}

TEST(Hash, EqualsTheKnownValuesOfXxh64) {
  EXPECT_EQ(hash_of(""), 0xef46db3751d8e999U);
  EXPECT_EQ(hash_of("a"), 0xd24ec4f1a98c6e5bU);
  EXPECT_EQ(hash_of("abc"), 0x44bc2cf5ad770999U);
}

TEST(Hash, PartsHashLikeTheWholeWhereverTheyAreCut) {
  std::vector<std::byte> bytes(100);
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::byte>(i * 37);
  for (std::size_t cut = 0; cut <= bytes.size(); ++cut) {
    ContentHash hash;
    hash.add(std::span(bytes).first(cut));
    hash.add({});
    hash.add(std::span(bytes).subspan(cut));
    EXPECT_EQ(hash.value(), xxh64(bytes)) << "cut at " << cut;
  }
}

TEST(Hash, PrintsSixteenLowerCaseDigits) {
  EXPECT_EQ(hex16(0), "0000000000000000");
  EXPECT_EQ(hex16(0xABCDEF), "0000000000abcdef");
  EXPECT_EQ(hex16(~std::uint64_t{0}), "ffffffffffffffff");
}

TEST(Secrets, TokensDifferAndAreComparedWhole) {
  const std::string token = random_token();
  EXPECT_EQ(token.size(), 32U);
  EXPECT_NE(token, random_token());
  EXPECT_TRUE(same_token(token, token));
  EXPECT_FALSE(same_token(token.substr(1), token));
  EXPECT_FALSE(same_token("", token));
  std::string other = token;
  other.back() = other.back() == '0' ? '1' : '0';
  EXPECT_FALSE(same_token(other, token));
}

}  // namespace

}  // namespace hpr
