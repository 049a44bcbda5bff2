#pragma once

#include <string>
#include <vector>

#include "app/options/globals.h"
#include "tools/bench/bench_scale.h"
#include "tools/bench/bench_scale_report.h"

namespace CLI {
class App;
}  // namespace CLI

namespace hpr {

/// `hpr bench scale`: the same frames by jobs of several sizes, as MPI jobs of this program.
class ScaleBench {
 public:
  void declare(CLI::App& app);
  [[nodiscard]] ExitCode run(const Globals& globals, bool json) const;

 private:
  /// One job's size.
  struct Job {
    int ranks = 1;
    int threads = 1;
  };

  [[nodiscard]] ScaleInput make_input(const Globals& globals) const;
  void check_files(const Globals& globals) const;
  /// Empty: nothing was said.
  [[nodiscard]] std::vector<int> ranks_said(const Globals& globals) const;
  [[nodiscard]] std::vector<int> threads_said(const Globals& globals) const;
  [[nodiscard]] std::vector<Job> jobs(const Globals& globals) const;
  [[nodiscard]] ExitCode run_in_job(const Globals& globals, const ScaleInput& input, bool json) const;
  [[nodiscard]] ExitCode run_jobs(const Globals& globals, const ScaleInput& input, bool json) const;
  [[nodiscard]] ExitCode finish(const Globals& globals, const ScaleInput& input, std::vector<ScaleRun> runs,
                                bool json) const;

  std::string scene_ = "gen:gallery";
  std::string size_ = "1280x1024";
  std::string tiles_ = "1x1";
  std::string ranks_;
  std::string threads_;
  int frames_ = 5;
  int warmup_ = 1;
  std::string csv_;
  std::string html_;
  RenderOptions options_;
};

}  // namespace hpr
