#include "walls/displays/web_page.h"

#include <fmt/format.h>

#include <string_view>
#include <utility>

namespace hpr {
namespace {

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
  <span>drag: turn &middot; shift-drag: pan &middot; wheel: nearer</span>
  <output id="status"></output>
</header>
<main><img id="view" src="{stream}" alt="{title}" draggable="false" data-heights="{heights}"></main>
<script nonce="{nonce}">
  const view = document.getElementById("view");
  const status = document.getElementById("status");
  const heights = Number(view.dataset.heights);
  let motion = null;   // not yet sent
  let sending = false;

  function add(turn, pan, dolly) {
    motion = motion || { turn: [0, 0], pan: [0, 0], dolly: 0 };
    for (const i of [0, 1]) { motion.turn[i] += turn[i]; motion.pan[i] += pan[i]; }
    motion.dolly += dolly;
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
