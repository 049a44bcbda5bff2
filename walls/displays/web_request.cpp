#include "walls/displays/web_request.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <charconv>
#include <cmath>

#include "core/error.h"
#include "core/json.h"
#include "core/text.h"

namespace hpr {
namespace {

/// The name or number of "name:port", "[number]:port", "name" or "[number]".
std::string_view without_port(std::string_view host) {
  if (host.starts_with('[')) return host.substr(1, std::min(host.find(']'), host.size()) - 1);
  return host.substr(0, host.find(':'));
}

bool is_number(const std::string& host) {
  in_addr four{};
  in6_addr six{};
  return ::inet_pton(AF_INET, host.c_str(), &four) == 1 || ::inet_pton(AF_INET6, host.c_str(), &six) == 1;
}

bool read_pair(const Json& document, const char* name, double& right, double& up) {
  const Json* const found = document.find(name);
  if (found == nullptr) return true;
  if (!found->is_array() || found->size() != 2 || !(*found)[0].is_number() || !(*found)[1].is_number()) return false;
  right = (*found)[0].get<double>();
  up = (*found)[1].get<double>();
  return true;
}

}  // namespace

WebAddress parse_web_address(const std::string& text) {
  WebAddress address;
  if (text.empty()) return address;
  const std::string_view host = without_port(text);
  const bool bracket = text.starts_with('[');
  const std::size_t end = bracket ? host.size() + 2 : host.size();
  const std::string_view rest = std::string_view(text).substr(std::min(end, text.size()));
  if (!host.empty() && host != "localhost") address.host = host;
  bool good = is_number(address.host) && (!bracket || text.find(']') != std::string::npos) &&
              (rest.empty() || rest.starts_with(':'));
  if (good && !rest.empty()) {
    const char* const last = rest.data() + rest.size();
    const auto [stop, error] = std::from_chars(rest.data() + 1, last, address.port);
    good = error == std::errc() && stop == last;
  }
  if (good) return address;
  throw Error(ExitCode::Usage, fmt::format("'{}' is no address to listen on", printable(text)),
              "write e.g. 127.0.0.1:8080, or 0.0.0.0:8080 for all of this host's networks");
}

bool host_is_ours(std::string_view host) {
  const std::string name(without_port(host));
  if (name == "localhost" || is_number(name)) return true;
  std::array<char, 256> own{};
  return ::gethostname(own.data(), own.size() - 1) == 0 && !name.empty() && name == own.data();
}

bool origin_is_ours(std::string_view origin, std::string_view host) {
  constexpr std::string_view kScheme = "http://";
  return origin.starts_with(kScheme) && origin.substr(kScheme.size()) == host;
}

std::string_view cookie_in(std::string_view header, std::string_view name) {
  while (!header.empty()) {
    const std::size_t end = std::min(header.find(';'), header.size());
    std::string_view one = header.substr(0, end);
    header.remove_prefix(std::min(end + 1, header.size()));
    one.remove_prefix(std::min(one.find_first_not_of(' '), one.size()));
    const std::size_t equals = one.find('=');
    if (equals != std::string_view::npos && one.substr(0, equals) == name) return one.substr(equals + 1);
  }
  return {};
}

std::optional<OrbitInput> parse_motion(std::string_view body) {
  constexpr double kLargest = 100.0;
  const auto document = Json::try_parse(body);
  if (!document || !document->is_object()) return std::nullopt;
  OrbitInput motion;
  if (!read_pair(*document, "turn", motion.turn_right, motion.turn_up)) return std::nullopt;
  if (!read_pair(*document, "pan", motion.pan_right, motion.pan_up)) return std::nullopt;
  if (const Json* const dolly = document->find("dolly")) {
    if (!dolly->is_number()) return std::nullopt;
    motion.dolly = dolly->get<double>();
  }
  for (const double value : {motion.turn_right, motion.turn_up, motion.pan_right, motion.pan_up, motion.dolly}) {
    if (!(std::abs(value) <= kLargest)) return std::nullopt;
  }
  return motion;
}

}  // namespace hpr
