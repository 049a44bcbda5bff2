#include <fmt/format.h>

#include <algorithm>

#include "core/error.h"
#include "core/text.h"
#include "walls/config/wall_draft.h"
#include "walls/config/wall_file.h"
#include "walls/tracking/head_path.h"

namespace hpr {
namespace {

constexpr double kMetresLimit = 1e6;

/// `key` names a recorded path; what is wrong with the file is a finding too.
void read_path(TableReader& reader, std::string_view key, const std::filesystem::path& folder, WallTracker& tracker) {
  const auto path = reader.text(key);
  if (!path) return;
  tracker.kind = WallTracker::Kind::File;
  tracker.path = *path;
  tracker.file = (folder / *path).lexically_normal().string();
  try {
    static_cast<void>(load_head_path(tracker.file));
  } catch (const Error& error) {
    reader.error(key, fmt::format("cannot be used: {}", error.what()), error.hint());
  }
}

void read_udp(TableReader& reader, WallTracker& tracker, Findings& findings) {
  constexpr int kLargestPort = 65535;
  constexpr int kMaxWait = 3'600'000;
  tracker.kind = WallTracker::Kind::Udp;
  tracker.address = reader.text("address").value_or(tracker.address);
  reader.require("port", "5005");
  tracker.port = reader.integer("port", 1, kLargestPort).value_or(0);
  const TomlValue* const table = reader.table("lost");
  if (table == nullptr) return;
  TableReader lost(*table, "lost", findings);
  tracker.lost_after_ms = lost.integer("after_ms", 1, kMaxWait).value_or(tracker.lost_after_ms);
  tracker.lost_then = static_cast<WallTracker::Lost>(lost.choice("then", {"freeze", "rest"}).value_or(0));
  lost.finish();
}

void read_tracker(const TomlValue& table, const std::filesystem::path& folder, WallTracker& tracker,
                  Findings& findings) {
  constexpr double kHighestRate = 1e6;
  TableReader reader(table, "tracker", findings);
  reader.require("type", "\"file\"");
  const auto type = reader.choice("type", {"file", "udp", "vrpn"});
  if (type == 0U) {
    reader.require("path", "\"walk.csv\"");
    read_path(reader, "path", folder, tracker);
    tracker.rate_hz = reader.real("rate_hz", 0.0, kHighestRate).value_or(tracker.rate_hz);
  } else if (type == 1U) {
    read_udp(reader, tracker, findings);
  } else if (type == 2U) {
    reader.ignore({"type", "address", "lost"});
  } else {
    for (const std::string_view key : {"path", "rate_hz", "address", "port", "lost"}) {
      static_cast<void>(reader.has(key));
    }
  }
  reader.ignore({"sensor", "predict_ms"});
  reader.finish();
}

}  // namespace

void read_viewers(TableReader& document, const std::filesystem::path& folder, WallDraft& draft, Findings& findings) {
  constexpr double kWidestEyes = 10.0;
  for (const TomlValue* const table : document.tables("viewers")) {
    TableReader reader(*table, "viewer", findings);
    WallViewer viewer;
    viewer.id = reader.id("id").value_or("");
    const auto position = reader.point("position_m");
    viewer.given = position.has_value();
    viewer.position = position.value_or(viewer.position);
    viewer.ipd_m = reader.real_from("ipd_m", 0.0, kWidestEyes).value_or(0.0);
    viewer.eye_offset = reader.point("eye_offset_m").value_or(viewer.eye_offset);
    viewer.near_m = reader.real("near_m", 0.0, kMetresLimit).value_or(viewer.near_m);
    viewer.clamp_distance_m = reader.real("clamp_distance_m", 0.0, kMetresLimit).value_or(viewer.clamp_distance_m);
    if (const TomlValue* const tracker = reader.table("tracker")) {
      read_tracker(*tracker, folder, viewer.tracker, findings);
    }
    reader.finish();
    draft.viewers.push_back({std::move(viewer), table->place, reader.has("position_m")});
  }
  if (const TomlValue* const table = document.table("stereo")) {
    TableReader reader(*table, "stereo", findings);
    draft.stereo = static_cast<StereoMode>(reader.choice("mode", stereo_names()).value_or(0));
    draft.stereo_place = reader.place("mode");
    reader.finish();
  }
}

void read_test(TableReader& document, const std::filesystem::path& folder, WallDraft& draft, Rgba8& gap_color,
               Findings& findings) {
  const TomlValue* const table = document.table("test");
  if (table == nullptr) return;
  TableReader reader(*table, "test", findings);
  if (const auto rgba = reader.integers("gap_rgba", 4, 0, 255)) {
    const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>((*rgba)[i]); };
    gap_color = {byte(0), byte(1), byte(2), byte(3)};
  }
  if (reader.has("viewer_path")) {
    // For the first viewer, whatever tracks them otherwise.
    if (draft.viewers.empty()) draft.viewers.push_back({{}, table->place});
    WallTracker recorded;
    read_path(reader, "viewer_path", folder, recorded);
    draft.viewers.front().viewer.tracker = recorded;
  }
  reader.ignore({"headless", "scale", "dump"});
  reader.finish();
}

void read_monitors(TableReader& document, WallDraft& draft, Findings& findings) {
  for (const TomlValue* const table : document.tables("monitors")) {
    TableReader reader(*table, "monitor", findings);
    DraftMonitor monitor{{}, table->place, reader.place("surface")};
    reader.require("id", "\"operator\"");
    monitor.monitor.id = reader.id("id").value_or("");
    monitor.monitor.surface = reader.text("surface").value_or("");
    const auto rect = reader.rect("rect");
    const auto pixels = reader.integers("pixels", 2, 1, kMostScreenSide);
    if (reader.has("rect") == reader.has("pixels")) {
      findings.error(table->place, "a monitor has either a rect or pixels",
                     "write rect = [x, y, width, height] on its display, or pixels = [1920, 540]");
    }
    if (rect) monitor.monitor.pixels = {rect->width(), rect->height()};
    if (pixels) monitor.monitor.pixels = {(*pixels)[0], (*pixels)[1]};
    const Size size = monitor.monitor.pixels;
    if (size.width > kMostScreenSide || size.height > kMostScreenSide) {
      reader.error("rect", fmt::format("is {} x {} pixels", size.width, size.height),
                   fmt::format("a monitor has at most {} a side", kMostScreenSide));
    }
    reader.ignore({"node", "display", "zoom"});
    reader.finish();
    draft.monitors.push_back(std::move(monitor));
  }
}

}  // namespace hpr
