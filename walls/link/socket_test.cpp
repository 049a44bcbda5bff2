#include "walls/link/socket.h"

#include <gtest/gtest.h>

#include <string>

#include "core/error.h"

namespace hpr {
namespace {

TEST(LinkAddress, IsAPathOrAHostAndAPort) {
  EXPECT_FALSE(parse_address("/tmp/x.sock").tcp);
  EXPECT_TRUE(parse_address("127.0.0.1:5005").tcp);
  EXPECT_TRUE(parse_address("[::1]:5005").tcp);
  for (const char* const bad : {"", "host", ":5", "127.0.0.1:", "127.0.0.1:0", "127.0.0.1:65536", "127.0.0.1:5x"}) {
    EXPECT_THROW((void)parse_address(bad), Error) << bad;
  }
  EXPECT_THROW((void)parse_address("/" + std::string(200, 'x')), Error);
}

TEST(LinkAddress, AListenerMayLeaveMoreToTheSystem) {
  EXPECT_FALSE(parse_listen_address("x.sock").tcp);
  const Listener listener(parse_listen_address(":0"));
  EXPECT_TRUE(listener.tcp());
  EXPECT_TRUE(listener.address().starts_with("127.0.0.1:"));
  EXPECT_NO_THROW((void)start_connecting(parse_address(listener.address())));
  for (const char* const bad : {"", "127.0.0.1:", "127.0.0.1:65536", "127.0.0.1:x"}) {
    EXPECT_THROW((void)parse_listen_address(bad), Error) << bad;
  }
}

}  // namespace
}  // namespace hpr
