#pragma once

#include <string>
#include <vector>

#include "app/options/globals.h"
#include "app/options/render_options.h"
#include "tools/bench/bench_raster.h"

namespace CLI {
class App;
}  // namespace CLI

namespace hpr {

/// `hpr bench frame`: a whole frame of one rank, step by step, beside what bare libraries need for as much.
class FrameBench {
 public:
  void declare(CLI::App& app);
  /// Rows in ms of all threads together. Keys: against BareGl with the same triangles, or bare Embree's primary rays
  /// where rays make them. A pass: against bare Embree tracing as many rays of its kind, on the same scene. To the
  /// screen: against a copy of the picture's bytes. The frame: against the sum of these floors; shading and what else
  /// has none lowers the ratio.
  [[nodiscard]] std::vector<BenchRow> run(const Globals& globals) const;

 private:
  std::string scene_ = "gen:gallery";
  std::string size_ = "1280x720";
  int frames_ = 5;
  RenderOptions options_;
};

}  // namespace hpr
