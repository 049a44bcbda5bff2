#include "walls/config/import/importer.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "core/error.h"
#include "core/text.h"
#include "walls/config/wall_file.h"

namespace hpr {
namespace {

/// Windows that lie on others of one display are no error there, but would be here: they lose their places.
void drop_overlaps(ImportedWall& imported) {
  std::vector<WallWindow>& windows = imported.wall.windows;
  std::string dropped;
  for (auto window = windows.begin(); window != windows.end(); ++window) {
    const bool covers = std::any_of(windows.begin(), window, [&](const WallWindow& other) {
      return other.node == window->node && other.display == window->display && !other.rect.empty() &&
             !intersection(other.rect, window->rect).empty();
    });
    if (!covers) continue;
    window->rect = {};
    dropped += (dropped.empty() ? "" : ", ") + window->id;
  }
  if (dropped.empty()) return;
  imported.remarks.push_back(
      "These windows lie on others of their display, and their places were left out: " + dropped + ".");
}

}  // namespace

std::span<const WallImporter> all_importers() {
#define HPR_LIST_IMPORTER(name) name##_importer(),
  static const std::array importers{HPR_IMPORTERS(HPR_LIST_IMPORTER)};
#undef HPR_LIST_IMPORTER
  return importers;
}

const std::vector<std::string>& importer_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const WallImporter& importer : all_importers()) {
      all.emplace_back(importer.name);
      if (importer.alias != importer.name) all.emplace_back(importer.alias);
    }
    return all;
  }();
  return names;
}

std::string import_wall(std::string_view text, const std::string& name, std::string_view kind,
                        const ImportSettings& settings) {
  const auto importers = all_importers();
  const auto found = std::ranges::find_if(
      importers, [&](const WallImporter& importer) { return kind == importer.name || kind == importer.alias; });
  if (found == importers.end()) {
    throw Error(ExitCode::Usage, fmt::format("unknown kind of wall file '{}'", printable(kind)),
                unknown_name_hint(kind, importer_names()));
  }
  ImportedWall imported = found->read(text, name, settings);
  drop_overlaps(imported);
  std::string toml = fmt::format("# From {} ({}).\n", printable(name, 200), found->name);
  for (const std::string& remark : imported.remarks) toml += fmt::format("# {}\n", printable(remark, 400));
  toml += expand_wall(imported.wall);
  for (const WallFinding& finding : parse_wall(toml, name + " (imported)").findings) {
    if (finding.error) throw Error(ExitCode::BadInput, finding.what, finding.hint, finding.line);
  }
  return toml;
}

}  // namespace hpr
