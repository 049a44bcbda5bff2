#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "app/command.h"
#include "core/file.h"
#include "core/parallel.h"
#include "core/text.h"
#include "engine/output.h"
#include "tools/diff/diff.h"

namespace hpr {
namespace {

class DiffCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "diff"; }
  [[nodiscard]] std::string_view summary() const override {
    return "how far two pictures (PNG, JPEG, WebP, EXR) or two files of keys are apart";
  }

  void declare(const OptionSet& options) override {
    options.option("A", a_, "the reference: a picture, or a .keys file of hpr render --raw").required();
    options.option("B", b_, "what is compared with it").required();
    options
        .option("--metric", metrics_,
                "rmse, psnr, max, differing, mean, relmse, ssim, flip: which to print (default: all but the last two, "
                "which take longer)")
        .list();
    options.option("--fail", tolerance_.value, "largest allowed absolute difference of a value, 1 = white (default 0)");
    options.option("--fail-percent", tolerance_.percent, "share of pixels that may exceed it (default 0)");
    options.option("-o,--output", heat_, "write where and how much they differ as a PNG");
    options.flag("--json", json_, "print the result as JSON");
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    check_options(globals);
    const int threads = globals.threads > 0 ? globals.threads : usable_cores();
    const DiffReport report = diff_files(a_, b_, tolerance_, globals.picture_limits(), metrics_, threads);
    if (!heat_.empty()) write_png(heat_, heat_map(report));
    const std::string text = json_ ? diff_json(report, metrics_, a_, b_, tolerance_) : diff_table(report, metrics_);
    std::fputs(text.c_str(), stdout);
    return report.passed ? ExitCode::Done : ExitCode::CheckFailed;
  }

 private:
  void check_options(const Globals& globals) {
    for (const std::string& metric : metrics_) {
      if (std::ranges::find(diff_metrics(), metric) == diff_metrics().end()) {
        throw Error(ExitCode::Usage, fmt::format("--metric: there is no metric '{}'", printable(metric)),
                    unknown_name_hint(metric, diff_metrics()));
      }
    }
    const bool keys = is_keys(a_);
    for (const std::string& metric : metrics_) {
      if (!keys || metric == "max" || metric == "differing") continue;
      throw Error(ExitCode::Usage, fmt::format("--metric {} is of pictures; keys have max and differing", metric),
                  "compare the rendered pictures");
    }
    if (metrics_.empty()) metrics_ = quick_diff_metrics();
    if (!(tolerance_.value >= 0.0) || std::isinf(tolerance_.value)) {
      throw Error(ExitCode::Usage, "--fail is not a difference", "give a number from 0 on, like --fail 0.004");
    }
    if (!(tolerance_.percent >= 0.0 && tolerance_.percent <= 100.0)) {
      throw Error(ExitCode::Usage, "--fail-percent is not a share", "give a number from 0 to 100");
    }
    if (heat_.empty()) return;
    if (std::filesystem::path(heat_).extension() != ".png") {
      throw Error(ExitCode::Usage, fmt::format("-o {}: the map of differences is a PNG", printable(heat_)),
                  "name a .png file");
    }
    if (keys) {
      throw Error(ExitCode::Usage, "-o is for pictures: a file of keys does not know its width",
                  "compare the rendered pictures");
    }
    for (const std::string& compared : {a_, b_}) {
      std::error_code error;
      if (!std::filesystem::equivalent(heat_, compared, error)) continue;
      throw Error(ExitCode::Usage, fmt::format("-o {}: that is one of the pictures", printable(heat_)),
                  "name another file");
    }
    check_writable(heat_, globals.force);
  }

  std::string a_;
  std::string b_;
  std::vector<std::string> metrics_;
  DiffTolerance tolerance_;
  std::string heat_;
  bool json_ = false;
};

}  // namespace

/// `hpr diff A B`: how far two pictures, or two files of keys, are apart. Exit 0 when within tolerance, else 1.
std::unique_ptr<Command> make_diff_command() {
  return std::make_unique<DiffCommand>();
}

}  // namespace hpr
