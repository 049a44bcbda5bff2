#include "app/doctor/doctor.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string_view>

#include "app/command.h"
#include "core/error.h"
#include "core/job_environment.h"
#include "core/json.h"
#include "core/text.h"

namespace hpr {
namespace {

struct StatusStyle {
  std::string_view text;
  std::string_view color;
};

StatusStyle style_of(FindingStatus status) {
  switch (status) {
    case FindingStatus::Warn:
      return {"warn", "\x1b[33m"};
    case FindingStatus::Fail:
      return {"fail", "\x1b[31m"};
    case FindingStatus::Ok:
      break;
  }
  return {"ok", "\x1b[32m"};
}

Finding outcome(const Check& check) {
  try {
    return check.run();
  } catch (const Error& error) {
    return {{}, FindingStatus::Fail, error.what(), error.hint()};
  } catch (const std::exception& error) {
    return {{}, FindingStatus::Fail, error.what(), {}};
  }
}

}  // namespace

std::vector<Finding> examine(std::span<const Check> checks) {
  std::vector<Finding> findings;
  for (const Check& check : checks) {
    findings.push_back(outcome(check));
    findings.back().name = check.name;
  }
  return findings;
}

bool healthy(std::span<const Finding> findings) {
  return std::ranges::none_of(findings, [](const Finding& f) { return f.status == FindingStatus::Fail; });
}

namespace {

std::string describe(const DeviceFinding& device) {
  return fmt::format("{}: {}, driver {}, {}: {}{}{}", device.index, device.name, device.driver,
                     format_bytes(device.memory_bytes),
                     device.use.empty() ? "of no use" : fmt::format("{}", fmt::join(device.use, " and ")),
                     device.backend.empty() ? "" : " by --backend " + device.backend,
                     device.why.empty() ? "" : fmt::format(" ({})", device.why));
}

Json to_json(const DeviceFinding& device) {
  return {{"index", device.index},
          {"name", device.name},
          {"driver", device.driver},
          {"memory_bytes", device.memory_bytes},
          {"software", device.software},
          {"use", device.use},
          {"backend", device.backend.empty() ? Json() : Json(device.backend)},
          {"why", device.why}};
}

}  // namespace

std::string findings_text(std::span<const Finding> findings, bool colors) {
  std::size_t width = 0;
  for (const Finding& finding : findings) width = std::max(width, finding.name.size());
  std::string text;
  for (const Finding& finding : findings) {
    const StatusStyle style = style_of(finding.status);
    text += fmt::format("{}{:<4}{}  {:<{}}  {}\n", colors ? style.color : "", style.text, colors ? "\x1b[0m" : "",
                        finding.name, width, finding.detail);
    for (const DeviceFinding& device : finding.devices)
      text += fmt::format("{:{}}{}\n", "", width + 8, describe(device));
    if (!finding.remedy.empty()) text += fmt::format("{:{}}-> {}\n", "", width + 8, finding.remedy);
  }
  return text;
}

std::string findings_json(std::span<const Finding> findings) {
  Json json{{"schema", "hpr.doctor/1"}, {"healthy", healthy(findings)}, {"findings", Json::array()}};
  for (const Finding& finding : findings) {
    Json made{{"name", finding.name},
              {"status", style_of(finding.status).text},
              {"detail", finding.detail},
              {"remedy", finding.remedy}};
    for (const DeviceFinding& device : finding.devices) made["devices"].push_back(to_json(device));
    json["findings"].push_back(std::move(made));
  }
  return json.dump(2) + "\n";
}

namespace {

/// https://no-color.org: any value that is not empty turns colours off. A job's launcher gives rank 0 a terminal that
/// nobody looks at.
bool colors_wanted() {
  const char* const no_color = std::getenv("NO_COLOR");
  return (no_color == nullptr || *no_color == '\0') && !inside_mpi_job() && ::isatty(STDOUT_FILENO) == 1;
}

class DoctorCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "doctor"; }
  [[nodiscard]] std::string_view summary() const override {
    return "what this machine can do, and the command that mends what it cannot";
  }

  void declare(const OptionSet& options) override { options.flag("--json", json_, "print the findings as JSON"); }

  [[nodiscard]] bool collective() const override { return is_doctors_job(); }
  [[nodiscard]] ExitCode run(const Globals& globals) override {
    if (is_doctors_job()) return run_doctors_job(globals);
    std::vector<Check> checks = machine_checks();
    checks.push_back(job_check());
    const std::vector<Check> graphics = graphics_checks();
    checks.insert(checks.end(), graphics.begin(), graphics.end());
    const std::vector<Finding> findings = examine(checks);
    const std::string text = json_ ? findings_json(findings) : findings_text(findings, colors_wanted());
    std::fputs(text.c_str(), stdout);
    return healthy(findings) ? ExitCode::Done : ExitCode::CheckFailed;
  }

 private:
  bool json_ = false;
};

}  // namespace

/// `hpr doctor`: what this machine can do, and the command that mends what it cannot. Exit 1 when a finding is red.
std::unique_ptr<Command> make_doctor_command() {
  return std::make_unique<DoctorCommand>();
}

}  // namespace hpr
