#include "walls/displays/web_server.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <random>
#include <thread>

#include "core/error.h"
#include "walls/config/wall_file.h"

namespace hpr {
namespace {

using std::chrono::milliseconds;

/// One connection of a browser to a server on loopback.
class Viewer {
 public:
  Viewer(std::uint16_t port, int receive_bytes) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    if (receive_bytes > 0) ::setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &receive_bytes, sizeof receive_bytes);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  }
  ~Viewer() { ::close(socket_); }
  Viewer(const Viewer&) = delete;
  Viewer& operator=(const Viewer&) = delete;

  void ask(const std::string& path, const std::string& header) const {
    const std::string text = "GET " + path + " HTTP/1.1\r\nHost: localhost\r\n" + header + "\r\n";
    EXPECT_EQ(::send(socket_, text.data(), text.size(), MSG_NOSIGNAL), static_cast<ssize_t>(text.size()));
  }

  /// Empty: the server has closed the connection.
  [[nodiscard]] std::string read(std::size_t most) const {
    std::string bytes(most, '\0');
    const ssize_t got = ::recv(socket_, bytes.data(), most, 0);
    bytes.resize(static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
    return bytes;
  }

 private:
  int socket_;
};

/// Nothing of it can be left out by a JPEG: about 2 bytes a pixel.
Image<Rgba8> noise(Size size) {
  Image<Rgba8> image(size);
  std::mt19937 random(1);
  for (Rgba8& pixel : image.pixels()) {
    const auto bits = static_cast<std::uint32_t>(random());
    pixel = {static_cast<std::uint8_t>(bits), static_cast<std::uint8_t>(bits >> 8),
             static_cast<std::uint8_t>(bits >> 16), 255};
  }
  return image;
}

/// {port, query} of "http://127.0.0.1:PORT/?QUERY".
std::pair<std::uint16_t, std::string> parts_of(const std::string& url) {
  const std::size_t colon = url.rfind(':');
  return {static_cast<std::uint16_t>(std::stoi(url.substr(colon + 1))), url.substr(url.find('?'))};
}

std::string cookie_of(std::uint16_t port, const std::string& query) {
  const Viewer viewer(port, 0);
  viewer.ask("/" + query, "Connection: close\r\n");
  std::string answer;
  for (std::string more = viewer.read(4096); !more.empty(); more = viewer.read(4096)) answer += more;
  const std::string before = "Set-Cookie: ";
  const std::size_t begin = answer.find(before) + before.size();
  return answer.substr(begin, answer.find(';', begin) - begin);
}

TEST(WebServer, AViewerThatReadsSlowlyGetsAWholePicture) {
  const Wall wall = load_wall("1x1@2300x1900");
  WebHub hub(wall);
  const Image<Rgba8> image = noise(wall.screens[0].pixels);
  const std::vector<ScreenPicture> pictures{{0, image}};
  hub.publish({1, pictures});
  const std::size_t wanted = hub.picture(1)->jpeg.size();
  // More than the kernel takes off the server's hands.
  ASSERT_GT(wanted, 6'000'000U);
  const WebServer server(hub, {}, milliseconds(600));
  const auto [port, query] = parts_of(server.url());
  const std::string cookie = cookie_of(port, query);

  const Viewer viewer(port, 32768);
  viewer.ask("/stream/" + wall.screens[0].id, "Cookie: " + cookie + "\r\n");
  std::size_t got = 0;
  for (std::string more = viewer.read(65536); !more.empty() && got < wanted; more = viewer.read(65536)) {
    got += more.size();
    std::this_thread::sleep_for(milliseconds(10));
  }
  EXPECT_GE(got, wanted);
}

TEST(WebServer, APictureThatCannotBeSentIsAWarningWithItsReason) {
  const Wall wall = load_wall("1x1@4x4");
  WebHub hub(wall);
  const Image<Rgba8> image({70000, 1});  // longer than JPEG can have it
  const std::vector<ScreenPicture> pictures{{0, image}};
  hub.publish({1, pictures});
  testing::internal::CaptureStderr();
  {
    const WebServer server(hub, {});
    const auto [port, query] = parts_of(server.url());
    const Viewer viewer(port, 0);
    viewer.ask("/stream/" + wall.screens[0].id, "Cookie: " + cookie_of(port, query) + "\r\n");
    EXPECT_EQ(viewer.read(1), "");
  }
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_NE(said.find("70000x1"), std::string::npos) << said;
}

TEST(WebServer, APortThatIsTakenIsFoundAheadOfTheRun) {
  const Wall wall = load_wall("1x1@4x4");
  WebHub hub(wall);
  const WebServer server(hub, {});
  const std::uint16_t port = parts_of(server.url()).first;
  const DisplayOptions options{.web_address = ":" + std::to_string(port)};
  try {
    find_display("web").check(wall, options);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Io);
  }
  const DisplayOptions any{};
  EXPECT_NO_THROW(find_display("web").check(wall, any));
}

}  // namespace
}  // namespace hpr
