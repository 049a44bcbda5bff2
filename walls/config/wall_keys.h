#pragma once

#include <string>

#include "walls/config/key_table.h"
#include "walls/config/wall.h"
#include "walls/config/wall_draft.h"

/// The table of wall files' keys. Whatever reads, writes or describes a wall file takes its keys from here.
namespace hpr {

/// The outermost table. Its tables of nodes, windows, surfaces, viewers and monitors are read by wall_reader.cpp, with
/// the tables below.
[[nodiscard]] const KeyTable<Wall>& wall_keys();
[[nodiscard]] const KeyTable<WallNode>& node_keys();
[[nodiscard]] const KeyTable<WallWindow>& window_keys();
[[nodiscard]] const KeyTable<DraftSurface>& surface_keys();
[[nodiscard]] const KeyTable<DraftGrid>& grid_keys();
[[nodiscard]] const KeyTable<WallScreen>& screen_keys();
[[nodiscard]] const KeyTable<ScreenWarp>& warp_keys();
[[nodiscard]] const KeyTable<WallViewer>& viewer_keys();
[[nodiscard]] const KeyTable<WallMonitor>& monitor_keys();

/// What a wall file may hold as a JSON Schema (draft 2020-12), for editors and other programs: every key, its type and
/// range. What spans tables (names that must exist, screens that must not overlap) only reading a file finds.
[[nodiscard]] std::string wall_schema();

/// The tables of keys of docs/walls.md.
[[nodiscard]] std::string wall_keys_markdown();

/// Reads the file of a recorded head that `key` names into the tracker; what is wrong with it is a finding.
void read_head_recording(const KeySource& source, WallTracker& tracker);

}  // namespace hpr
