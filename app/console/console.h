#pragma once

#include <memory>
#include <string>

#include "app/options/render_options.h"
#include "engine/frame_sampler.h"
#include "engine/output.h"
#include "engine/wall/controls.h"

namespace hpr {

/// A resident session: a scene, how it is drawn, and the last picture of it. Every rank has one and is told the same
/// lines.
class Console {
 public:
  /// All outlive this.
  Console(Session& session, const Globals& globals, RenderSettings settings, Size size);

  /// Collective. What the line has to tell. Throws Error where nothing was done: the session stays as it was.
  [[nodiscard]] std::string run(const std::string& line) { return table_.run(line); }
  [[nodiscard]] bool quits() const { return quits_; }
  /// After an error: it came in the middle of a picture, perhaps on one rank alone.
  [[nodiscard]] bool drawing() const { return drawing_; }

 private:
  /// A picture as it was drawn, whatever changed since.
  struct Picture {
    FramePlan plan;
    Blocks blocks;
    Size size;
    double exposure = 0.0;
    ColorFormat colors = ColorFormat::Float32;
    std::unique_ptr<FrameSampler> sampler;
    RunStats stats;
    std::string scene_name;
  };

  std::string set_size(Words words);
  std::string render();
  std::string save(Words words);
  [[nodiscard]] std::string write_stats_of(Words words) const;
  std::string explain();
  [[nodiscard]] const Picture& picture() const;
  [[nodiscard]] View view() const;

  Session& session_;
  const Globals& globals_;
  RenderSettings settings_;
  Size size_;
  CommandTable table_;
  Controls controls_;
  std::unique_ptr<Picture> picture_;
  bool quits_ = false;
  bool drawing_ = false;
};

}  // namespace hpr
