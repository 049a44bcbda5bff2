#include "engine/wall/line_source.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "core/error.h"
#include "core/file.h"

namespace hpr {
namespace {

using std::chrono::milliseconds;

class Client {
 public:
  explicit Client(const std::string& path) : socket_(::socket(AF_UNIX, SOCK_STREAM, 0)) {
    sockaddr_un name{};
    name.sun_family = AF_UNIX;
    std::memcpy(name.sun_path, path.data(), path.size());
    connected_ = ::connect(socket_, reinterpret_cast<const sockaddr*>(&name), sizeof name) == 0;
  }
  explicit Client(std::uint16_t port) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in name{};
    name.sin_family = AF_INET;
    name.sin_port = htons(port);
    name.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    connected_ = ::connect(socket_, reinterpret_cast<const sockaddr*>(&name), sizeof name) == 0;
  }
  ~Client() { ::close(socket_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  [[nodiscard]] bool connected() const { return connected_; }
  void send(std::string_view text) const {
    ASSERT_EQ(::send(socket_, text.data(), text.size(), MSG_NOSIGNAL), text.size());
  }
  /// Empty once the other end closed.
  [[nodiscard]] std::string received() const {
    std::array<char, 256> buffer{};
    const ssize_t count = ::recv(socket_, buffer.data(), buffer.size(), 0);
    return {buffer.data(), static_cast<std::size_t>(std::max<ssize_t>(count, 0))};
  }

 private:
  int socket_;
  bool connected_ = false;
};

/// The next line, for which connecting and sending take a few turns.
std::optional<InputLine> next_line(LineSource& source) {
  for (int turn = 0; turn < 20; ++turn) {
    if (auto line = source.next(milliseconds(20))) return line;
  }
  return std::nullopt;
}

class LineSourceTest : public testing::Test {
 protected:
  [[nodiscard]] std::string path() const { return (std::filesystem::path(testing::TempDir()) / name_).string(); }

 private:
  std::string name_ = "hpr-lines-" + std::to_string(::getpid());
};

TEST_F(LineSourceTest, LinesOfAUnixSocketAreAnsweredWhereTheyCameFrom) {
  LineSource source({.listen = path()});
  EXPECT_EQ(std::filesystem::status(path()).permissions(), std::filesystem::perms(0600));
  const Client first(path());
  const Client second(path());
  second.send("two\r\nthr");
  auto line = next_line(source);
  ASSERT_TRUE(line);
  EXPECT_EQ(line->text, "two");
  source.answer(*line, "ok\n");
  EXPECT_EQ(second.received(), "ok\n");
  second.send("ee\n");
  line = next_line(source);
  ASSERT_TRUE(line);
  EXPECT_EQ(line->text, "three");
  EXPECT_FALSE(source.next(milliseconds(1)));
  EXPECT_FALSE(source.ended());
}

TEST_F(LineSourceTest, LinesThatWaitCanBeSeenAndStay) {
  LineSource source({.listen = path()});
  const auto is_stop = [](const std::string& line) { return line == "stop"; };
  const auto comes = [&] {
    for (int turn = 0; turn < 200; ++turn) {
      if (source.any_waiting(is_stop)) return true;
      std::this_thread::sleep_for(milliseconds(2));
    }
    return false;
  };
  const Client client(path());
  client.send("status\nsto");
  EXPECT_TRUE(next_line(source));
  EXPECT_FALSE(source.any_waiting(is_stop));
  client.send("p\n");
  EXPECT_TRUE(comes());
  const auto line = next_line(source);
  ASSERT_TRUE(line);
  EXPECT_EQ(line->text, "stop");
  EXPECT_FALSE(source.any_waiting(is_stop));
}

TEST_F(LineSourceTest, AClientOfTcpSaysTheTokenFirst) {
  LineSource source({.listen = "127.0.0.1:0"});
  const auto port = static_cast<std::uint16_t>(std::stoi(source.address().substr(source.address().rfind(':') + 1)));
  EXPECT_GE(source.token().size(), 32U);
  const Client unauthenticated(port);
  unauthenticated.send("quit\n");
  EXPECT_FALSE(next_line(source));
  EXPECT_EQ(unauthenticated.received(), "");
  const Client guest(port);
  guest.send("token " + source.token() + "\nhelp\n");
  const auto line = next_line(source);
  ASSERT_TRUE(line);
  EXPECT_EQ(line->text, "help");
}

TEST_F(LineSourceTest, ClientsWithoutATokenKeepNobodyOut) {
  LineSource source({.listen = "127.0.0.1:0"});
  const auto port = static_cast<std::uint16_t>(std::stoi(source.address().substr(source.address().rfind(':') + 1)));
  std::vector<std::unique_ptr<Client>> idle;
  for (int i = 0; i < 20; ++i) {
    idle.push_back(std::make_unique<Client>(port));
    EXPECT_FALSE(source.next(milliseconds(1)));
  }
  const Client client(port);
  client.send("token " + source.token() + "\nhelp\n");
  const auto line = next_line(source);
  ASSERT_TRUE(line);
  EXPECT_EQ(line->text, "help");
}

TEST_F(LineSourceTest, AnEndlessLineEndsTheClientAlone) {
  LineSource source({.listen = path()});
  const Client client(path());
  client.send(std::string(10'000, 'x'));
  EXPECT_FALSE(next_line(source));
  EXPECT_EQ(client.received(), "");
  const Client other(path());
  other.send("help\n");
  EXPECT_TRUE(next_line(source));
}

TEST_F(LineSourceTest, ASocketInUseIsAnErrorAndOneLeftBehindIsNot) {
  {
    const LineSource source({.listen = path()});
    EXPECT_THROW(LineSource({.listen = path()}), Error);
  }
  EXPECT_FALSE(std::filesystem::exists(path()));
  const int left = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un name{};
  name.sun_family = AF_UNIX;
  std::memcpy(name.sun_path, path().data(), path().size());
  ASSERT_EQ(::bind(left, reinterpret_cast<const sockaddr*>(&name), sizeof name), 0);
  ::close(left);
  EXPECT_NO_THROW(LineSource({.listen = path()}));
}

TEST_F(LineSourceTest, WrongAddressesAreRefused) {
  for (const char* wrong : {"localhost:x", "1.2.3:80", "127.0.0.1:99999", "nowhere/at/all/socket"}) {
    EXPECT_THROW(LineSource({.listen = wrong}), Error) << wrong;
  }
}

}  // namespace
}  // namespace hpr
