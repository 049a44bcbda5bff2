#include "engine/wall/wall_displays.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <optional>
#include <vector>

#include "cluster/transport/collectives.h"
#include "core/bytes.h"
#include "core/error.h"
#include "core/log.h"
#include "walls/drawing/assemble.h"
#include "walls/link/protocol.h"
#include "walls/link/sender.h"
#include "walls/manifest/manifest.h"
#include "walls/manifest/run_journal.h"

namespace hpr {
namespace {

/// A rank that writes pictures first loads the image module, which costs as much as encoding this many pixels.
constexpr std::size_t kPixelsWorthAWriter = 4'000'000;

/// Some machines call themselves by their whole name, wall01.lab.org.
bool same_host(const std::string& a, const std::string& b) {
  return a == b || a.substr(0, a.find('.')) == b || a == b.substr(0, b.find('.'));
}

/// Ranks of the screen's own host.
std::vector<int> ranks_near(const Wall& wall, const WallScreen& screen, const std::vector<std::string>& hosts) {
  std::vector<int> near;
  const auto node = std::ranges::find(wall.nodes, screen.node, &WallNode::id);
  if (node == wall.nodes.end()) return near;
  for (std::size_t rank = 0; rank < hosts.size(); ++rank) {
    if (same_host(node->host, hosts[rank])) near.push_back(static_cast<int>(rank));
  }
  return near;
}

/// The first screen before this one that shows in the same window.
std::optional<std::size_t> first_of_window(const Wall& wall, std::size_t screen) {
  if (wall.screens[screen].window.empty()) return std::nullopt;
  for (std::size_t before = 0; before < screen; ++before) {
    if (wall.screens[before].window == wall.screens[screen].window) return before;
  }
  return std::nullopt;
}

/// Screens that are shown by another rank than the wall file names.
struct Misplaced {
  std::vector<std::string> hosts;  ///< without a rank, each once
  std::size_t screens = 0;         ///< screens of those hosts
  std::vector<int> beyond;         ///< ranks the job does not have

  void add_host(const std::string& host) {
    ++screens;
    if (std::ranges::find(hosts, host) == hosts.end()) hosts.push_back(host);
  }

