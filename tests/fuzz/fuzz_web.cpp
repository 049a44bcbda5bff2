#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <set>
#include <string>

#include "core/error.h"
#include "core/json.h"
#include "core/log.h"
#include "tests/fuzz/fuzz.h"
#include "walls/config/wall_file.h"
#include "walls/displays/web_hub.h"
#include "walls/displays/web_request.h"
#include "walls/displays/web_server.h"
#include "walls/link/socket.h"

// What comes to the web display's port, and the parts of it that are read on their own.
namespace hpr::fuzz {
namespace {

/// Where the key of a server stands, which is another one in every process.
constexpr std::string_view kKey = "@KEY@";
constexpr std::string_view kPort = "@PORT@";

std::string with(std::string text, std::string_view word, std::string_view value) {
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + value.size())) {
    text.replace(at, word.size(), value);
  }
  return text;
}

Wall make_wall() {
  const WallReading reading = parse_wall(R"(hpr_wall = 1
[[surfaces]]
id = "wall"
[surfaces.grid]
columns = 2
rows = 1
tile_pixels = [64, 48]
tile_size_m = [0.64, 0.48]
)",
                                         "wall.toml");
  HPR_CHECK(reading.ok());
  return reading.wall;
}

/// A web display on loopback.
class Display {
 public:
  Display() : hub_(wall_), server_(hub_, {}) {
    const std::string url = server_.url();
    key_ = url.substr(url.find("token=") + 6);
    const std::size_t colon = url.find(':', std::string_view("http://").size());
    port_ = url.substr(colon + 1, url.find('/', colon) - colon - 1);
  }

  [[nodiscard]] const std::string& key() const { return key_; }
  [[nodiscard]] std::string filled_in(std::string text) const {
    return with(with(std::move(text), kKey, key_), kPort, port_);
  }

