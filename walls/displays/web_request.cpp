#include "walls/displays/web_request.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <charconv>
#include <cmath>
#include <string_view>

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

/// Words in braces are filled in; see to_html.
constexpr std::string_view kPage = R"html(<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>{title}</title>
<style nonce="{nonce}">
  html, body { margin: 0; height: 100%; background: #15161a; color: #d8dae0; font: 14px/1.6 system-ui, sans-serif; }
  body { display: flex; flex-direction: column; }
  header { display: flex; gap: 1em; padding: 0.2em 0.8em; flex-wrap: wrap; }
  header a { color: #9ab8e8; text-decoration: none; margin-right: 0.6em; }
  header output { margin-left: auto; font-variant-numeric: tabular-nums; }
  main { flex: 1; min-height: 0; display: flex; justify-content: center; align-items: center; }
  img { max-width: 100%; max-height: 100%; cursor: grab; touch-action: none; user-select: none; }
</style>
<header>
  <b>{title}</b>
  <nav><a href="/">wall</a>{links}</nav>
  <span>drag: turn &middot; shift-drag: pan &middot; wheel: nearer &middot; + -: exposure &middot; t: tone &middot; w: wireframe</span>
  <output id="status"></output>
</header>
<main><img id="view" src="{stream}" alt="{title}" draggable="false" data-heights="{heights}"></main>
<script nonce="{nonce}">
  const view = document.getElementById("view");
  const status = document.getElementById("status");
  const heights = Number(view.dataset.heights);
  let motion = null;   // not yet sent
  let sending = false;

  function add(turn, pan, dolly, keys = "") {
    motion = motion || { turn: [0, 0], pan: [0, 0], dolly: 0, keys: "" };
    for (const i of [0, 1]) { motion.turn[i] += turn[i]; motion.pan[i] += pan[i]; }
    motion.dolly += dolly;
    motion.keys = (motion.keys + keys).slice(-32);
    send();
  }

  // One request at a time: what the mouse does meanwhile is summed.
  async function send() {
    if (sending || !motion) return;
    sending = true;
    const body = JSON.stringify(motion);
    motion = null;
    try {
      await fetch("/camera", { method: "POST", headers: { "Content-Type": "application/json" }, body });
    } catch { motion = null; }
    sending = false;
    send();
  }

  view.addEventListener("pointerdown", (event) => view.setPointerCapture(event.pointerId));
  view.addEventListener("pointermove", (event) => {
    if (!event.buttons) return;
    const right = event.movementX / view.clientHeight * heights;
    const up = -event.movementY / view.clientHeight * heights;
    if (event.shiftKey || event.buttons !== 1) add([0, 0], [right, up], 0);
    else add([Math.PI * right, Math.PI * up], [0, 0], 0);
  });
  view.addEventListener("contextmenu", (event) => event.preventDefault());
  view.addEventListener("wheel", (event) => {
    event.preventDefault();
    add([0, 0], [0, 0], -0.15 * Math.sign(event.deltaY));
  }, { passive: false });

  document.addEventListener("keydown", (event) => {
    const plain = !event.ctrlKey && !event.altKey && !event.metaKey;
    if (plain && event.key.length === 1 && "+=-tw".includes(event.key)) add([0, 0], [0, 0], 0, event.key);
  });

  async function refresh() {
    try {
      const now = await (await fetch("/status")).json();
      status.textContent = `frame ${now.frame} · ${now.fps.toFixed(1)} fps`;
    } catch { status.textContent = "the run has ended"; }
    setTimeout(refresh, 500);
  }
  refresh();
</script>
</html>
)html";

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '&') {
      out += "&amp;";
    } else if (c == '<') {
      out += "&lt;";
    } else if (c == '>') {
      out += "&gt;";
    } else if (c == '"') {
      out += "&quot;";
    } else {
      out += c;
    }
  }
  return out;
}

void fill_in(std::string& text, std::string_view word, std::string_view value) {
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + value.size())) {
    text.replace(at, word.size(), value);
  }
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

std::optional<DisplayInput> parse_motion(std::string_view body) {
  constexpr double kMaxMotion = 100.0;
  constexpr std::size_t kMaxKeys = 32;
  const auto document = Json::try_parse(body);
  if (!document || !document->is_object()) return std::nullopt;
  DisplayInput input;
  OrbitInput& motion = input.orbit;
  if (!read_pair(*document, "turn", motion.turn_right, motion.turn_up)) return std::nullopt;
  if (!read_pair(*document, "pan", motion.pan_right, motion.pan_up)) return std::nullopt;
  if (const Json* const dolly = document->find("dolly")) {
    if (!dolly->is_number()) return std::nullopt;
    motion.dolly = dolly->get<double>();
  }
  for (const double value : {motion.turn_right, motion.turn_up, motion.pan_right, motion.pan_up, motion.dolly}) {
    if (!(std::abs(value) <= kMaxMotion)) return std::nullopt;
  }
  if (const Json* const pressed = document->find("keys")) {
    if (!pressed->is_string()) return std::nullopt;
    const auto keys = pressed->get<std::string>();
    if (keys.size() > kMaxKeys) return std::nullopt;
    for (const char key : keys) {
      const auto meaning = parse_view_key(key);
      if (!meaning) return std::nullopt;
      input.keys += *meaning;
    }
  }
  return input;
}

std::string to_html(const WebPage& page) {
  std::string links;
  for (const std::string& screen : page.screens) {
    links += fmt::format("<a href=\"/screen/{0}\">{0}</a>", escaped(screen));
  }
  std::string html(kPage);
  fill_in(html, "{nonce}", page.nonce);
  fill_in(html, "{heights}", fmt::format("{}", page.wall_heights));
  fill_in(html, "{stream}", escaped(page.stream));
  fill_in(html, "{links}", links);
  fill_in(html, "{title}", escaped(page.title));
  return html;
}

}  // namespace hpr
