#include <sys/socket.h>
#include <unistd.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <string>

#include "core/error.h"
#include "core/json.h"
#include "engine/settings_table.h"
#include "engine/wall/command_table.h"
#include "engine/wall/line_source.h"
#include "engine/wall/viewpoint.h"
#include "scene/gltf/test_tools.h"
#include "tests/fuzz/fuzz.h"
#include "walls/link/socket.h"
#include "walls/manifest/manifest.h"
#include "walls/tracking/head_path.h"

// What is said line by line: commands of the console and of `wall ctl`, settings, camera and head paths; and manifests.
namespace hpr::fuzz {
namespace {

/// Commands that read their arguments as those of a session do.
class Session {
 public:
  Session() {
    table_.add({"move", "NODE X,Y,Z", "", [](Arguments arguments) {
                  if (arguments.size() < 2) refuse("two are needed", "move a 0,1,0");
                  const glm::dvec3 direction = direction_of(point_of(arguments[1]));
                  HPR_CHECK(std::abs(glm::dot(direction, direction) - 1.0) < 1e-9);
                  return std::string("moved");
                }});
    table_.add({"turn", "DEGREES", "", [](Arguments arguments) {
                  for (const std::string& each : arguments) HPR_CHECK(std::isfinite(number_of(each)));
                  return std::string("turned");
                }});
    table_.add({"set", "OPTION VALUE", "", [](Arguments arguments) {
                  if (arguments.size() != 2) refuse("two are needed", "set spp 4");
                  return set(arguments[0], arguments[1]);
                }});
  }

  bool say(const std::string& line) {
    try {
      return !table_.run(line).empty();
    } catch (const Error& error) {
      HPR_CHECK(error.code() == ExitCode::Usage && !error.hint().empty());
      return false;
    }
  }

 private:
  /// A value that is taken is written as one that is taken, and stays.
  static std::string set(const std::string& option, const std::string& value) {
    RenderSettings settings;
    set_setting(settings, option, value);
    const Setting& setting = *find_setting(option);
    const std::string written = setting.value.write(settings);
    if (!written.empty()) {
      RenderSettings again;
      setting.value.parse(again, written);
      HPR_CHECK(setting.value.write(again) == written);
    }
    reset_setting(settings, option);
    return "set to " + written;
  }

  CommandTable table_;
};

template <typename Read>
bool reads(Read read) {
  try {
    read();
    return true;
  } catch (const Error& error) {
    HPR_CHECK(error.code() == ExitCode::BadInput || error.code() == ExitCode::Usage || error.code() == ExitCode::Limit);
    return false;
  }
}

bool reads_json(const std::string& text) {
  const auto json = Json::try_parse(text);
  if (!json) return false;
  for (const std::string& written : {json->dump(), json->dump(2), json->dump_ascii()}) {
    const auto again = Json::try_parse(written);
    HPR_CHECK(again && again->dump() == json->dump());
  }
  return true;
}

/// The lines a client gets through, as it sends `text` and leaves.
void send_lines(const std::string& text) {
  static const test::TemporaryFolder folder;
  static const std::string path = (folder.path() / "lines.sock").string();
  static LineSource source({.listen = path});
  const LinkAddress address = socket_address(path);
  const Socket client(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  HPR_CHECK(::connect(client.descriptor(), reinterpret_cast<const sockaddr*>(&address.storage), address.length) == 0);
  (void)::send(client.descriptor(), text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  ::shutdown(client.descriptor(), SHUT_WR);
  std::size_t lines = 0;
  while (const auto line = source.next(std::chrono::milliseconds(0))) {
    HPR_CHECK(line->text.find('\n') == std::string::npos);
    HPR_CHECK(++lines == line->number);
    source.answer(*line, "ok\n");
  }
}

}  // namespace

std::vector<Bytes> seeds() {
  std::vector<Bytes> all;
  for (const Setting& setting : all_settings()) {
    const std::string value = setting.value.takes.substr(0, setting.value.takes.find_first_of(",: "));
    all.push_back(to_bytes("set " + std::string(setting.name) + " \"" + value + "\""));
    if (!Session().say("set " + std::string(setting.name) + " \"" + value + "\"")) all.pop_back();
  }
  for (const char* const text : {
           "move \"a \\\"chair\\\"\" 1,-2.5,1e3 # a comment\nturn 45 -1e-3\nhelp move\n",
           "turn 1 #nan -inf\nmove a 0,1,2 # ,inf,1e999\n",
           "set spp until:60s\nset spp until:relmse=1e-3\nset camera-eye 0,1,2\nset aov depth,id\n",
           "eye 0,1,5 at 0,1,0 up 0,1,0 fov 45\neye 1,2,3 at 0,0,0 # there\n",
           "0,0,1.7,2\n0.5, 0.1, 1.7, 2, 0, 0, 0, 1\n",
           "time,x,y,z,h,p,r\n0,0,1.7,2,10,20,30\n1,0.5,1.7,2,1,2,3\n",
           R"({"time": 0, "position": [0, 1.7, 2]})"
           "\n"
           R"({"time": 1, "position": [0, 1.7, 2], "orientation": [0, 0, 0, 1]})",
           "poses = [{ time = 0, position = [0, 1.7, 2] }, { time = 1.5, position = [0, 1, 2], orientation = [0, 0, 1, "
           "1] }]\n",
           R"({"a": [1, -2, 3.5e-7, 18446744073709551615], "b": {"c": "\u00e9\ud83d\ude00\n", "d": null}, "e": true})",
       }) {
    all.push_back(to_bytes(text));
  }
  RunManifest manifest;
  manifest.versions = {{"hpr", "1"}};
  manifest.frames = {{.frame = 0, .ms = 1.5, .strategy = "tree", .screens = {{.id = "a", .size = {3, 2}}}}};
  manifest.restarts = {R"({"frame": 0, "why": "a rank was lost"})"};
  manifest.stopped_of = 7;
  all.push_back(to_bytes(to_json(manifest)));
  return all;
}

bool run(std::span<const std::byte> input) {
  static Session session;
  static std::uint64_t inputs = 0;
  const std::string text(reinterpret_cast<const char*>(input.data()), input.size());
  bool good = reads_json(text);
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    good |= session.say(text.substr(begin, end - begin));
    begin = end + 1;
  }
  for (const HeadPathFormat format : {HeadPathFormat::Csv, HeadPathFormat::JsonLines, HeadPathFormat::Toml}) {
    good |= reads([&] {
      const HeadPath path = parse_head_path(text, format, "heads");
      for (const double time : {-1.0, 0.0, 0.7, 1e9}) {
        const glm::dvec3 position = path.at(time).position;
        HPR_CHECK(std::isfinite(position.x) && std::isfinite(position.y) && std::isfinite(position.z));
      }
    });
  }
  good |= reads([&] {
    const CameraPath path = parse_camera_path(text, "path");
    check_directions(path, 7, "path");
    for (std::size_t frame = 0; frame < 7; ++frame) (void)camera_of(path.at_frame(frame, 7));
  });
  good |= reads([&] { (void)parse_manifest(text, "manifest.json"); });
  if (++inputs % 16 == 1) send_lines(text);
  return good;
}

Bytes repaired(Bytes input) {
  return input;
}

}  // namespace hpr::fuzz
