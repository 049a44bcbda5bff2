#include <fmt/format.h>

#include <cstdio>
#include <filesystem>

#include "core/error.h"
#include "core/file.h"
#include "tools/compare/schedule_drawing.h"

// Writes the drawings of docs/compositing.md: draw_strategies FOLDER. Built beside hpr, not installed.
namespace hpr {
namespace {

void draw(const std::filesystem::path& folder, std::string_view strategy, const LocalRanks& ranks,
          std::string_view file) {
  const RecordedFrame frame = record_frame([&] { return make_compositor(strategy); }, ranks);
  write_file_atomically(folder / fmt::format("{}.svg", file), draw_schedule(file, frame));
}

}  // namespace
}  // namespace hpr

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: draw_strategies FOLDER\n", stderr);
    return static_cast<int>(hpr::ExitCode::Usage);
  }
  try {
    for (const auto& compositor : hpr::all_compositors()) {
      // What these do on 8 ranks others show: auto does what it chooses, radix-k has one group, which is direct send.
      if (compositor->name() == "auto" || compositor->name() == "radix-k") continue;
      hpr::draw(argv[1], compositor->name(), {.size = 8}, compositor->name());
    }
    hpr::draw(argv[1], "radix-k:4,2", {.size = 8}, "radix-k-4-2");
    hpr::draw(argv[1], "binary-swap", {.size = 6}, "binary-swap-of-6");
    hpr::draw(argv[1], "shared-memory", {.size = 8, .ranks_per_host = 4}, "shared-memory-of-2-hosts");
  } catch (const hpr::Error& error) {
    std::fprintf(stderr, "draw_strategies: %s\n", error.what());
    return static_cast<int>(error.code());
  }
}