  /// What comes back until the server closes, as a client says that much and no more.
  [[nodiscard]] std::string ask(const std::string& request) const {
    const Socket client(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(std::atoi(port_.c_str())));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    HPR_CHECK(::connect(client.descriptor(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
    (void)::send(client.descriptor(), request.data(), request.size(), MSG_NOSIGNAL);
    ::shutdown(client.descriptor(), SHUT_WR);
    std::string all;
    std::array<char, 4096> buffer{};
    for (ssize_t got = 1; got > 0;) {
      got = ::recv(client.descriptor(), buffer.data(), buffer.size(), 0);
      if (got > 0) all.append(buffer.data(), static_cast<std::size_t>(got));
    }
    return all;
  }

 private:
  Wall wall_ = make_wall();
  WebHub hub_;
  WebServer server_;
  std::string key_;
  std::string port_;
};

/// Whether a motion is taken; one that is says the same when it is written anew.
bool reads_motion(std::string_view text) {
  const auto input = parse_motion(text);
  if (!input) return false;
  const OrbitInput& motion = input->orbit;
  const ViewKeys& keys = input->keys;
  std::string pressed(static_cast<std::size_t>(std::abs(keys.half_stops)), keys.half_stops < 0 ? '-' : '+');
  pressed.append(static_cast<std::size_t>(keys.tones), 't').append(static_cast<std::size_t>(keys.wireframes), 'w');
  const Json written{{"turn", Json::array({motion.turn_right, motion.turn_up})},
                     {"pan", Json::array({motion.pan_right, motion.pan_up})},
                     {"dolly", motion.dolly},
                     {"keys", pressed}};
  const auto again = parse_motion(written.dump());
  HPR_CHECK(again && *again == *input);
  for (const double value : {motion.turn_right, motion.turn_up, motion.pan_right, motion.pan_up, motion.dolly}) {
    HPR_CHECK(std::abs(value) <= 100.0);
  }
  return true;
}

bool reads_address(const std::string& text) {
  try {
    const WebAddress address = parse_web_address(text);
    HPR_CHECK(host_is_ours(address.host.find(':') == std::string::npos ? address.host : "[" + address.host + "]"));
    return true;
  } catch (const Error& error) {
    HPR_CHECK(error.code() == ExitCode::Usage);
    return false;
  }
}

void read_headers(const std::string& text) {
  const std::size_t half = text.size() / 2;
  const std::string_view first = std::string_view(text).substr(0, half);
  const std::string_view second = std::string_view(text).substr(half);
  if (origin_is_ours(second, first)) HPR_CHECK(second.ends_with(first));
  (void)host_is_ours(text);
  const std::string_view cookie = cookie_in(text, "hpr-1");
  HPR_CHECK(cookie.empty() || text.find("hpr-1=" + std::string(cookie)) != std::string::npos);
  // A page shows texts, and none of them becomes markup.
  const std::string html = to_html({text, "/stream", 1.0, {text}, "nonce"});
  const auto tags = [](std::string_view of) { return std::ranges::count(of, '<'); };
  static const auto expected = tags(to_html({"", "/stream", 1.0, {""}, "nonce"}));
  HPR_CHECK(tags(html) == expected);
}

/// Whether the display answers with what it has; it never does without its key.
bool is_answered(const std::string& text) {
  static const Display display;
  static const std::set<std::string> statuses{"200", "204", "303", "400", "403", "404", "405", "413", "431", "503"};
  const std::string request = display.filled_in(text);
  const std::string answer = display.ask(request);
  constexpr std::size_t kCode = std::string_view("HTTP/1.1 ").size();
  if (answer.empty()) return false;
  HPR_CHECK(answer.starts_with("HTTP/1.") && answer.size() > kCode + 3);
  const std::string status = answer.substr(kCode, 3);
  HPR_CHECK(statuses.contains(status));
  const bool let_in = status == "200" || status == "204" || status == "303" || status == "404";
  if (let_in) HPR_CHECK(request.find(display.key()) != std::string::npos);
  if (!let_in) HPR_CHECK(answer.find(display.key()) == std::string::npos);
  return let_in;
}

}  // namespace

std::vector<Bytes> seeds() {
  std::vector<Bytes> all;
  for (const char* const text : {
           "GET /?token=@KEY@ HTTP/1.1\r\nHost: localhost\r\n\r\n",
           "GET / HTTP/1.1\r\nHost: 127.0.0.1:@PORT@\r\nCookie: a=b; hpr-@PORT@=@KEY@\r\n\r\n",
           "GET /status HTTP/1.1\r\nHost: [::1]:80\r\nOrigin: http://[::1]:80\r\nCookie: hpr-@PORT@=@KEY@\r\n\r\n"
           "GET /screen/wall-0-0 HTTP/1.1\r\nHost: localhost\r\nCookie: hpr-@PORT@=@KEY@\r\n\r\n",
           "POST /camera HTTP/1.1\r\nHost: localhost\r\nCookie: hpr-@PORT@=@KEY@\r\nContent-Type: application/json\r\n"
           "Content-Length: 49\r\n\r\n{\"turn\": [0.1, -2], \"pan\": [0, 1e-3], \"dolly\": 5}",
           "POST /camera HTTP/1.1\r\nHost: localhost\r\nCookie: hpr-@PORT@=@KEY@\r\nContent-Type: application/json\r\n"
           "Transfer-Encoding: chunked\r\n\r\n5;x=y\r\n{\"dol\r\n8\r\nly\": 10}\r\n0\r\nA: b\r\n\r\n",
           R"({"turn": [0.1, -2], "pan": [0, 1e-3], "dolly": 5})",
           "127.0.0.1:8080",
           "[::1]:80",
           ":81",
       }) {
    all.push_back(to_bytes(text));
  }
  return all;
}

bool run(std::span<const std::byte> input) {
  log::configure(log::Level::Error, "");
  static std::uint64_t inputs = 0;
  const std::string text(reinterpret_cast<const char*>(input.data()), input.size());
  bool good = reads_motion(text);
  good |= reads_address(text);
  read_headers(text);
  // Most requests differ in what is read without a connection already.
  constexpr std::uint64_t kEvery = 8;
  if (!good && (inputs < 100 || inputs % kEvery == 0)) good = is_answered(text);
  ++inputs;
  return good;
}

Bytes repaired(Bytes input) {
  return input;
}

}  // namespace hpr::fuzz
