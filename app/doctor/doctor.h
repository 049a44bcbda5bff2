#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "core/error.h"

namespace hpr {

struct Globals;

/// What a check found: green, yellow (works, but something is slower or missing) or red (hpr cannot do its work).
enum class FindingStatus { Ok, Warn, Fail };

/// A device that Vulkan knows, and what hpr would use it for.
struct DeviceFinding {
  int index = 0;  ///< of --device
  std::string name;
  std::string driver;
  std::uint64_t memory_bytes = 0;
  bool software = false;         ///< the CPU does its work
  std::vector<std::string> use;  ///< "keys" and "light", or nothing
  std::string backend;           ///< the --backend that uses it unasked ("auto") or as asked ("vulkan"); empty: none
  std::string why;               ///< why not for more
};

struct Finding {
  std::string name;
  FindingStatus status = FindingStatus::Ok;
  std::string detail;  ///< what is there, one line
  std::string remedy;  ///< the command or step that mends it; empty when nothing needs mending
  std::vector<DeviceFinding> devices = {};
};

/// One thing to look at. A check that throws is red, with the error's message and hint.
struct Check {
  std::string name;
  std::function<Finding()> run;  ///< its finding's name is filled in by examine()
};

/// What any machine is asked: CPU, memory, Embree, MPI, shared memory, temporary folder, host name, image module,
/// stack.
[[nodiscard]] std::vector<Check> machine_checks();

/// Whether a job of two ranks starts: takes this program's main, which knows what its ranks do.
[[nodiscard]] Check job_check();
/// Whether this process is a rank of the job that job_check() started.
[[nodiscard]] bool is_doctors_job();
/// What such a rank does. Collective.
[[nodiscard]] ExitCode run_doctors_job(const Globals& globals);

/// Runs `checks` in order.
[[nodiscard]] std::vector<Finding> examine(std::span<const Check> checks);

/// No finding is red.
[[nodiscard]] bool healthy(std::span<const Finding> findings);

/// One line a finding, and its remedy below it; with terminal colours or without.
[[nodiscard]] std::string findings_text(std::span<const Finding> findings, bool colors);
[[nodiscard]] std::string findings_json(std::span<const Finding> findings);

/// One check per GL backend of this build: does a context come up, and on what? Red only when none does.
[[nodiscard]] std::vector<Check> graphics_checks();

struct GpuInfo;
/// What hpr would use a device for.
[[nodiscard]] DeviceFinding judge(const GpuInfo& gpu);

/// The machine a figure was measured on, as reports name it.
struct Machine {
  std::string cpu;  ///< model name; "unknown" where the system does not say
  int cores = 1;    ///< job_cores()
  std::string mpi;  ///< library and version
};
[[nodiscard]] Machine this_machine();

/// The cores of this machine that this process may use or, in an MPI job, its ranks together: a launcher may bind each
/// to cores of its own.
[[nodiscard]] int job_cores();

}  // namespace hpr