  void warn(int ranks) const {
    if (!beyond.empty()) {
      log::warning("{} screen{} of ranks {} to {}, but there are only {}: others show {}", beyond.size(),
                   beyond.size() == 1 ? " is" : "s are", std::ranges::min(beyond), std::ranges::max(beyond), ranks,
                   beyond.size() == 1 ? "it" : "them");
    }
    if (hosts.empty()) return;
    constexpr std::size_t kMaxNames = 4;
    const std::size_t named = std::min(hosts.size(), kMaxNames);
    log::warning("no rank runs on {}{}: others show {} screen{}",
                 fmt::join(hosts.begin(), hosts.begin() + static_cast<std::ptrdiff_t>(named), ", "),
                 hosts.size() > named ? fmt::format(" and {} more hosts", hosts.size() - named) : "", screens,
                 screens == 1 ? "" : "s");
  }
};

}  // namespace

std::vector<int> owners_of(const Wall& wall, const std::vector<std::string>& hosts, bool remote) {
  const int ranks = static_cast<int>(hosts.size());
  std::size_t pixels = 0;
  for (const WallScreen& screen : wall.screens) pixels += screen.pixels.area();
  const std::size_t writers = std::clamp<std::size_t>(pixels / kPixelsWorthAWriter, 1, hosts.size());

  std::vector<int> owners;
  owners.reserve(wall.screens.size());
  Misplaced misplaced;
  for (std::size_t i = 0; i < wall.screens.size(); ++i) {
    const WallScreen& screen = wall.screens[i];
    if (const auto first = first_of_window(wall, i)) {
      owners.push_back(owners[*first]);
      continue;
    }
    const std::vector<int> near = ranks_near(wall, screen, hosts);
    if (screen.rank >= 0 && screen.rank < ranks) {
      owners.push_back(screen.rank);
    } else if (!near.empty()) {
      owners.push_back(near[i % near.size()]);
    } else {
      owners.push_back(static_cast<int>(i * writers / wall.screens.size()));
    }
    if (screen.rank >= ranks) misplaced.beyond.push_back(screen.rank);
    const auto node = std::ranges::find(wall.nodes, screen.node, &WallNode::id);
    const bool any_host = node == wall.nodes.end() || node->host == "localhost" || node->host == "*";
    if (screen.rank < 0 && near.empty() && !any_host && !remote) misplaced.add_host(node->host);
  }
  misplaced.warn(ranks);
  return owners;
}

namespace {

/// Displays that are started along with the run get this long to be there for the first frame.
constexpr std::chrono::duration<double> kWaitForDisplays{1.0};

}  // namespace

std::unique_ptr<WallSender> connect_displays(Communicator& comm, const Wall& wall, std::span<const int> owners,
                                             SenderSettings settings) {
  settings.rank = comm.rank();
  // The environment may not reach the ranks of other hosts.
  const std::vector<std::byte> secret = on_root(comm, [] {
    ByteWriter writer;
    writer.u64(make_session());
    writer.text(link_token());
    RunJournal::Entries run;
    if (const auto journal = RunJournal::of_supervisor()) run = journal->read();
    writer.text(run.secret.empty() ? hex16(make_session()) + hex16(make_session()) : run.secret);
    writer.u32(static_cast<std::uint32_t>(run.restarts.size()));
    return writer.take();
  });
  ByteReader reader(secret);
  settings.session = reader.u64();
  settings.token = reader.text(secret.size());
  settings.run = reader.text(secret.size());
  settings.start = reader.u32();
  std::unique_ptr<WallSender> sender;
  agree_on_failure(comm, [&] {
    sender = std::make_unique<WallSender>(wall, owners, settings);
    if (comm.rank() != 0) return;
    try {
      sender->wait_for_displays(kWaitForDisplays);
    } catch (const Error&) {
      // A display that refuses this job would refuse the next one.
      if (auto journal = RunJournal::of_supervisor()) journal->add_end();
      throw;
    }
  });
  return sender;
}

bool end_displays(Communicator& comm, WallSender& sender, MissedPictures fail_on, RunManifest& manifest) {
  // Rank 0 ends the run's links after the other ranks have sent their pictures.
  if (comm.rank() != 0) sender.finish();
  barrier(comm);
  if (comm.rank() != 0) return true;
  sender.finish();
  std::size_t stale = 0;
  std::size_t lost = 0;
  for (FrameRecord& frame : manifest.frames) {
    const SwapOutcome outcome = sender.outcome(frame.frame);
    for (std::size_t i = 0; i < frame.screens.size(); ++i) {
      // The displays showed the pictures of the frame before.
      const bool is_stale = !frame.failed.empty() && outcome.screens[i] == ScreenState::Fresh;
      frame.screens[i].state = is_stale ? ScreenState::Stale : outcome.screens[i];
    }
    frame.swap = SwapRecord{};
    if (outcome.skew_s) frame.swap->skew_ms = *outcome.skew_s * 1000.0;
    const auto count = [&](ScreenState state) {
      return static_cast<std::size_t>(std::ranges::count(outcome.screens, state));
    };
    stale += count(ScreenState::Stale);
    lost += count(ScreenState::Lost);
  }
  manifest.degraded_seconds = sender.degraded_seconds();
  if (stale + lost > 0) {
    log::info(
        "of {} frames, {} pictures came too late for their screens and {} found none; {:.1f} s with something missing",
        manifest.frames.size(), stale, lost, sender.degraded_seconds());
  }
  if (!sender.reached_any()) {
    log::error("no display was there: {}", sender.why_unreached());
    return fail_on == MissedPictures::Never;
  }
  return (fail_on < MissedPictures::Lost || lost == 0) && (fail_on < MissedPictures::Stale || stale == 0);
}

WallMonitors::WallMonitors(const Wall& wall) : wall_(wall) {
  for (const WallMonitor& monitor : wall.monitors) layouts_.push_back(monitor_layout(wall, monitor));
}

std::vector<Image<Rgba8>> WallMonitors::draw(Communicator& comm, std::span<const Image<Rgba8>> pictures,
                                             std::span<const int> shown_by) const {
  std::vector<Image<Rgba8>> monitors;
  for (std::size_t m = 0; m < layouts_.size(); ++m) {
    const MonitorLayout& layout = layouts_[m];
    std::vector<Image<Rgba8>> parts(layout.screens.size());
    for (std::size_t i = 0; i < parts.size(); ++i) {
      const Size size{layout.rects[i].width(), layout.rects[i].height()};
      const int from = shown_by[layout.screens[i]];
      if (comm.rank() == from) parts[i] = resample(pictures[layout.screens[i]], size);
      if (from == 0) continue;
      if (comm.rank() == from) comm.send(std::as_bytes(parts[i].pixels()), 0);
      if (comm.rank() == 0) {
        parts[i] = Image<Rgba8>(size);
        comm.receive(std::as_writable_bytes(parts[i].pixels()), from);
      }
    }
    if (comm.rank() == 0) monitors.push_back(draw_monitor(wall_, wall_.monitors[m], layout, parts));
  }
  return monitors;
}

}  // namespace hpr
