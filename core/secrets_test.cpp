#include "core/secrets.h"

#include <gtest/gtest.h>

namespace hpr {
namespace {

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
