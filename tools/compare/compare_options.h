#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "app/options/globals.h"
#include "app/options/option_set.h"
#include "app/options/render_options.h"
#include "image/image.h"
#include "tools/compare/compare.h"

/// The options of `hpr compare`, and how their values are written. Functions throw Error (Usage) for other values.
namespace hpr {

/// A list of strategies; numbers in it belong to the strategy before them: "tree,radix-k:4,2,ring".
[[nodiscard]] std::vector<std::string> split_strategies(std::string_view list);

/// The options' values, and what follows from them alone.
struct CompareOptions {
  std::string scene;
  std::string synthetic;
  std::string size = "1920x1080";
  std::string tiles = "1x1";
  std::string ranks;
  std::string operator_name = "nearest";
  std::string strategies = "all";
  std::string distributions;  ///< of whole frames, in place of strategies; empty: strategies are compared
  RenderSettings settings;    ///< of whole frames; of layers only how they are shaded
  int frames = 10;
  int warmup = 2;
  std::string transport = "mpi";
  std::string simulate;
  std::string csv;
  std::string html;
  bool json = false;
  std::string picture;
  std::string raw;

  void declare(const OptionSet& options);
  /// Completes defaults that depend on other options. Throws Error for what can be refused before any rank starts, but
  /// for the names of files.
  void resolve();
  void check_files(const Globals& globals) const;

  [[nodiscard]] bool on_threads() const { return transport == "threads" || !simulate.empty(); }
  [[nodiscard]] bool local_shading() const { return settings.frame.shading == Shading::Local; }
  [[nodiscard]] CompareOperator operation() const;
  /// The pixels of a screen, and the screens of the wall. Throws Error for what is no size, or too large.
  struct WallSize {
    Size screen;
    Size grid;
  };
  [[nodiscard]] WallSize wall_size(const Globals& globals) const;
  /// Empty inside an MPI job unless --ranks is given.
  [[nodiscard]] std::vector<int> rank_counts() const;
  [[nodiscard]] CompareSettings settings_for(int count) const;
  /// The arguments after `hpr` that decide the result and on what it is measured, without the number of ranks.
  [[nodiscard]] std::vector<std::string> arguments(const Globals& globals) const;

 private:
  void check_transport() const;
  void check_operator() const;
  void check_settings() const;
  void check_whole_frames() const;
  [[nodiscard]] std::vector<std::string> all_strategies_for(int count) const;
  [[nodiscard]] std::vector<std::string> strategies_for(int count) const;
  /// Throws Error (Usage) when no strategy of that name can do what is asked for, whatever the number of ranks.
  void check_strategy(const std::string& name) const;
  [[nodiscard]] bool fits(const std::string& name, int count) const;

  std::optional<Option> frames_option_;
  std::optional<Option> strategies_option_;
};

}  // namespace hpr
