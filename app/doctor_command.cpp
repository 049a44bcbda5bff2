#include "app/doctor_command.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <utility>

#include "app/launcher.h"

namespace hpr {
namespace {

/// https://no-color.org: any value that is not empty turns colours off. A job's launcher gives rank 0 a terminal that
/// nobody looks at.
bool colors_wanted() {
  const char* const no_color = std::getenv("NO_COLOR");
  return (no_color == nullptr || *no_color == '\0') && !inside_mpi_job() && ::isatty(STDOUT_FILENO) == 1;
}

class DoctorCommand final : public Command {
 public:
  explicit DoctorCommand(std::vector<Check> graphics) : graphics_(std::move(graphics)) {}

  [[nodiscard]] std::string_view name() const override { return "doctor"; }
  [[nodiscard]] std::string_view summary() const override {
    return "what this machine can do, and the command that mends what it cannot";
  }

  void declare(CLI::App& app) override { app.add_flag("--json", json_, "print the findings as JSON"); }

  [[nodiscard]] ExitCode run(const Globals& /*globals*/) override {
    std::vector<Check> checks = machine_checks();
    checks.insert(checks.end(), graphics_.begin(), graphics_.end());
    const std::vector<Finding> findings = examine(checks);
    const std::string text = json_ ? findings_json(findings) : findings_text(findings, colors_wanted());
    std::fputs(text.c_str(), stdout);
    return healthy(findings) ? ExitCode::Done : ExitCode::CheckFailed;
  }

 private:
  std::vector<Check> graphics_;
  bool json_ = false;
};

}  // namespace

std::unique_ptr<Command> make_doctor_command(std::vector<Check> graphics) {
  return std::make_unique<DoctorCommand>(std::move(graphics));
}

}  // namespace hpr
