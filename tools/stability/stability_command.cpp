#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <iterator>
#include <new>

#include "app/command.h"
#include "core/error.h"
#include "core/file.h"
#include "core/json.h"
#include "core/log.h"
#include "core/text.h"
#include "raster/gl_context.h"
#include "tools/stability/stability.h"
#include "tools/sweep.h"

namespace hpr {
namespace {

class StabilityCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "stability"; }
  [[nodiscard]] std::string_view summary() const override {
    return "drive everything to its extremes: each case's limit, what was measured, where it breaks";
  }

  void declare(const OptionSet& options) override {
    options.option("--case", names_, "only these cases").list().type("NAME,...");
    options.flag("--list", list_, "print the cases and measure nothing");
    options.option("--html", html_, "write the report as one page with plots").type("FILE");
    options.flag("--json", json_, "print the findings as JSON");
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    const std::vector<StabilityCase> cases = chosen_cases();
    if (list_ && json_) {
      Json list = Json::array();
      for (const StabilityCase& one : cases) list.push_back({{"name", one.name}, {"about", one.about}});
      fmt::print("{}\n", Json{{"schema", "hpr.stability-cases/1"}, {"cases", list}}.dump(2));
      return ExitCode::Done;
    }
    if (list_) {
      for (const StabilityCase& one : cases) fmt::print("{:<20} {}\n", one.name, one.about);
      return ExitCode::Done;
    }
    check_gl_backend(globals.backend);  // its cases draw by OpenGL themselves
    if (!html_.empty()) check_writable(html_, globals.force);
    const std::vector<StabilityFinding> findings = measure(cases, globals);
    write_if_named(html_, [&] { return stability_html(findings); });
    const std::string text = json_ ? stability_json(findings) : stability_table(findings);
    std::fputs(text.c_str(), stdout);
    const bool all_hold = std::ranges::all_of(findings, &StabilityFinding::holds);
    return all_hold ? ExitCode::Done : ExitCode::CheckFailed;
  }

 private:
  /// In the order of the report, whatever the order they were named in.
  [[nodiscard]] std::vector<StabilityCase> chosen_cases() const {
    const std::span<const StabilityCase> all = all_stability_cases();
    std::vector<std::string> choices;
    for (const StabilityCase& one : all) choices.emplace_back(one.name);
    for (const std::string& name : names_) {
      if (std::ranges::find(choices, name) != choices.end()) continue;
      throw Error(ExitCode::Usage, fmt::format("--case: no case is named '{}'", printable(name)),
                  unknown_name_hint(name, choices));
    }
    std::vector<StabilityCase> some;
    std::ranges::copy_if(all, std::back_inserter(some), [&](const StabilityCase& one) {
      return names_.empty() || std::ranges::find(names_, one.name) != names_.end();
    });
    return some;
  }

  /// A case that ends in an error breaks, and keeps nobody from the findings of the others.
  static std::vector<StabilityFinding> findings_of(const StabilityCase& one, const Globals& globals) {
    const auto ended = [&](const std::string& why) -> std::vector<StabilityFinding> {
      log::error("{}: {}", one.name, why);
      return {{.name = fmt::format("{}/ended", one.name),
               .parameter = why,
               .limit = 0.0,
               .measured = 1.0,
               .unit = "errors",
               .bound = Bound::AtMost,
               .breaks_at = std::nullopt,
               .why = "every case can be measured to its end"}};
    };
    try {
      std::vector<StabilityFinding> findings = one.measure(globals);
      for (StabilityFinding& finding : findings) {
        if (!finding.breaks_at) finding.breaks_at = breaking_point_of_curve(finding);
      }
      return findings;
    } catch (const Error& error) {
      if (error.code() == ExitCode::NoDevice) throw;  // without graphics hardly a case can be measured
      return ended(error.hint().empty() ? error.what() : fmt::format("{} ({})", error.what(), error.hint()));
    } catch (const std::bad_alloc&) {
      return ended("out of memory");
    } catch (const std::exception& error) {
      return ended(error.what());
    }
  }

  static std::vector<StabilityFinding> measure(const std::vector<StabilityCase>& cases, const Globals& globals) {
    std::vector<StabilityFinding> findings;
    (void)measure_cases(
        {globals.progress, "case", cases.size()}, [&](std::size_t i) { return std::string(cases[i].name); },
        [&](std::size_t i) {
          std::ranges::move(findings_of(cases[i], globals), std::back_inserter(findings));
          return CaseResult{};
        });
    return findings;
  }

  std::vector<std::string> names_;
  std::string html_;
  bool list_ = false;
  bool json_ = false;
};

}  // namespace

/// `hpr stability`: every extreme's limit, what was measured and where it breaks. Exit 1 when a promise does not hold.
std::unique_ptr<Command> make_stability_command() {
  return std::make_unique<StabilityCommand>();
}

}  // namespace hpr
