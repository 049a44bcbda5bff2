#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <utility>

#include "app/command.h"
#include "app/doctor/doctor.h"
#include "app/doctor/graphics_checks.h"
#include "core/job_environment.h"

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
  [[nodiscard]] std::string_view name() const override { return "doctor"; }
  [[nodiscard]] std::string_view summary() const override {
    return "what this machine can do, and the command that mends what it cannot";
  }

  void declare(const OptionSet& options) override { options.flag("--json", json_, "print the findings as JSON"); }

  [[nodiscard]] ExitCode run(const Globals& /*globals*/) override {
    std::vector<Check> checks = machine_checks();
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
